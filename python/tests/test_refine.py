"""Refinement: of made-up frames, and of those of the data folder that PREHEND_DATA names, where there is one."""

import json
import multiprocessing
import os
import pickle
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import prehend
from prehend.datasets import Bop, Result, read_results, read_hypotheses, write_results

DATA = Path(os.environ.get("PREHEND_DATA", "")) / "mujoco"
needs_data = pytest.mark.skipif(
    not os.environ.get("PREHEND_DATA") or not DATA.is_dir(), reason="PREHEND_DATA names no data"
)
SCENE, IMAGE, OBJECT = 4, 0, 4


@pytest.fixture(scope="module")
def example():
    return prehend.example_frame(1)


@pytest.fixture(scope="module")
def refined(example):
    frame, initial, _ = example
    return frame.refine(initial)


def inputs(frame, **changed):
    """The arguments of a frame, some of them changed."""
    names = ["rgb", "depth", "K", "object", "mask", "hand", "hand_pose", "joints", "touch", "gravity"]
    return {name: getattr(frame, name) for name in names} | changed


def error(pose, truth, center):
    """Displacement of a point of the object, and rotation vector, from a pose to the true one."""
    place = np.append(center, 1.0)
    turn = truth[:3, :3] @ pose[:3, :3].T
    angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return np.concatenate([((truth - pose) @ place)[:3], axis * (0.5 * angle / np.sin(angle))])


def test_a_made_up_frame_is_searched(example):
    frame, _, truth = example
    poses, weights = frame.search()
    assert (np.diff(weights) <= 0.0).all() and weights.sum() == pytest.approx(1.0)
    estimate = frame.refine(poses)
    assert np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]) < 1e-3
    searched, _ = prehend.search(frame.rgb, frame.depth, frame.K, frame.object, mask=frame.mask)
    assert searched.shape[1:] == (4, 4)


def test_color_or_depth_alone(example):
    frame, initial, truth = example
    for lacking in ["rgb", "depth"]:
        alone = prehend.Frame(**inputs(frame, **{lacking: None}))
        estimate = alone.refine(initial)
        assert np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]) < 5e-3
    with pytest.raises(prehend.Error, match="one of them is needed"):
        prehend.Frame(**inputs(frame, rgb=None, depth=None))


def test_help_names_every_field():
    for kind in [prehend.Estimate, prehend.Tracked]:
        assert all(f"        {name}: " in kind.__doc__ for name in kind.__dataclass_fields__)


def test_a_made_up_frame_is_refined(example, refined):
    frame, initial, truth = example
    before = np.linalg.norm(initial[:3, 3] - truth[:3, 3])
    after = np.linalg.norm(refined.pose[:3, 3] - truth[:3, 3])
    assert before > 5e-3 and after < 1e-3
    assert refined.pose.shape == (4, 4) and refined.pose.dtype == np.float64
    assert 0.9 < refined.probability <= 1.0
    assert refined.termination and refined.iterations > 0
    best, share = refined.modes[0]
    assert (best == refined.pose).all() and 0.5 < share <= 1.0
    assert sum(share for _, share in refined.modes) == pytest.approx(1.0)


def test_a_pose_is_drawn_over_the_image(example):
    frame, _, truth = example
    picture = frame.draw(truth)
    assert picture.shape == frame.rgb.shape and picture.dtype == np.uint8
    moved = truth.copy()
    moved[0, 3] += 0.02
    # Outlines differ, and nothing else.
    differs = (picture != frame.draw(moved)).any(axis=2)
    assert 50 < differs.sum() < 0.1 * differs.size
    rows, columns = np.nonzero(differs)
    inside = np.nonzero(frame.mask)
    assert abs(rows.mean() - inside[0].mean()) < 60 and abs(columns.mean() - inside[1].mean()) < 60


def test_the_covariance_is_in_the_order_and_frame_that_are_documented(example, refined):
    frame, _, truth = example
    covariance = refined.covariance
    assert covariance.shape == (6, 6) and np.allclose(covariance, covariance.T)
    assert (np.linalg.eigvalsh(covariance) > 0).all()
    off = error(refined.pose, truth, frame.object.center)
    assert off @ np.linalg.solve(covariance, off) < 5.0**2
    # Millimeters and degrees: in another order they would not be.
    assert (np.sqrt(np.diag(covariance)[:3]) < 5e-3).all()


def test_arrays_and_a_frame_are_the_same(example, refined):
    frame, initial, _ = example
    # Made-up colors are rounded to 8 bits.
    given = inputs(frame)
    mesh = given.pop("object")
    estimate = prehend.refine(**given, mesh=mesh, pose=initial)
    assert np.abs(estimate.pose - refined.pose).max() < 1e-4
    ordered = prehend.Frame(**inputs(frame, joints=list(frame.joints.values())))
    assert ordered.joints == frame.joints
    strided = prehend.Frame(
        **inputs(
            frame,
            rgb=np.asfortranarray(frame.rgb),
            depth=np.repeat(frame.depth, 2, axis=1)[:, ::2].astype(np.float64),
            mask=255 * frame.mask.astype(np.uint8),
        )
    )
    for name in ["rgb", "depth", "mask"]:
        assert (getattr(strided, name) == getattr(frame, name)).all(), name


def test_whole_numbers_of_depth_have_a_scale(example):
    frame, _, _ = example
    units = np.round(frame.depth / 1e-4).astype(np.uint16)
    read = prehend.Frame(**inputs(frame, depth=units, depth_scale=1e-4)).depth
    assert (read == (units.astype(np.float64) * 1e-4).astype(np.float32)).all()
    holes = frame.depth.copy()
    holes[:10], holes[10:20] = np.nan, -1.0
    assert not prehend.Frame(**inputs(frame, depth=holes)).depth[:20].any()


def test_less_may_be_known(example):
    frame, initial, truth = example
    only = prehend.Frame(frame.rgb, frame.depth, frame.K, frame.object.mesh, mask=frame.mask)
    assert (only.hand, only.joints, only.touch, only.gravity, only.ids) == (None,) * 5
    estimate = only.refine(initial, method="robust-icp")
    assert estimate.covariance is None and estimate.probability is None and estimate.modes == []
    assert np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]) < 5e-3
    assert "robust-icp" in prehend.methods()
    # Gradients without evidence drop out of the paper's method.
    few = only.refine(initial, method="combined", iterations=3)
    assert few.iterations == 3


@pytest.mark.parametrize(
    "changed, text",
    [
        ({"rgb": np.zeros((4, 4), np.uint8)}, "rgb: an array of H × W × 3 of uint8"),
        ({"rgb": np.zeros((480, 640, 3))}, "rgb: .* of float64"),
        ({"depth": np.zeros((4, 4, 1))}, "depth: an array of H × W is expected"),
        ({"depth": np.zeros((4, 4))}, r"depth: \[4, 4\], but rgb is \[480, 640\]"),
        ({"depth": np.zeros((480, 640), np.uint16)}, "whole numbers need depth_scale"),
        ({"depth": np.zeros((480, 640), np.uint16), "depth_scale": -1}, "depth_scale: -1"),
        ({"depth": np.zeros((480, 640), complex)}, "depth: numbers are expected, not complex128"),
        ({"mask": np.zeros((480, 640))}, "mask: booleans or whole numbers"),
        ({"mask": np.zeros((4, 4), bool)}, r"mask: \[4, 4\], but rgb is \[480, 640\]"),
        ({"K": np.eye(4)}, "K: a matrix of 3 × 3"),
        ({"K": np.zeros((3, 3))}, "K: "),
        ({"hand": None}, "hand, hand_pose and joints: each needs the others"),
        ({"hand_pose": 2 * np.eye(4)}, "hand_pose: the matrix's last row"),
        ({"hand_pose": np.diag([2.0, 1, 1, 1])}, "hand_pose: not orthonormal"),
        ({"joints": [0.0]}, "joint"),
        ({"joints": {"elbow": 0.0}}, "elbow"),
        ({"touch": np.zeros((2, 3))}, "2 taxel forces were given for"),
        ({"hand": None, "hand_pose": None, "joints": None}, "touch: it needs hand, hand_pose and joints"),
        ({"touch": np.zeros(3)}, "touch: an array of n × 3"),
        ({"gravity": [0, 0, 9810.0]}, "gravity: .* is no gravity"),
        ({"lens": ("pinhole", [])}, "pinhole"),
    ],
)
def test_what_cannot_be_is_named(example, changed, text):
    with pytest.raises(prehend.Error, match=text):
        prehend.Frame(**inputs(example[0], **changed))


def test_a_frame_that_cannot_be_refined_says_why(example):
    frame, initial, _ = example
    with pytest.raises(prehend.Error, match="method: 'guess' is unknown: one of fused, combined"):
        frame.refine(initial, method="guess")
    with pytest.raises(prehend.Error, match="pose: a matrix of 4 × 4"):
        frame.refine(initial[:3])
    with pytest.raises(prehend.Error, match="pose: value 0 is not finite"):
        frame.refine(np.where(initial == initial[0, 0], np.nan, initial))
    with pytest.raises(prehend.Error, match="iterations: at least 1"):
        frame.refine(initial, iterations=0)
    behind = initial.copy()
    behind[2, 3] = -1.0
    with pytest.raises(prehend.Error, match="behind the camera"):
        frame.refine(behind)
    # Without a mask, pose, depth and colors tell the object.
    unmasked = prehend.Frame(**inputs(frame, mask=None)).refine(initial)
    assert np.linalg.norm(unmasked.pose[:3, 3] - frame.refine(initial).pose[:3, 3]) < 2e-3
    assert any("behind the camera" in text for text in frame.warnings(behind))


def test_objects_and_meshes(tmp_path):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
    faces += [[1, 5, 7], [1, 7, 3]]
    box = prehend.Mesh(0.1 * corners, faces, colors=corners)
    assert (box.faces == faces).all() and (box.vertices == 0.1 * corners).all()
    assert repr(box) == "Mesh(8 vertices, 12 faces, colors)"
    assert prehend.Object(box, density=1000).mass == pytest.approx(1.0)
    assert prehend.Object(box, mass=0.3).mass == pytest.approx(0.3)
    assert "assumed" in repr(prehend.Object(box, name="box"))
    whole = prehend.Object(box, mass=0.3, com=[0.05] * 3, inertia=[1e-3] * 3)
    assert np.allclose(whole.center, 0.05) and repr(whole) == "Object('object', 0.300 kg)"
    off = tmp_path / "box.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in 100 * corners]
    off.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]))
    assert np.allclose(prehend.Mesh.load(off, scale=1e-3).vertices.max(0), 0.1)
    with pytest.raises(TypeError, match=r"an Object or a Mesh is expected, not str; Mesh.load\(path\)"):
        prehend.Tracker("box.obj")
    with pytest.raises(prehend.Error, match="not closed"):
        prehend.Object(prehend.Mesh(corners, faces[:5]))
    with pytest.raises(prehend.Error, match="give one of mass, density"):
        prehend.Object(box, mass=1.0, density=1.0)
    with pytest.raises(prehend.Error, match="there is no vertex 9"):
        prehend.Mesh(corners, [[0, 1, 9]])
    with pytest.raises(prehend.Error, match="colors: they are not all between"):
        prehend.Mesh(corners, faces, colors=255 * corners)
    with pytest.raises(prehend.Error, match="missing.ply"):
        prehend.Mesh.load(tmp_path / "missing.ply")
    with pytest.raises(prehend.Error, match="missing.urdf"):
        prehend.Hand(tmp_path / "missing.urdf")


def test_other_threads_run_while_a_frame_is_refined(example, refined):
    frame, initial, _ = example
    found = []
    worker = threading.Thread(target=lambda: found.append(frame.refine(initial)))
    ticks = 0
    worker.start()
    while worker.is_alive():
        time.sleep(1e-3)
        ticks += 1
    worker.join()
    # With Python's lock held it would be one or two.
    assert ticks > 10
    both = [threading.Thread(target=lambda: found.append(frame.refine(initial))) for _ in range(2)]
    [thread.start() for thread in both]
    [thread.join() for thread in both]
    assert len(found) == 3
    assert all((estimate.pose == refined.pose).all() for estimate in found)


def test_sizes_of_errors_have_names(example):
    frame, initial, _ = example
    estimate = frame.refine(initial, noise={"model.scale": "5%"})
    scale, sigma = estimate.model_scale
    assert abs(scale - 1) < 0.03 and 0 < sigma < 0.05
    assert frame.refine(initial).model_scale is None
    with pytest.raises(prehend.Error, match="noise: warmth: there is no size"):
        frame.refine(initial, noise={"warmth": "5%"})
    with pytest.raises(prehend.Error, match="noise: is of the fused methods, not of 'icp'"):
        frame.refine(initial, method="icp", noise={"joints": "1deg"})


def test_settings_are_a_dict_or_a_file(example, refined, tmp_path):
    frame, initial, _ = example
    file = tmp_path / "settings.toml"
    file.write_text("[estimator.prior]\njoints = 0.02\n")
    dotted, nested = {"estimator.prior.joints": 0.02}, {"estimator": {"prior": {"joints": 0.02}}}
    given = [frame.refine(initial, settings=settings) for settings in (file, dotted, nested)]
    assert all((estimate.pose == given[0].pose).all() for estimate in given)
    assert not (given[0].pose == refined.pose).all()
    few = {"search": {"rotations": 300, "placed": 40, "turned": 8, "seen": 4, "last": 1}}
    assert len(frame.search(settings=few)[0]) == 1
    with pytest.raises(prehend.Error, match="settings: estimator.prior.joint: unknown field"):
        frame.refine(initial, settings={"estimator": {"prior": {"joint": 0.02}}})
    with pytest.raises(prehend.Error, match="settings: are of the fused methods, not of 'icp'"):
        frame.refine(initial, method="icp", settings={})
    with pytest.raises(prehend.Error, match="none.toml"):
        prehend.Tracker(frame.object, settings=tmp_path / "none.toml")


def test_a_bad_frame_loses_no_other(example, refined, tmp_path):
    frame, initial, _ = example
    behind = initial.copy()
    behind[2, 3] = -1.0
    for threads in (None, 1, 2):
        first, second, third = prehend.refine_batch([frame] * 3, [initial, behind, initial], threads=threads)
        assert isinstance(second, prehend.Error) and "behind the camera" in str(second)
        for estimate in (first, third):
            assert (estimate.pose == refined.pose).all()
            assert (estimate.covariance == refined.covariance).all()
            assert estimate.probability == refined.probability
            assert estimate.warnings == refined.warnings
    prehend.refine_batch([frame] * 3, [initial, behind, initial], report=tmp_path / "report")
    page = (tmp_path / "report/index.html").read_text()
    assert "frame 0" in page and "frame 2" in page and "frame 1" not in page
    assert prehend.refine_batch([], []) == []
    with pytest.raises(prehend.Error, match="poses: 2 are expected, one a frame, not 1"):
        prehend.refine_batch([frame, frame], [initial])
    with pytest.raises(prehend.Error, match=r"poses\[1\]: not orthonormal"):
        prehend.refine_batch([frame, frame], [initial, np.diag([2.0, 1, 1, 1])])


def test_a_frame_is_read_from_its_file(example, tmp_path):
    images = pytest.importorskip("PIL.Image")
    frame, initial, truth = example
    images.fromarray(frame.rgb).save(tmp_path / "rgb.png")
    images.fromarray(np.round(1e4 * frame.depth).astype(np.uint16)).save(tmp_path / "depth.png")
    mesh = frame.object.mesh
    rows = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    rows += [f"f {a} {b} {c}" for a, b, c in 1 + mesh.faces]
    (tmp_path / "mesh.obj").write_text("\n".join(rows))
    table = np.eye(4)
    table[2, 3] = 2.0
    content = {"K": frame.K.ravel().tolist(), "rgb": "rgb.png", "depth": "depth.png", "depth_unit_m": 1e-4}
    content |= {"mesh": "mesh.obj", "mesh_unit": "m", "pose": {"unit": "m", "matrix": initial.tolist()}}
    plane = {"name": "table", "kind": "plane", "pose": {"unit": "m", "matrix": table.tolist()}}
    (tmp_path / "frame.json").write_text(json.dumps(content | {"bodies": [plane]}))
    read, pose = prehend.Frame.load(tmp_path / "frame.json")
    assert np.allclose(pose, initial) and np.allclose(read.depth, frame.depth, atol=1e-4)
    estimate = read.refine(pose)
    center = np.array(frame.object.center)
    moved = [np.linalg.norm((p - truth)[:3, :3] @ center + (p - truth)[:3, 3]) for p in (pose, estimate.pose)]
    assert moved[1] < min(4e-3, moved[0]), moved
    (tmp_path / "frame.json").write_text(json.dumps(content | {"mesh": "none.obj"}))
    with pytest.raises(prehend.Error, match="none.obj"):
        prehend.Frame.load(tmp_path / "frame.json")


def test_estimates_can_be_sent_to_other_processes(refined):
    again = pickle.loads(pickle.dumps(refined))
    assert (again.pose == refined.pose).all() and again.probability == refined.probability


def test_an_object_is_followed():
    initial, frames = prehend.example_sequence(1, 4)
    first = frames[0][0]
    tracker = prehend.Tracker(first.object, pose=initial)
    followed = [tracker.push(frame, at) for frame, at, _ in frames]
    assert [tracked.status for tracked in followed] == ["relocalized"] + ["tracked"] * 3
    for tracked, (_, _, truth) in zip(followed, frames, strict=True):
        assert np.linalg.norm(tracked.pose[:3, 3] - truth[:3, 3]) < 3e-3
        assert tracked.covariance.shape == (6, 6) and tracked.probability > 0.5
        assert tracked.seconds > 0
    bare = prehend.Frame(**inputs(frames[-1][0], mask=None))
    assert tracker.push(bare, 0.1).status == "tracked"
    hidden = inputs(frames[-1][0], mask=None, depth=np.full((480, 640), 0.3), rgb=np.full((480, 640, 3), 128, np.uint8))
    tracker = prehend.Tracker(first.object, pose=initial, recovery="off")
    tracker.push(first, 0.0)
    lost = tracker.push(prehend.Frame(**hidden), 0.2)
    assert (lost.status, lost.covariance, lost.rejection) == ("lost", None, "nothing of the object is seen")
    tracker.start_from(frames[0][2])
    assert tracker.push(first, 0.0).status == "relocalized"
    with pytest.raises(prehend.Error, match="recovery"):
        prehend.Tracker(first.object, recovery="far")
    with pytest.raises(prehend.Error, match="budget"):
        prehend.Tracker(first.object, budget=-1.0)
    with pytest.raises(prehend.Error, match="time"):
        tracker.push(first, float("nan"))
    assert prehend.Tracker(first.object, pose=initial).push(bare, 0.0).status == "relocalized"


def test_results_files(tmp_path):
    file = tmp_path / "poses.csv"
    pose = np.eye(4)
    pose[:3, 3] = [0.1, -1 / 3, 0.7]
    write_results(file, [Result(1, 2, 3, pose, 0.5), Result(1, 2, 4, pose, 0.25, 0.1)])
    first, second = read_results(file)
    assert first.ids == (1, 2, 3, 0) and second.ids == (1, 2, 4, 1)
    assert (first.score, first.time, second.time) == (0.5, -1.0, 0.1)
    assert np.abs(first.pose - pose).max() < 1e-15
    file.write_text("1,2,3,0.5,1 0 0 0 1 0 0 0,0 0 500,-1\n")
    with pytest.raises(prehend.Error, match="poses.csv: line 1"):
        read_results(file)
    with pytest.raises(prehend.Error, match="no finite matrix"):
        write_results(file, [Result(1, 2, 3, np.full((4, 4), np.nan))])
    with pytest.raises(prehend.Error, match="no-dataset"):
        Bop(tmp_path / "no-dataset")


def test_files_of_hypotheses(tmp_path):
    file = tmp_path / "poses.csv.hypotheses.csv"
    poses = [np.eye(4) for _ in range(4)]
    for k, pose in enumerate(poses):
        pose[2, 3] = 0.5 + 0.1 * k
    rows = [Result(1, 0, 7, poses[0]), Result(1, 1, 7, poses[0]), Result(1, 2, 7, poses[1])]
    searched = [rows[2], rows[2]._replace(pose=poses[2]), rows[2]._replace(pose=poses[3]), rows[0]]
    write_results(file, searched)
    first, second, third = read_hypotheses(file, rows)
    assert first.shape == (1, 4, 4) and second.shape == (4, 4)
    assert (third == poses[1:]).all()
    write_results(file, [rows[0], rows[1]._replace(pose=poses[1])])
    with pytest.raises(prehend.Error, match="scene 1 image 1 object 7: neither"):
        read_hypotheses(file, rows)


@pytest.fixture(scope="module")
def dataset():
    return Bop(DATA)


@pytest.fixture(scope="module")
def command():
    """Runs the command `prehend` on the frames of one scene, and returns what it prints."""
    own = os.environ.get("PREHEND_COMMAND")
    if own is None:
        pytest.skip("PREHEND_COMMAND, the command prehend of the same build, is not set")

    def run(name, *options):
        given = ["--dataset", DATA, "--poses", DATA / "init_low.csv", "--scene", SCENE, *options]
        command = [own, name, *map(str, given)]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    return run


def refined_by(command, folder, *options):
    """What the command makes of one frame: rotation, translation [mm], and probability."""
    out = folder / "refined.csv"
    command("refine", "--image", IMAGE, "--object", OBJECT, "--out", out, *options)
    cells = out.read_text().splitlines()[1].split(",")
    rotation, place = ([float(x) for x in cells[k].split()] for k in (4, 5))
    return np.reshape(rotation, (3, 3)), np.array(place), float(cells[3])


@pytest.fixture(scope="module")
def command_line(command, tmp_path_factory):
    return refined_by(command, tmp_path_factory.mktemp("command"))


@needs_data
def test_a_frame_of_a_dataset_is_refined_as_by_the_command(dataset, command_line):
    initial = read_results(DATA / "init_low.csv")[0]
    assert initial.ids == (SCENE, IMAGE, OBJECT, 0)
    frame = dataset.frame(*initial.ids)
    assert frame.ids == (SCENE, IMAGE, OBJECT)
    estimate = frame.refine(initial.pose)
    rotation, place, score = command_line
    assert (estimate.pose[:3, :3] == rotation).all()
    assert (estimate.pose[:3, 3] * 1000.0 == place).all()
    assert estimate.probability == score
    truth = dataset.true_pose(frame)
    assert np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]) < 1e-3


@needs_data
def test_arrays_of_a_dataset_are_refined_as_by_the_command(dataset, command_line):
    initial = read_results(DATA / "init_low.csv")[0]
    frame = dataset.frame(*initial.ids)
    # From the file: a matrix of the frame's would be rounded once more.
    scene = next((DATA / "test").glob(f"*{SCENE:04}"))
    body = json.loads((scene / "scene_bodies.json").read_text())[str(IMAGE)]["bodies"][0]
    hand_pose = np.eye(4)
    hand_pose[:3, :3] = np.reshape(body["cam_R_b2c"], (3, 3))
    hand_pose[:3, 3] = np.array(body["cam_t_b2c"]) / 1000.0
    hand = prehend.Hand(DATA / body["urdf"], DATA / "hand" / "taxels.csv")
    given = inputs(frame, hand=hand, hand_pose=hand_pose, joints=body["joints"])
    mesh = given.pop("object")
    estimate = prehend.refine(**given, mesh=mesh, pose=initial.pose)
    rotation, place, _ = command_line
    assert (estimate.pose[:3, :3] == rotation).all()
    assert (estimate.pose[:3, 3] * 1000.0 == place).all()


@needs_data
def test_a_dataset_is_iterated(dataset):
    targets = dataset.targets()
    assert len(dataset) == len(targets) == 36
    assert targets[0][:3] == (SCENE, IMAGE, OBJECT)
    frame = next(iter(dataset))
    assert frame.ids == targets[0][:3]
    assert frame.rgb.shape == (*frame.depth.shape, 3) and frame.mask.any()
    assert frame.touch.shape == (len(frame.hand.taxels), 3)
    assert frame.object.mass == dataset.object(OBJECT).mass
    assert OBJECT in dataset.objects and SCENE in dataset.scenes
    with pytest.raises(prehend.Error, match="no scene 999"):
        dataset.frame(999, 0, OBJECT)


@needs_data
def test_an_object_is_followed_as_by_the_command(dataset, command, tmp_path):
    out = tmp_path / "tracked.csv"
    command("track", "--out", out)
    told = [line.split(",") for line in out.read_text().splitlines()[1:]]
    start = next(row for row in read_results(DATA / "init_low.csv") if row.scene == SCENE)
    tracker = prehend.Tracker(dataset.object(OBJECT), pose=start.pose)
    assert len(told) == len(dataset.images(SCENE)) > 1
    for image, cells in zip(dataset.images(SCENE), told, strict=True):
        tracked = tracker.push(dataset.frame(SCENE, image, OBJECT), image / 30.0)
        assert tracked.pose[:3, :3].ravel().tolist() == [float(x) for x in cells[4].split()]
        assert (tracked.pose[:3, 3] * 1000.0).tolist() == [float(x) for x in cells[5].split()]
        assert (tracked.probability or 0.0) == float(cells[3])


@needs_data
def test_poses_are_scored_as_by_the_command(dataset, command):
    rows = [row for row in read_results(DATA / "init_low.csv") if row.scene == SCENE]
    scores = prehend.evaluate(dataset, [*rows, rows[0]._replace(object=999)])
    told = json.loads(command("eval", "--json"))
    assert len(told["poses"]) == len(rows) and not told["failures"]
    assert scores.columns == told["summary"]["columns"]
    fields = ["pe_cm", "oe_deg", "oe_symmetric_deg", "add_mm", "adi_mm", "mssd_mm", "mspd_px", "ca_cm2", "iv_cm3"]
    for k, pose in enumerate(told["poses"]):
        assert scores.values[k, : len(fields)].tolist() == [pose["score"][name] for name in fields]
    for name, of in zip(scores.columns, told["summary"]["overall"], strict=True):
        assert (scores.mean[name], scores.median[name]) == (of["mean"], of["median"])
    assert list(scores.failures) == [len(rows)] and "999" in scores.failures[len(rows)]
    assert np.isnan(scores.values[-1]).all()
    assert "PE cm" in str(scores) and (scores["PE cm"][:-1] > 0).all()


@needs_data
def test_a_rig_is_learnt_and_used_as_by_the_command(dataset, command, tmp_path):
    rows = [row for row in read_results(DATA / "init_low.csv") if row.scene == SCENE]
    ours, theirs = tmp_path / "ours.json", tmp_path / "theirs.json"
    rig = prehend.calibrate(dataset, rows, passes=1)
    rig.save(ours)
    command("calibrate", "--passes", 1, "--out", theirs)
    assert ours.read_bytes() == theirs.read_bytes()
    rig = prehend.Rig.load(theirs)
    names = rig.parameters
    assert "depth scale" in names and rig.covariance.shape[0] > len(names)
    assert rig.objects == [OBJECT]
    rotation, place, score = refined_by(command, tmp_path, "--rig", theirs)
    frame = Bop(DATA, rig=rig).frame(SCENE, IMAGE, OBJECT)
    estimate = frame.refine(rows[0].pose)
    assert (estimate.pose[:3, :3] == rotation).all() and (estimate.pose[:3, 3] * 1000.0 == place).all()
    assert estimate.probability == score
    # The same of arrays, but for the rounding of the hand's pose.
    plain = dataset.frame(SCENE, IMAGE, OBJECT)
    corrected = rig.corrected(plain.object, OBJECT)
    again = prehend.Frame(**inputs(plain, object=corrected), rig=rig).refine(rows[0].pose)
    assert np.abs(again.pose - estimate.pose).max() < 1e-5
    assert repr(rig.corrected(plain.object, 999)) == repr(plain.object)
    with pytest.raises(prehend.Error, match="missing.json"):
        prehend.Rig.load(tmp_path / "missing.json")


def refined_in_a_fork(frame, initial, queue):
    queue.put(frame.refine(initial).pose)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning", "ignore:.*fork:RuntimeWarning")
def test_a_forked_process_refines(example, refined):
    frame, initial, _ = example
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    process = fork.Process(target=refined_in_a_fork, args=(frame, initial, queue))
    process.start()
    np.testing.assert_array_equal(queue.get(timeout=120), refined.pose)
    process.join()


def test_negative_masks_are_refused(example):
    frame = example[0]
    mask = np.where(frame.mask, 1, -1)
    with pytest.raises(ValueError, match="negative"):
        prehend.Frame(**inputs(frame, mask=mask))
