"""DEODR (`pip install deodr trimesh typing_extensions`): antialiased edges, colors interpolated in the picture."""

import numpy as np
from deodr.differentiable_renderer import Camera, Scene3D
from deodr.triangulated_mesh import ColoredTriMesh

import peer


class Deodr:
    def __init__(self, scene):
        self.scene = scene
        mesh = ColoredTriMesh(scene.faces, scene.placed, colors=scene.colors.astype(float))
        across, down = 0.5 * (scene.width - 1), 0.5 * (scene.height - 1)
        lens = np.array([[scene.focal, 0, across], [0, scene.focal, down], [0, 0, 1]])
        self.camera = Camera(np.eye(3, 4), lens, scene.height, scene.width)
        self.drawn = Scene3D(sigma=1)
        self.drawn.set_mesh(mesh)
        self.drawn.set_background_color([0.0, 0.0, 0.0])
        self.drawn.set_light(None, 1.0)
        self.target = scene.target().astype(float)

    def picture(self, seed):
        self.drawn.mesh.set_vertices(self.scene.placed)
        return self.drawn.render(self.camera)

    def value(self, seed):
        return np.mean((self.picture(seed) - self.target) ** 2)

    def gradient(self, seed):
        off = self.picture(seed) - self.target
        self.drawn.clear_gradients()
        self.drawn.render_backward(off * (2 / off.size))
        return self.scene.twist(self.drawn.mesh._vertices_b)


peer.serve(Deodr)
