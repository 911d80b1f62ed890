"""Renderers that differentiate pictures of meshes on a CPU, beside ours: pictures, gradients by the pose, and time.

`python compare.py --redner PYTHON --tensorflow PYTHON`, in an environment with `mitsuba`, `deodr`, `trimesh` and
`typing_extensions`; redner and TensorFlow Graphics need older Pythons in environments of their own (see the heads of their files)
and are left out without them. Mitsuba needs LLVM (Debian's `libllvm19`), and DRJIT_LIBLLVM_PATH if it is not found.
Ours runs on RAYON_NUM_THREADS threads, two unless said otherwise; all others on as many as they like.

Prints two tables. Truth: the mean difference of the picture, over the body's pixels, from one of 25 x 25 rays a pixel (of 255);
cosine and relative error of the gradient of the mean squared error against central differences of such pictures, turns
scaled by 5 cm; the worse of both sizes, and the median of several runs where samples are random. Time: milliseconds for the
value, and for value and gradient, all in turns. Standard error gets the figures of each scene as they come, and the log of the
peers is `render_peers.log` in the folder of temporary files.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

import scenes

HERE = pathlib.Path(__file__).resolve().parent
RANDOM_RUNS = 3
ROUNDS, SECONDS = 3, 0.5


class Peer:
    def __init__(self, name, command, random=False):
        self.name, self.random = name, random
        self.process = subprocess.Popen(
            command, cwd=str(HERE), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=LOG, text=True
        )

    def ask(self, do, **more):
        self.process.stdin.write(json.dumps({"do": do, **more}) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self.name} ended; see {LOG.name}")
        return json.loads(line)


def peers(options):
    cargo = ["cargo", "run", "--release", "--quiet", "--manifest-path", "../Cargo.toml", "--bin", "render", "--"]
    yield Peer("ours, contour, 1 sample a pixel", cargo + ["contour", "1"])
    yield Peer("ours, contour, 16 samples", cargo + ["contour", "4"])
    yield Peer("ours, SoftRas, 50 faces a pixel", cargo + ["softras", "1"])
    yield Peer("DEODR", [sys.executable, "deodr_peer.py"])
    for samples in (1, 4):
        name = f"Mitsuba 3, {samples} sample{'s' if samples > 1 else ''}"
        yield Peer(name, [sys.executable, "mitsuba_peer.py", str(samples)], random=True)
    if options.redner:
        yield Peer("redner, 4 samples", [options.redner, "redner_peer.py", "4"], random=True)
    if options.tensorflow:
        yield Peer("TensorFlow Graphics, splats", [options.tensorflow, "tensorflow_peer.py", "1"])


def scaled(gradient):
    return np.asarray(gradient) / np.repeat([1.0, scenes.ARM], 3)


def errors(gradient, truth):
    """Cosine and relative error."""
    a, b = scaled(gradient), scaled(truth)
    return a @ b / np.linalg.norm(a) / np.linalg.norm(b), np.linalg.norm(a - b) / np.linalg.norm(b)


def compare(folder, all_peers):
    """For each peer the difference of its picture, cosine and error of its gradient, and of the mean of several, and times."""
    truth = all_peers[0].ask("reference", scene=str(folder))["gradient"]
    read = lambda name: np.fromfile(str(folder / name), "<f4").reshape(-1, 3)
    reference = read("reference.f32")
    body = reference.any(1)
    rows = []
    for peer in all_peers:
        peer.ask("load", scene=str(folder))
        peer.ask("picture", seed=0)
        off = 255 * np.abs(read("picture.f32") - reference)[body].mean()
        seeds = range(RANDOM_RUNS if peer.random else 1)
        gradients = [peer.ask("gradient", seed=seed)["gradient"] for seed in seeds]
        each = [errors(gradient, truth) for gradient in gradients]
        rows.append([off, *np.median(each, 0), *errors(np.mean(gradients, 0), truth)])
    times = [([], []) for _ in all_peers]
    for _ in range(ROUNDS):
        for peer, mine in zip(all_peers, times):
            for what, runs in zip(("value", "gradient"), mine):
                runs += peer.ask("time", what=what, seconds=SECONDS)["ms"]
    return [row + [statistics.median(t) for t in mine] for row, mine in zip(rows, times)]


def number(milliseconds):
    return f"{milliseconds:.2f}" if milliseconds < 10 else f"{milliseconds:.0f}"


def progress(title, all_peers, rows):
    """What is known so far, for a run that is stopped."""
    print(title, file=sys.stderr)
    for peer, row in zip(all_peers, rows):
        print(f"  {peer.name}: " + " ".join(f"{x:.5g}" for x in row), file=sys.stderr, flush=True)


def table(columns, rows):
    print("\n| | " + " | ".join(columns) + " |\n|---|" + "--:|" * len(columns))
    for name, cells in rows:
        print(f"| {name} | " + " | ".join(cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--redner", help="the Python that has redner")
    parser.add_argument("--tensorflow", help="the Python that has TensorFlow Graphics")
    options = parser.parse_args()
    begin = time.time()
    os.environ.setdefault("RAYON_NUM_THREADS", "2")
    all_peers = list(peers(options))
    truth, times = [[] for _ in all_peers], [[] for _ in all_peers]
    for body in scenes.BODIES:
        scene_rows = []
        for size in scenes.SIZES:
            folder = pathlib.Path(tempfile.mkdtemp(dir=WORK.name))
            scenes.write(folder, body, size)
            scene_rows.append(compare(folder, all_peers))
            progress(f"{body}, {size}, after {time.time() - begin:.0f} s", all_peers, scene_rows[-1])
        for i, sizes in enumerate(zip(*scene_rows)):
            off, cosine, error, mean_cosine, mean_error = (
                worse(row[k] for row in sizes) for k, worse in enumerate((max, min, max, min, max))
            )
            cell = f"{off:.2f}; {cosine:.4f}, {100 * error:.1f} %"
            if all_peers[i].random:
                cell += f" (mean of {RANDOM_RUNS}: {mean_cosine:.4f}, {100 * mean_error:.1f} %)"
            truth[i].append(cell)
            times[i] += [" → ".join(map(number, row[-2:])) for row in sizes]
    names = [peer.name for peer in all_peers]
    table(scenes.BODIES, zip(names, truth))
    table([f"{body}, {size}" for body in scenes.BODIES for size in scenes.SIZES], zip(names, times))
    print(f"\n{(time.time() - begin) / 60:.0f} minutes.")


WORK = tempfile.TemporaryDirectory()
LOG = open(os.path.join(tempfile.gettempdir(), "render_peers.log"), "w")
main()
