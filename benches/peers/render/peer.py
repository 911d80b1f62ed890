"""What the renderers have in common: a scene from its folder, and answers to what `compare.py` asks, a line of JSON each."""

import json
import os
import pathlib
import sys
import time

import numpy as np


class Scene:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        scene = json.loads((self.folder / "scene.json").read_text())
        numbers = np.fromfile(str(self.folder / "mesh.f32"), "<f4")
        self.vertices, rest = np.split(numbers, [3 * scene["vertices"]])
        self.colors, faces = np.split(rest, [3 * scene["vertices"]])
        self.vertices, self.colors = self.vertices.reshape(-1, 3), self.colors.reshape(-1, 3)
        self.faces = faces.reshape(-1, 3).astype(np.uint32)
        self.width, self.height, self.focal = scene["width"], scene["height"], scene["focal"]
        guess = np.reshape(scene["guess"], (3, 4))
        # The guess; derivatives are by a twist (shift, turn) about its origin.
        self.turn, self.shift = guess[:, :3], guess[:, 3]
        self.placed = self.vertices @ self.turn.T + self.shift

    def target(self):
        pixels = np.fromfile(str(self.folder / "target.f32"), "<f4")
        return pixels.reshape(self.height, self.width, 3)

    def twist(self, by_vertices):
        """The derivative by the twist, of that by the placed vertices."""
        arms = self.placed - self.shift
        return np.concatenate([by_vertices.sum(0), np.cross(arms, by_vertices).sum(0)])


def times(seconds, run):
    """Milliseconds of each run: one or more, for about so long."""
    times, begin = [], time.perf_counter()
    while not times or (len(times) < 500 and time.perf_counter() - begin < seconds):
        start = time.perf_counter()
        run(len(times))
        times.append(1e3 * (time.perf_counter() - start))
    return times


def serve(load):
    """Answers until its input ends. What `load` makes of a scene has `picture(seed)`, `value(seed)` and `gradient(seed)`."""
    # What libraries print must not come between the answers.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    scene = peer = None
    for line in sys.stdin:
        request = json.loads(line)
        answer = {}
        if request["do"] == "load":
            scene = Scene(request["scene"])
            peer = load(scene)
        elif request["do"] == "picture":
            np.asarray(peer.picture(request["seed"]), "<f4").tofile(str(scene.folder / "picture.f32"))
        elif request["do"] == "gradient":
            answer = {"gradient": [float(x) for x in peer.gradient(request["seed"])]}
        elif request["do"] == "time":
            answer = {"ms": times(request["seconds"], getattr(peer, request["what"]))}
        print(json.dumps(answer), file=answers, flush=True)
