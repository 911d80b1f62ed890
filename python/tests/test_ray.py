"""Refinement on a Ray cluster of two nodes, both of this machine, of which workers, a node and the caller are killed."""

import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
import prehend
import pytest
from prehend.datasets import Bop, Result, read_results, write_results

ray = pytest.importorskip("ray")
from ray.cluster_utils import Cluster  # noqa: E402

FRAMES = 12
BLOCK = 3


def png(path, image):
    """Writes a grayscale or color image of 8 or 16 bits."""
    height, width = image.shape[:2]
    bits = 8 * image.dtype.itemsize
    rows = image.astype(image.dtype.newbyteorder(">")).reshape(height, -1)
    data = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, bits, 2 if image.ndim == 3 else 0, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data, 1)) + chunk(b"IEND", b"")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + parts)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """A dataset of two scenes without a hand, and poses to start from."""
    root = tmp_path_factory.mktemp("dataset")
    _, frames = prehend.example_sequence(1, FRAMES)
    mesh = frames[0][0].object.mesh
    lines = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, vertex)) for vertex in 1e3 * mesh.vertices]
    lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces]
    (root / "models").mkdir()
    (root / "models" / "obj_000001.ply").write_text("\n".join(lines) + "\n")
    low, high = 1e3 * mesh.vertices.min(0), 1e3 * mesh.vertices.max(0)
    box = {f"min_{axis}": low[k] for k, axis in enumerate("xyz")} | {f"size_{axis}": (high - low)[k] for k, axis in enumerate("xyz")}
    info = box | {"diameter": np.linalg.norm(high - low)}
    (root / "models" / "models_info.json").write_text(json.dumps({"1": info}))
    random = np.random.default_rng(0)
    cameras, rows = {1: {}, 2: {}}, []
    for image, (frame, _, truth) in enumerate(frames):
        # By turns of two scenes: blocks are of one, and the file is in another order.
        scene = 1 + image % 2
        folder = root / "test" / f"{scene:06}"
        png(folder / "rgb" / f"{image:06}.png", frame.rgb)
        png(folder / "depth" / f"{image:06}.png", np.round(1e4 * frame.depth).astype(np.uint16))
        png(folder / "mask_visib" / f"{image:06}_000000.png", 255 * frame.mask.astype(np.uint8))
        cameras[scene][image] = {"cam_K": frame.K.ravel().tolist(), "depth_scale": 0.1}
        pose = truth.copy()
        pose[:3, 3] += random.normal(0.0, 3e-3, 3)
        rows.append(Result(scene, image, 1, pose))
    for scene, camera in cameras.items():
        (root / "test" / f"{scene:06}" / "scene_camera.json").write_text(json.dumps(camera))
    write_results(root / "init.csv", rows)
    return root


@pytest.fixture(scope="module")
def alone(dataset):
    """What this process alone makes of the frames."""
    rows, bop = read_results(dataset / "init.csv"), Bop(dataset)
    estimates = prehend.refine_batch([bop.frame(*row.ids) for row in rows], [row.pose for row in rows])
    return [(row.ids, estimate.probability, estimate.pose.tolist()) for row, estimate in zip(rows, estimates, strict=True)]


class Watch:
    """A folder in which workers leave a file for each frame that they begin, and find what is to become of it."""

    def __init__(self, folder):
        self.folder = folder

    def hook(self):
        """What each worker runs when it starts."""
        folder = self.folder

        def watch():
            load = Bop.frame

            def frame(dataset, scene, image, *others):
                pid = os.getpid()
                (folder / f"began {image} {pid} {time.time_ns()}").touch()
                if (folder / f"die {image}").exists():
                    os.kill(pid, signal.SIGKILL)
                try:
                    (folder / f"wait {image}").rename(folder / f"waiting {image} {pid}")
                except FileNotFoundError:
                    return load(dataset, scene, image, *others)
                time.sleep(60)

            Bop.frame = frame

        return watch

    def mark(self, what, image):
        """Of the frame of that number, "die": its worker is killed each time; "wait": it waits to be killed, once."""
        (self.folder / f"{what} {image}").touch()

    def waiting(self):
        """The process that waits, once there is one."""
        for _ in range(3000):
            for file in self.folder.glob("waiting *"):
                return int(file.name.split()[2])
            time.sleep(0.01)
        raise TimeoutError("no worker waits")

    def began(self):
        """How often frames were begun, by their numbers."""
        return Counter(int(file.name.split()[1]) for file in self.folder.glob("began *"))

    def workers(self):
        return {int(file.name.split()[2]) for file in self.folder.glob("began *")}


def connect(address, watch):
    """Connects to the cluster; its workers are watched."""
    ray.init(address=address, log_to_driver=False, runtime_env={"worker_process_setup_hook": watch.hook()})


@pytest.fixture(scope="module")
def cluster():
    memory = {"object_store_memory": 80 * 1024**2}
    # The head does no work, so that each worker is on a node that may be lost.
    cluster = Cluster(initialize_head=True, head_node_args=memory | {"num_cpus": 0, "include_dashboard": False})
    for _ in range(2):
        cluster.add_node(num_cpus=1, **memory)
    yield cluster
    cluster.shutdown()


@pytest.fixture
def watch(cluster, tmp_path):
    watch = Watch(tmp_path / "watch")
    watch.folder.mkdir()
    connect(cluster.address, watch)
    yield watch
    ray.shutdown()


def refine(dataset, out, **changed):
    import prehend.ray

    options = {"block_size": BLOCK, "progress": False} | changed
    return prehend.ray.refine_dataset(dataset, dataset / "init.csv", out, **options)


def assert_same(out, alone):
    """No row is missing, none is there twice, all are in their order, and numbers are the same."""
    found = read_results(out)
    assert [row.ids for row in found] == [ids for ids, _, _ in alone]
    for row, (_, probability, pose) in zip(found, alone, strict=True):
        assert row.score == probability and row.time == -1.0
        # Of millimeters, in which the file has them.
        assert np.abs(row.pose - pose).max() < 1e-15 and (row.pose[:3, :3] == np.array(pose)[:3, :3]).all()


def test_a_worker_is_killed(dataset, alone, watch, tmp_path):
    out = tmp_path / "refined.csv"
    watch.mark("wait", 5)
    killer = threading.Thread(target=lambda: os.kill(watch.waiting(), signal.SIGKILL))
    killer.start()
    done = refine(dataset, out)
    killer.join()
    assert (done.count, done.failures) == (FRAMES, {})
    assert_same(out, alone)
    began = watch.began()
    assert set(began) == set(range(FRAMES)) and began[5] == 2
    # Only what the killed worker had in hand was done again.
    assert sum(began.values()) <= FRAMES + BLOCK and max(began.values()) == 2
    assert len(watch.workers()) >= 2
    assert not out.with_name("refined.csv.journal").exists()


def test_what_fails_is_named_and_tried_again(dataset, alone, watch, tmp_path):
    out = tmp_path / "refined.csv"
    journal = tmp_path / "refined.csv.journal"
    watch.mark("die", 3)
    color = dataset / "test" / "000001" / "rgb" / "000006.png"
    aside = color.rename(color.with_suffix(".aside"))
    try:
        done = refine(dataset, out, tries=2, num_cpus=1)
    finally:
        aside.rename(color)
    assert done.count == FRAMES - 2 and list(done.failures) == [3, 6]
    assert done.failures[3].startswith("scene 2 image 3 object 1: given up after 2 lost workers")
    assert "000006.png" in done.failures[6] and done.failures[6] in str(done)
    assert_same(out, [row for row in alone if row[0][1] not in (3, 6)])
    # With its block, and then by itself.
    assert watch.began()[3] == 1 + 2 and watch.began()[6] == 1
    assert journal.exists()
    before = watch.began()
    (watch.folder / "die 3").unlink()
    done = refine(dataset, out)
    assert (done.count, done.failures) == (FRAMES, {})
    assert_same(out, alone)
    assert watch.began() - before == {3: 1, 6: 1}
    assert not journal.exists()


def test_a_caller_that_was_killed_goes_on(dataset, alone, cluster, watch, tmp_path):
    out = tmp_path / "refined.csv"
    journal = tmp_path / "refined.csv.journal"
    first = Watch(tmp_path / "first")
    first.folder.mkdir()
    first.mark("wait", 11)
    text = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parent)!r})
import test_ray
test_ray.connect({cluster.address!r}, test_ray.Watch(Path({str(first.folder)!r})))
test_ray.refine(Path({str(dataset)!r}), Path({str(out)!r}))
"""
    caller = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.DEVNULL)
    first.waiting()
    # The first line holds the settings; a block is in the file as soon as it is done.
    while journal.read_bytes().count(b"\n") < 1 + BLOCK:
        assert caller.poll() is None
        time.sleep(0.01)
    caller.kill()
    caller.wait()
    assert not out.exists()
    kept = {json.loads(line)["index"] for line in journal.read_text().splitlines()[1:]}
    # What a machine that fails leaves of a line.
    with open(journal, "a") as file:
        file.write('{"index": 11, "po')
    with pytest.raises(prehend.Error, match=r"another run.*\n.*method: fused \| robust-icp"):
        refine(dataset, out, method="robust-icp")
    done = refine(dataset, out)
    assert (done.count, done.failures) == (FRAMES, {})
    assert_same(out, alone)
    assert watch.began() == Counter(set(range(FRAMES)) - kept)
    assert not journal.exists()


def test_workers_of_several_cores_find_the_same(dataset, alone, cluster, watch, tmp_path):
    node = cluster.add_node(num_cpus=2, object_store_memory=80 * 1024**2)
    try:
        done = refine(dataset, tmp_path / "refined.csv", num_cpus=2, block_size=100)
    finally:
        cluster.remove_node(node)
    assert done.count == FRAMES
    assert_same(tmp_path / "refined.csv", alone)


def test_the_command_finds_the_same(dataset, alone, tmp_path):
    command = os.environ.get("PREHEND_COMMAND")
    if command is None:
        pytest.skip("PREHEND_COMMAND, the command prehend of the same build, is not set")
    out = tmp_path / "refined.csv"
    subprocess.run([command, "refine", "--dataset", dataset, "--poses", dataset / "init.csv", "--out", out], check=True)
    assert_same(out, alone)


def test_what_cannot_be_is_said_before_any_work(dataset, tmp_path):
    out = tmp_path / "refined.csv"
    for changed, text in [
        ({"method": "guess"}, "method: 'guess' is unknown"),
        ({"iterations": 0}, "iterations: at least 1"),
        ({"block_size": 0}, "block_size: at least 1"),
        ({"num_cpus": 0}, "num_cpus: at least 1"),
        ({"split": "train"}, "train"),
        ({"rig": tmp_path / "missing.json"}, "missing.json"),
    ]:
        with pytest.raises(prehend.Error, match=text):
            refine(dataset, out, **changed)
    assert not list(tmp_path.iterdir())


def test_a_node_is_lost(dataset, alone, cluster, watch, tmp_path):
    out = tmp_path / "refined.csv"
    watch.mark("wait", 4)

    def lose():
        pid = watch.waiting()
        raylet = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        own = {node.all_processes["raylet"][0].process.pid: node for node in cluster.worker_nodes}
        cluster.remove_node(own[raylet], allow_graceful=False)

    loser = threading.Thread(target=lose)
    loser.start()
    done = refine(dataset, out)
    loser.join()
    assert len(cluster.worker_nodes) == 1
    assert (done.count, done.failures) == (FRAMES, {})
    assert_same(out, alone)
    assert watch.began()[4] == 2
