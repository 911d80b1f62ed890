"""BOP's average recall by bop_toolkit beside that of `prehend eval --bop`, without OpenGL.

`PYTHONPATH=BOP_TOOLKIT python average_recall.py --dataset DIR --poses FILE [--prehend PROGRAM] [--pixel-center 0.5]`, where
BOP_TOOLKIT is a checkout of github.com/thodan/bop_toolkit, in an environment with what it imports, `trimesh` and `pillow`.

Errors, symmetries, matching and recalls are the toolkit's functions; only its renderer is replaced, by rays through the centers
of the pixels in double precision. Their coordinates are integers, as in ours; with `--pixel-center 0.5` they are half a pixel
farther right and down, as in the toolkit's OpenGL renderers.

Prints AR_VSD, AR_MSSD, AR_MSPD and AR of both, and exits with 1 if one differs by more than 1e-4.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import sys

import numpy as np
import trimesh
from bop_toolkit_lib import misc, pose_error, pose_matching, score
from PIL import Image

VSD_DELTA = 15.0
STEPS = np.arange(0.05, 0.51, 0.05)
THRESHOLDS = {"vsd": STEPS, "mssd": STEPS, "mspd": np.arange(5, 51, 5)}
LEAST_VISIBLE = 0.1
TOLERANCE = 1e-4


class RayCaster:
    """What `pose_error.vsd` wants of a renderer: depth of an object alone [mm]."""

    def __init__(self, meshes, width, height, pixel_center):
        self.meshes, self.size, self.center = meshes, (width, height), pixel_center

    def render_object(self, obj_id, R, t, fx, fy, cx, cy):
        mesh, (width, height) = self.meshes[obj_id], self.size
        corners = (mesh.vertices @ R.T + t.ravel())[mesh.faces]
        corners = corners[(corners[:, :, 2] > 0).all(1)]
        u = fx * corners[:, :, 0] / corners[:, :, 2] + cx - self.center
        v = fy * corners[:, :, 1] / corners[:, :, 2] + cy - self.center
        left, right = np.ceil(u.min(1)).clip(0).astype(int), np.floor(u.max(1)).clip(max=width - 1).astype(int)
        top, bottom = np.ceil(v.min(1)).clip(0).astype(int), np.floor(v.max(1)).clip(max=height - 1).astype(int)
        depth = np.full((height, width), np.inf)
        # A ray passes a face where it is on the same side of all planes through the camera and an edge.
        planes = np.cross(corners[:, [1, 2, 0]], corners[:, [2, 0, 1]])
        volume = np.einsum("ij,ij->i", corners[:, 0], planes[:, 0])
        for k in np.flatnonzero((left <= right) & (top <= bottom)):
            x, y = np.meshgrid(np.arange(left[k], right[k] + 1), np.arange(top[k], bottom[k] + 1))
            ray = np.stack([(x + self.center - cx) / fx, (y + self.center - cy) / fy, np.ones(x.shape)], -1)
            side = ray @ planes[k].T
            inside = (side >= 0).all(-1) | (side <= 0).all(-1)
            total = side.sum(-1)
            inside &= total != 0
            z = np.where(inside, volume[k] / np.where(inside, total, 1), np.inf)
            part = depth[top[k] : bottom[k] + 1, left[k] : right[k] + 1]
            np.minimum(part, z, out=part)
        return {"depth": np.where(np.isfinite(depth), depth, 0)}


def read(path):
    return {int(key): value for key, value in json.loads(path.read_text()).items()}


def matrix(numbers):
    return np.array(numbers, float).reshape(3, 3)


def vector(numbers):
    return np.array(numbers, float).reshape(3, 1)


def read_estimates(path):
    estimates = {}
    with open(path) as file:
        for row in csv.DictReader(file):
            key = tuple(int(row[name]) for name in ("scene_id", "im_id", "obj_id"))
            pose = matrix(row["R"].split()), vector(row["t"].split())
            estimates.setdefault(key, []).append((float(row["score"]), *pose))
    return estimates


def targets_of(dataset, truths, infos):
    """Instances to be found, by scene, image and object."""
    listed = dataset / "test_targets_bop19.json"
    if listed.is_file():
        return {(t["scene_id"], t["im_id"], t["obj_id"]): t["inst_count"] for t in json.loads(listed.read_text())}
    targets = {}
    for scene_id, images in truths.items():
        for im_id, objects in images.items():
            for true, info in zip(objects, infos[scene_id][im_id]):
                if info["visib_fract"] >= LEAST_VISIBLE:
                    key = scene_id, im_id, true["obj_id"]
                    targets[key] = targets.get(key, 0) + 1
    return targets


def pose_errors(estimate, true, obj_id, image, model, caster):
    """VSD for each tolerance, MSSD in diameters, MSPD in pixels of an image 640 px wide."""
    _, R, t = estimate
    R_true, t_true = matrix(true["cam_R_m2c"]), vector(true["cam_t_m2c"])
    points, diameter, symmetries = model
    K, depth = image
    vsd = pose_error.vsd(R, t, R_true, t_true, depth, K, VSD_DELTA, list(STEPS), True, diameter, caster, obj_id)
    mssd = pose_error.mssd(R, t, R_true, t_true, points, symmetries) / diameter
    mspd = pose_error.mspd(R, t, R_true, t_true, K, points, symmetries) * 640 / depth.shape[1]
    return [*((f"vsd {k}", e) for k, e in enumerate(vsd)), ("mssd", mssd), ("mspd", mspd)]


def most_visible(truths, infos, targets, scene_id, im_id):
    """Which true poses of an image are to be found."""
    left = {obj_id: count for (s, i, obj_id), count in targets.items() if (s, i) == (scene_id, im_id)}
    valid = [False] * len(truths)
    for k in sorted(range(len(truths)), key=lambda k: -infos[k]["visib_fract"]):
        obj_id = truths[k]["obj_id"]
        if left.get(obj_id, 0) > 0:
            valid[k] = True
            left[obj_id] -= 1
    return valid


def toolkit(dataset, poses, pixel_center):
    folder = next(dataset / name for name in ("models_eval", "models") if (dataset / name).is_dir())
    information = read(folder / "models_info.json")
    meshes = {i: trimesh.load(folder / f"obj_{i:06d}.ply", process=False) for i in information}
    models = {}
    for i, info in information.items():
        symmetries = misc.get_symmetry_transformations(info, 0.01)
        models[i] = np.asarray(meshes[i].vertices), info["diameter"], symmetries
    scenes = {int(p.name): p for p in sorted((dataset / "test").iterdir()) if p.is_dir()}
    truths = {s: read(p / "scene_gt.json") for s, p in scenes.items()}
    infos = {s: read(p / "scene_gt_info.json") for s, p in scenes.items()}
    targets, estimates = targets_of(dataset, truths, infos), read_estimates(poses)
    errors = {}
    for (scene_id, im_id, obj_id), count in targets.items():
        camera = read(scenes[scene_id] / "scene_camera.json")[im_id]
        depth = np.array(Image.open(scenes[scene_id] / "depth" / f"{im_id:06d}.png"), float) * camera["depth_scale"]
        image = matrix(camera["cam_K"]), depth
        caster = RayCaster(meshes, depth.shape[1], depth.shape[0], pixel_center)
        best = sorted(estimates.get((scene_id, im_id, obj_id), []), key=lambda e: e[0], reverse=True)[:count]
        for est_id, estimate in enumerate(best):
            of = {"im_id": im_id, "obj_id": obj_id, "est_id": est_id, "score": estimate[0], "gt_visib_fracts": {}}
            for gt_id, true in enumerate(truths[scene_id][im_id]):
                if true["obj_id"] != obj_id:
                    continue
                of["gt_visib_fracts"][gt_id] = infos[scene_id][im_id][gt_id]["visib_fract"]
                for name, error in pose_errors(estimate, true, obj_id, image, models[obj_id], caster):
                    here = errors.setdefault(name, {}).setdefault(scene_id, {})
                    here.setdefault((im_id, obj_id, est_id), {**of, "errors": {}})["errors"][gt_id] = [error]
    images = {s: sorted({i for of, i, _ in targets if of == s}) for s in scenes}
    valid = {s: {i: most_visible(truths[s][i], infos[s][i], targets, s, i) for i in images[s]} for s in scenes}
    recalls = {"vsd": [], "mssd": [], "mspd": []}
    for name, of_scene in errors.items():
        metric = name.split()[0]
        for threshold in THRESHOLDS[metric]:
            matches = []
            for s in scenes:
                shown = {i: truths[s][i] for i in images[s]}
                found = list(of_scene.get(s, {}).values())
                matches += pose_matching.match_poses_scene(s, shown, infos[s], valid[s], found, [threshold], -1)
            scores = score.calc_localization_scores(list(scenes), list(information), matches, -1, do_print=False)
            recalls[metric].append(scores["recall"])
    averages = {f"ar_{metric}": float(np.mean(of_metric)) for metric, of_metric in recalls.items()}
    return {**averages, "ar": float(np.mean(list(averages.values())))}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dataset", type=pathlib.Path, required=True)
    parser.add_argument("--poses", type=pathlib.Path, required=True)
    parser.add_argument("--prehend", default="prehend")
    parser.add_argument("--pixel-center", type=float, default=0)
    options = parser.parse_args()
    theirs = toolkit(options.dataset, options.poses, options.pixel_center)
    command = [options.prehend, "eval", "--bop", "--json", "--dataset", options.dataset, "--poses", options.poses]
    ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["bop"]["overall"]
    print(f"{'':8} {'bop_toolkit':>11} {'prehend':>11} {'difference':>11}")
    for name, value in theirs.items():
        print(f"{name.upper():8} {value:11.6f} {ours[name]:11.6f} {ours[name] - value:11.1e}")
    sys.exit(int(any(abs(ours[name] - value) > TOLERANCE for name, value in theirs.items())))


if __name__ == "__main__":
    main()
