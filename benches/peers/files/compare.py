"""Robots and scenes as other programs read them: MJCF beside MuJoCo, URDF beside Pinocchio.

    pip install mujoco pin
    cargo build --release -p prehend-sim --example robot_dynamics
    python compare.py FOLDER... [--list] [--states 20] [--tolerance 1e-6]
    python compare.py FOLDER... --times CACHE

For each file: whether both load it; degrees of freedom, masses, inertias, joint ranges and actuators; poses of all bodies in random
positions; mass matrix, forward and inverse dynamics with contacts, limits, equalities and dry friction off and without a medium, relative
to the scale of the mass matrix. Pinocchio reads no collision shapes with a model, so that a URDF whose shapes are not there is read without.
Of MJCF only rigid models count: those without flex and plugin in MuJoCo's own model. `--list` prints
what becomes of each file. `--times` instead reads all that loads with its shapes, twice, and prints the most processor time: distance grids are made
the first time and kept in CACHE.
"""

import argparse
import collections
import json
import pathlib
import resource
import subprocess
import sys

import numpy as np

REPOSITORY = pathlib.Path(__file__).resolve().parents[3]


class Differs(Exception):
    """Two programs have not the same."""


def near(what, found, expected, tolerance, scale=None):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    if found.shape != expected.shape:
        raise Differs(f"{what}: {found.shape} numbers, not {expected.shape}")
    if found.size == 0:
        return
    scale = max(np.abs(expected).max(), 1e-12) if scale is None else scale
    off = np.abs(found - expected).max() / scale
    if not off <= tolerance:
        raise Differs(f"{what}: off by {off:.1e}")


class Prehend:
    """The example, which answers a line for each state."""

    def __init__(self, command, file, root):
        self.process = subprocess.Popen(
            [command, str(file), "--root", str(root)] + ["--partial"] * (file.suffix == ".urdf"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def line(self):
        line = self.process.stdout.readline()
        if not line:
            self.process.wait()
            raise Differs("does not load: " + self.process.stderr.read().strip().replace("\n", " "))
        return json.loads(line)

    def at(self, state):
        print(json.dumps({k: list(map(float, v)) if not isinstance(v, dict) else v for k, v in state.items()}),
              file=self.process.stdin, flush=True)
        return self.line()

    def close(self):
        self.process.kill()
        self.process.wait()


def matrices(found):
    return np.array([np.array(p).reshape(4, 4).T for p in found])


def compare_dynamics(found, mass, acceleration, effort, change, tolerance):
    n = mass.shape[0]
    scale = max(np.abs(mass).max(), 1e-3) if n else 1.0
    if np.size(found["mass"]) or n == 0:
        near("mass matrix", np.array(found["mass"]).reshape(n, n), mass, tolerance, scale)
    # Relative to what the mass matrix's scale takes for these accelerations.
    near("inverse dynamics", found["effort"], effort, tolerance, max(scale, np.abs(effort).max(initial=0)))
    off = mass @ (np.array(found["acceleration"]) - acceleration)
    near("forward dynamics", off, np.zeros(n), tolerance, max(scale, np.abs(mass @ acceleration).max(initial=0)))


# MJCF


def mjcf_model(file):
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except (ValueError, RuntimeError):
        return None
    if model.nbody <= 1:
        return None
    return model


def rigid(model):
    return model.nflex == 0 and model.nplugin == 0


def compare_mjcf(file, model, prehend, states, tolerance):
    import mujoco

    told = prehend.line()
    if len(told["joints"]) != model.njnt:
        raise Differs(f"{len(told['joints'])} joints, not {model.njnt}")
    if len(told["bodies"]) != model.nbody - 1:
        raise Differs(f"{len(told['bodies'])} bodies, not {model.nbody - 1}")
    near("masses", [b["mass"] for b in told["bodies"]], model.body_mass[1:], tolerance)
    inertias, coms = [], []
    for i, body in enumerate(told["bodies"], start=1):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[i])
        turn = turn.reshape(3, 3)
        inertias.append(turn @ np.diag(model.body_inertia[i]) @ turn.T)
        coms.append(model.body_ipos[i] if body["com"] else np.zeros(3))
    found = [b["inertia"] or [0.0] * 9 for b in told["bodies"]]
    near("inertias", found, np.reshape(inertias, (-1, 9)), tolerance)
    near("centers of mass", [b["com"] or [0.0] * 3 for b in told["bodies"]], coms, tolerance, max(model.stat.extent, 1e-3))
    for i, joint in enumerate(told["joints"]):
        expected = list(model.jnt_range[i]) if model.jnt_limited[i] else None
        if (expected is None) != (joint["range"] is None):
            raise Differs(f"range of joint {i}: {joint['range']}, not {expected}")
        if expected:
            near(f"range of joint {i}", joint["range"], expected, 1e-9, 1.0)
    if len(told["actuators"]) != model.nactuator:
        raise Differs(f"{len(told['actuators'])} actuators, not {model.nactuator}")
    for i, actuator in enumerate(told["actuators"]):
        control = model.actuator_ctrladr[i]
        expected = list(model.actuator_ctrlrange[control]) if model.actuator_ctrllimited[control] else None
        if (expected is None) != (actuator["control"] is None):
            raise Differs(f"control of actuator {i}: {actuator['control']}, not {expected}")
    if told["tendons"] != model.ntendon or len(told["equalities"]) != model.neq:
        raise Differs("tendons or equalities are not as many")
    disable = mujoco.mjtDisableBit
    for flag in ("CONTACT", "LIMIT", "EQUALITY", "FRICTIONLOSS"):
        model.opt.disableflags |= int(getattr(disable, f"mjDSBL_{flag}"))
    model.opt.density = model.opt.viscosity = 0
    model.opt.wind[:] = 0
    random = np.random.default_rng(0)
    data = mujoco.MjData(model)
    # The mass matrix of what is larger is not printed.
    for _ in range(states if model.nv <= 400 else 2):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = random_positions(model, random)
        data.qvel[:] = random.normal(size=model.nv)
        data.ctrl[:] = random.uniform(-1, 1, size=model.nu)
        # An activation is the state of an actuator; the last one is what drives.
        data.act[:] = random.uniform(0, 1, size=model.na)
        acceleration = random.normal(size=model.nv)
        state = {"qpos": data.qpos.copy(), "qvel": data.qvel.copy(), "qacc": acceleration, "ctrl": data.ctrl.copy(), "act": data.act.copy()}
        mujoco.mj_forward(model, data)
        forward = data.qacc.copy()
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        found = prehend.at(state)
        poses = np.tile(np.eye(4), (model.nbody - 1, 1, 1))
        poses[:, :3, :3] = data.xmat[1:].reshape(-1, 3, 3)
        poses[:, :3, 3] = data.xpos[1:]
        near("poses", matrices(found["poses"]), poses, tolerance, max(1.0, np.abs(poses).max()))
        actuation = data.qfrc_actuator.copy()
        data.qacc[:] = acceleration
        mujoco.mj_inverse(model, data)
        compare_dynamics(found, mass, forward, data.qfrc_inverse - actuation, acceleration, tolerance)


def random_positions(model, random):
    import mujoco

    positions = model.qpos0.copy()
    for i in range(model.njnt):
        at, kind = model.jnt_qposadr[i], mujoco.mjtJoint(int(model.jnt_type[i]))
        if kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
            free = kind == mujoco.mjtJoint.mjJNT_FREE
            if free:
                positions[at : at + 3] += random.normal(size=3) * 0.3
            quaternion = random.normal(size=4)
            at += 3 if free else 0
            positions[at : at + 4] = quaternion / np.linalg.norm(quaternion)
        elif model.jnt_limited[i]:
            positions[at] = random.uniform(*model.jnt_range[i])
        else:
            positions[at] += random.normal() * (1.0 if kind == mujoco.mjtJoint.mjJNT_HINGE else 0.1)
    return positions


# URDF


def urdf_model(file):
    import pinocchio

    try:
        return pinocchio.buildModelFromUrdf(str(file))
    except (ValueError, RuntimeError, IndexError):
        return None


def compare_urdf(file, model, prehend, states, tolerance):
    import pinocchio

    told = prehend.line()
    names = list(model.names)[1:]
    joints = {j["name"]: j for j in told["joints"]}
    missing = set(names) ^ set(joints)
    if missing:
        raise Differs(f"joints: {sorted(missing)}")
    # Pinocchio leaves out what the base weighs.
    inertia = sum((i for i in model.inertias), start=pinocchio.Inertia.Zero())
    near("masses", sum(b["mass"] for b in told["bodies"]), inertia.mass, tolerance, max(inertia.mass, 1e-12))
    n = model.nv
    data = model.createData()
    random = np.random.default_rng(0)
    for name in names:
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1 and joints[name]["range"]:
            low, high = joints[name]["range"]
            near("ranges", [low, high], [model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]], 1e-9, 1.0)
    for _ in range(states):
        values = {k: {name: float(random.normal()) for name in names} for k in "qva"}
        q, v, a = np.zeros(model.nq), np.zeros(n), np.zeros(n)
        for name in names:
            joint = model.joints[model.getJointId(name)]
            angle = values["q"][name]
            q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            v[joint.idx_v], a[joint.idx_v] = values["v"][name], values["a"][name]
        found = prehend.at(values)
        order = [found["order"][name] for name in sorted(names, key=lambda x: model.joints[model.getJointId(x)].idx_v)]
        mass = pinocchio.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        effort = pinocchio.rnea(model, data, q, v, a)
        pinocchio.forwardKinematics(model, data, q)
        pinocchio.updateFramePlacements(model, data)
        poses = dict(zip((b["name"] for b in told["bodies"]), matrices(found["poses"])))
        for frame, place in zip(model.frames, data.oMf):
            if frame.type == pinocchio.FrameType.BODY and frame.name in poses:
                near(f"pose of {frame.name}", poses[frame.name], place.homogeneous, tolerance, 1.0)
        size = len(found["effort"])
        found["mass"] = np.array(found["mass"]).reshape(size, size)[np.ix_(order, order)]
        found["effort"], found["acceleration"] = (np.array(found[k])[order] for k in ("effort", "acceleration"))
        if n and np.linalg.cond(mass) < 1e12:
            forward = pinocchio.aba(model, data, q, v, np.zeros(n))
        else:
            forward = found["acceleration"]
        compare_dynamics(found, mass, forward, effort, a, tolerance)


def processor_time():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def times(options, folder, files):
    taken = {}
    for run in ("made", "kept"):
        for file in files:
            start = processor_time()
            arguments = [options.command, file, "--root", folder, "--shapes", options.times, "--partial"]
            done = subprocess.run(arguments, stdin=subprocess.DEVNULL, capture_output=True)
            if done.returncode == 0:
                taken.setdefault(file, {})[run] = processor_time() - start
    for run in ("made", "kept"):
        slowest = sorted(taken, key=lambda file: -taken[file].get(run, 0))[:5]
        print(f"{folder}, {run}: {len(taken)} files, at most "
              + ", ".join(f"{file.relative_to(folder)} {taken[file].get(run, 0):.1f} s" for file in slowest), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folders", nargs="+", type=pathlib.Path)
    parser.add_argument("--list", action="store_true", help="what becomes of each file")
    parser.add_argument("--times", metavar="CACHE", help="how long files take to read with their shapes")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--command", default=REPOSITORY / "target/release/examples/robot_dynamics")
    options = parser.parse_args()
    kinds = {".xml": (mjcf_model, compare_mjcf), ".urdf": (urdf_model, compare_urdf)}
    for folder in options.folders:
        files = sorted(f for f in folder.rglob("*") if f.suffix in kinds)
        if options.times:
            times(options, folder, files)
            continue
        outcome = collections.Counter()
        for file in files:
            read, compare = kinds[file.suffix]
            model = read(file)
            if model is None:
                outcome["not loaded by the peer"] += 1
                continue
            if file.suffix == ".xml" and not rigid(model):
                outcome["not rigid"] += 1
                continue
            prehend = Prehend(options.command, file, folder)
            try:
                compare(file, model, prehend, options.states, options.tolerance)
                result = "agree"
            except Differs as error:
                result = str(error)
            finally:
                prehend.close()
            outcome["agree" if result == "agree" else "does not load" if result.startswith("does not") else "differs"] += 1
            if options.list or result != "agree":
                print(f"{file.relative_to(folder)}: {result}", flush=True)
        rigid_count = outcome["agree"] + outcome["differs"] + outcome["does not load"]
        share = 100 * outcome["agree"] / max(rigid_count, 1)
        print(f"{folder}: {rigid_count} rigid files, {share:.1f} % load and agree; {dict(outcome)}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
