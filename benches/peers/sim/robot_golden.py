"""Values of robots in MJCF and URDF at random states, for crates/sim/tests/it/robots/golden.rs.

MuJoCo gives the poses of bodies, the mass matrix, inverse and forward dynamics of the MJCF files; Pinocchio the same of the URDF file, and all
derivatives. Where both have a value they are compared here. Loops, contacts, springs, dampers and actuators are left out: all robots are open trees.

    pip install pin mujoco
    python robot_golden.py DATA_FOLDER > crates/sim/tests/it/golden/robots.json
"""

import json
import os
import sys

import mujoco
import numpy as np
import pinocchio as pin

MJCF = {
    "iiwa14": "robots/kuka_iiwa_14/iiwa14.xml",
    "robotiq_2f85": "robots/robotiq_2f85/2f85.xml",
    "shadow_right": "robots/shadow_hand/right_hand.xml",
    "shadow_left": "robots/shadow_hand/left_hand.xml",
    "allegro_right": "robots/wonik_allegro/right_hand.xml",
    "allegro_left": "robots/wonik_allegro/left_hand.xml",
}
URDF = {"allegro_xela": "hands/allegro_xela_right.urdf"}


def pose(position, quaternion):
    """Position and quaternion (w, x, y, z)."""
    return [*map(float, position), *map(float, quaternion)]


def check(name, a, b, tolerance=1e-8):
    off = np.max(np.abs(np.asarray(a) - np.asarray(b))) / max(1e-3, np.max(np.abs(b)))
    if off > tolerance:
        raise SystemExit(f"{name}: MuJoCo and Pinocchio differ by {off:.1e}")


def derivatives(model, q, v, a, tau):
    data = model.createData()
    pin.computeRNEADerivatives(model, data, q, v, a)
    by_q, by_v = data.dtau_dq.copy(), data.dtau_dv.copy()
    pin.computeABADerivatives(model, data, q, v, tau)
    return {
        "effort_by_position": by_q.ravel().tolist(),
        "effort_by_velocity": by_v.ravel().tolist(),
        "acceleration_by_position": data.ddq_dq.ravel().tolist(),
        "acceleration_by_velocity": data.ddq_dv.ravel().tolist(),
    }


def record(path, model, motion, values):
    (q, v, a), (tau, mass, poses, acceleration) = motion, values
    return {
        "file": path,
        "joints": list(model.names)[1:],
        "q": q.tolist(),
        "v": v.tolist(),
        "a": a.tolist(),
        "poses": poses,
        "mass": mass.ravel().tolist(),
        "effort": tau.tolist(),
        "acceleration": acceleration.tolist(),
        **derivatives(model, q, v, a, tau),
    }


def state(rng, n):
    return rng.uniform(-0.7, 0.7, n), rng.normal(0, 2, n), rng.normal(0, 5, n)


def from_pinocchio(model, q, v, a):
    data = model.createData()
    tau = pin.rnea(model, data, q, v, a)
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    pin.framesForwardKinematics(model, data, q)
    poses = {}
    for index, frame in enumerate(model.frames):
        if frame.type == pin.FrameType.BODY:
            placed = data.oMf[index]
            turn = pin.Quaternion(placed.rotation)
            poses[frame.name] = pose(placed.translation, [turn.w, turn.x, turn.y, turn.z])
    acceleration = pin.aba(model, data, q, v, tau)
    return tau, mass, poses, acceleration


def twin_of(model):
    """The model for Pinocchio, whose reader of MJCF leaves out inertias of meshes: hinges and slides where MuJoCo has them."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    twin = pin.Model()
    twin.gravity.linear[:] = model.opt.gravity
    placed = {0: pin.SE3.Identity()}
    last = {0: 0}
    for body in range(1, model.nbody):
        joint = last[model.body_parentid[body]]
        for index in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            kind = {
                int(mujoco.mjtJoint.mjJNT_HINGE): pin.JointModelRevoluteUnaligned,
                int(mujoco.mjtJoint.mjJNT_SLIDE): pin.JointModelPrismaticUnaligned,
            }[int(model.jnt_type[index])]
            frame = pin.SE3(np.eye(3), data.xanchor[index])
            place = placed[joint].inverse() * frame
            joint = twin.addJoint(joint, kind(data.xaxis[index]), place, model.joint(index).name)
            placed[joint] = frame
        last[body] = joint
        w, x, y, z = data.xquat[body]
        own = pin.SE3(pin.Quaternion(w, x, y, z), data.xpos[body])
        w, x, y, z = model.body_iquat[body]
        about = pin.SE3(pin.Quaternion(w, x, y, z), model.body_ipos[body])
        inertia = pin.Inertia(model.body_mass[body], np.zeros(3), np.diag(model.body_inertia[body]))
        if joint and model.body_mass[body] > 0:
            twin.appendBodyToJoint(joint, inertia, placed[joint].inverse() * own * about)
    return twin


def mjcf(folder, path, rng):
    model = mujoco.MjModel.from_xml_path(os.path.join(folder, path))
    data = mujoco.MjData(model)
    q, v, a = state(rng, model.nv)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mass = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, mass, data.qM)
    except (TypeError, AttributeError):
        mujoco.mj_fullM(model, data, mass)
    tau = mass @ a + data.qfrc_bias
    poses = {model.body(i).name: pose(data.xpos[i], data.xquat[i]) for i in range(1, model.nbody)}
    acceleration = np.linalg.solve(mass, tau - data.qfrc_bias)
    twin = twin_of(model)
    twin.armature[:] = model.dof_armature
    own_tau, own_mass, _, own_acceleration = from_pinocchio(twin, q, v, a)
    check(f"{path}: mass matrix", mass, own_mass)
    check(f"{path}: inverse dynamics", tau, own_tau)
    check(f"{path}: forward dynamics", acceleration, own_acceleration)
    return record(path, twin, (q, v, a), (tau, mass, poses, acceleration))


def urdf(folder, path, rng):
    model = pin.buildModelFromUrdf(os.path.join(folder, path))
    q, v, a = state(rng, model.nv)
    return record(path, model, (q, v, a), from_pinocchio(model, q, v, a))


def main():
    folder = sys.argv[1]
    rng = np.random.default_rng(26)
    robots = {name: mjcf(folder, path, rng) for name, path in MJCF.items()}
    robots |= {name: urdf(folder, path, rng) for name, path in URDF.items()}
    json.dump(robots, sys.stdout)


main()
