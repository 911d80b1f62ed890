"""Mitsuba 3 (`pip install mitsuba`, and LLVM's shared library): the argument is the number of samples a pixel.

The body shines with its own colors, so that no light is traced. Silhouettes are sampled by the projective integrator.
"""

import sys

import drjit as dr
import mitsuba as mi
import numpy as np

import peer

mi.set_variant("llvm_ad_rgb")
SAMPLES = int(sys.argv[1])


class Mitsuba:
    def __init__(self, scene):
        mesh = mi.Mesh("body", len(scene.vertices), len(scene.faces))
        mesh.add_attribute("vertex_color", 3, scene.colors.ravel())
        parts = mi.traverse(mesh)
        parts["vertex_positions"] = scene.placed.astype(np.float32).ravel()
        parts["faces"] = scene.faces.ravel()
        parts.update()
        path = str(scene.folder / "body.ply")
        mesh.write_ply(path)
        color = {"type": "mesh_attribute", "name": "vertex_color"}
        body = {
            "type": "ply",
            "filename": path,
            "face_normals": True,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            "emitter": {"type": "area", "radiance": color},
        }
        film = {
            "type": "hdrfilm",
            "width": scene.width,
            "height": scene.height,
            "pixel_format": "rgb",
            "rfilter": {"type": "box"},
        }
        sensor = {
            "type": "perspective",
            "fov": float(np.degrees(2 * np.arctan(scene.width / 2 / scene.focal))),
            "fov_axis": "x",
            "near_clip": 0.01,
            "far_clip": 10.0,
            # Mitsuba's cameras look along z with x to the left and y up.
            "to_world": mi.ScalarTransform4f().rotate([0, 0, 1], 180),
            "film": film,
            "sampler": {"type": "independent"},
        }
        # Nothing is lit by anything else: no samples for indirect silhouettes.
        integrator = {"type": "direct_projective", "sppi": 0}
        self.scene = mi.load_dict(
            {"type": "scene", "integrator": integrator, "sensor": sensor, "body": body}
        )
        self.parts = mi.traverse(self.scene)
        self.key = next(k for k in self.parts.keys() if k.endswith("vertex_positions"))
        self.shift = mi.Vector3f(*map(float, scene.shift))
        arms = (scene.placed - scene.shift).astype(np.float32)
        self.arms = mi.Vector3f(*(mi.Float(np.ascontiguousarray(a)) for a in arms.T))
        self.target = mi.TensorXf(scene.target())

    def render(self, shift, turn, seed):
        # A small turn to first order: its derivative at zero is that of any.
        placed = self.arms + dr.cross(turn, self.arms) + self.shift + shift
        self.parts[self.key] = dr.ravel(mi.Point3f(placed))
        self.parts.update()
        return mi.render(self.scene, self.parts, spp=SAMPLES, seed=seed)

    def loss(self, shift, turn, seed):
        return dr.mean(dr.square(self.render(shift, turn, seed) - self.target), axis=None)

    def picture(self, seed):
        return np.array(self.render(mi.Vector3f(0), mi.Vector3f(0), seed))

    def value(self, seed):
        return float(self.loss(mi.Vector3f(0), mi.Vector3f(0), seed).array[0])

    def gradient(self, seed):
        shift, turn = mi.Vector3f(0), mi.Vector3f(0)
        dr.enable_grad(shift, turn)
        dr.backward(self.loss(shift, turn, seed))
        return np.concatenate([np.array(dr.grad(v)).ravel() for v in (shift, turn)])


peer.serve(Mitsuba)
