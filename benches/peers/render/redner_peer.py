"""redner (`pip install redner torch==1.7.1`, Python 3.7): the argument is the number of samples a pixel.

Colors of the surface, antialiased, with edges sampled.
"""

import sys

import numpy as np
import pyredner
import torch

import peer

SAMPLES = int(sys.argv[1])
pyredner.set_use_gpu(False)
pyredner.set_print_timing(False)


class Redner:
    def __init__(self, scene):
        self.shift = torch.tensor(scene.shift, dtype=torch.float32)
        self.arms = torch.tensor(scene.placed - scene.shift, dtype=torch.float32)
        self.faces = torch.tensor(scene.faces.astype(np.int32))
        self.colors = torch.tensor(scene.colors)
        self.target = torch.tensor(scene.target())
        self.material = pyredner.Material(use_vertex_color=True)
        # The field of view is that across; cameras look along z with y up.
        self.camera = pyredner.Camera(
            cam_to_world=torch.diag(torch.tensor([1.0, -1.0, 1.0, 1.0])),
            fov=torch.tensor([float(np.degrees(2 * np.arctan(scene.width / 2 / scene.focal)))]),
            resolution=(scene.height, scene.width),
        )

    def render(self, shift, turn, seed):
        # A small turn to first order: its derivative at zero is that of any.
        placed = self.arms + torch.cross(turn.expand_as(self.arms), self.arms) + self.shift + shift
        body = pyredner.Object(placed, self.faces, self.material, colors=self.colors)
        drawn = pyredner.Scene(camera=self.camera, objects=[body])
        return pyredner.render_albedo(drawn, num_samples=SAMPLES, seed=(2 * seed, 2 * seed + 1))

    def picture(self, seed):
        return self.render(torch.zeros(3), torch.zeros(3), seed).detach().numpy()

    def value(self, seed):
        picture = self.render(torch.zeros(3), torch.zeros(3), seed)
        return float(torch.mean((picture - self.target) ** 2))

    def gradient(self, seed):
        shift, turn = (torch.zeros(3, requires_grad=True) for _ in range(2))
        torch.mean((self.render(shift, turn, seed) - self.target) ** 2).backward()
        return np.concatenate([shift.grad.numpy(), turn.grad.numpy()])


peer.serve(Redner)
