"""Golden values of MJCF models by MuJoCo, for crates/geometry/tests/it/mjcf_golden.rs.

    pip install mujoco
    PREHEND_DATA=../../../../shared/data python mjcf_golden.py > ../../../crates/geometry/tests/golden/mjcf.json

A model of the repository that uses all that is read, and robots of the MuJoCo Menagerie from the data folder.
"""

import json
import os
import pathlib

import mujoco
import numpy as np

REPOSITORY = pathlib.Path(__file__).resolve().parents[3]
DATA = pathlib.Path(os.environ.get("PREHEND_DATA", REPOSITORY.parent / "shared" / "data"))
JOINTS = ["free", "ball", "slide", "hinge"]
TRANSMISSIONS = {
    int(mujoco.mjtTrn.mjTRN_JOINT): "joint",
    int(mujoco.mjtTrn.mjTRN_JOINTINPARENT): "joint",
    int(mujoco.mjtTrn.mjTRN_TENDON): "tendon",
}
CONNECT, WELD, JOINT = (int(e) for e in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT))
GAINS = [int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)]


def matrix(quaternion):
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return rotation.reshape(3, 3)


def limited(flag, values):
    return values if flag else None


def name(model, kind, index):
    return mujoco.mj_id2name(model, kind, index) or ""


def body_name(model, index):
    return name(model, mujoco.mjtObj.mjOBJ_BODY, index)


def joint_name(model, index):
    return name(model, mujoco.mjtObj.mjOBJ_JOINT, index)


def body(m, spec, i):
    turn = matrix(m.body_iquat[i])
    written = spec.bodies[i]
    return {
        "name": body_name(m, i),
        "parent": int(m.body_parentid[i]) - 1,
        "pos": m.body_pos[i],
        "quat": m.body_quat[i],
        "mass": m.body_mass[i],
        "com": m.body_ipos[i],
        "inertia": turn @ np.diag(m.body_inertia[i]) @ turn.T,
        "gravcomp": m.body_gravcomp[i],
        # MuJoCo keeps meshes in single precision, and masses with them.
        "by_mesh": not written.explicitinertial and any(g.meshname for g in written.geoms),
    }


def joint(m, i):
    single = JOINTS[m.jnt_type[i]] in ("slide", "hinge")
    position, degree = m.jnt_qposadr[i], m.jnt_dofadr[i]
    return {
        "name": joint_name(m, i),
        "body": int(m.jnt_bodyid[i]) - 1,
        "kind": JOINTS[m.jnt_type[i]],
        "axis": m.jnt_axis[i],
        "pos": m.jnt_pos[i],
        "range": limited(m.jnt_limited[i], m.jnt_range[i]),
        "ref": m.qpos0[position] if single else 0,
        "springref": m.qpos_spring[position] if single else 0,
        "stiffness": m.jnt_stiffness[i],
        "damping": m.dof_damping[degree],
        "armature": m.dof_armature[degree],
        "frictionloss": m.dof_frictionloss[degree],
        "force": limited(m.jnt_actfrclimited[i], m.jnt_actfrcrange[i]),
        "solver": np.concatenate([m.jnt_solref[i], m.jnt_solimp[i]]),
    }


def geom(m, meshes, i):
    kind = mujoco.mjtGeom(m.geom_type[i]).name.removeprefix("mjGEOM_").lower()
    told = {
        "name": name(m, mujoco.mjtObj.mjOBJ_GEOM, i),
        "body": int(m.geom_bodyid[i]) - 1,
        "kind": kind,
        "contact": [m.geom_contype[i], m.geom_conaffinity[i], m.geom_condim[i], m.geom_priority[i], m.geom_group[i]],
        "numbers": np.concatenate([m.geom_friction[i], m.geom_solref[i], m.geom_solimp[i], [m.geom_margin[i]]]),
    }
    turn = matrix(m.geom_quat[i])
    if kind == "mesh":
        # MuJoCo moves meshes into their frames of inertia: what counts is where they are on the body.
        mesh = m.geom_dataid[i]
        first, count = m.mesh_vertadr[mesh], m.mesh_vertnum[mesh]
        places = m.mesh_vert[first : first + count] @ turn.T + m.geom_pos[i]
        told["bounds"] = [places.min(axis=0), places.max(axis=0)]
    else:
        told["pos"], told["size"] = m.geom_pos[i], m.geom_size[i]
        told["fitted"] = bool(meshes[i])
        # The axes of what is fitted may point either way.
        told["outer"] = turn @ np.diag([1, 2, 3]) @ turn.T
    return told


def site(m, i):
    return {
        "name": name(m, mujoco.mjtObj.mjOBJ_SITE, i),
        "body": int(m.site_bodyid[i]) - 1,
        "pos": m.site_pos[i],
        "quat": m.site_quat[i],
    }


def is_fixed(m, tendon):
    return m.wrap_type[m.tendon_adr[tendon]] == int(mujoco.mjtWrap.mjWRAP_JOINT)


def is_read(m, i):
    if m.actuator_gaintype[i] not in GAINS or m.actuator_trntype[i] not in TRANSMISSIONS:
        return False
    target = m.actuator_trnid[i, 0]
    if TRANSMISSIONS[m.actuator_trntype[i]] == "tendon":
        return is_fixed(m, target)
    return JOINTS[m.jnt_type[target]] in ("slide", "hinge")


def actuator(m, spec, i):
    kind, target = TRANSMISSIONS[m.actuator_trntype[i]], m.actuator_trnid[i, 0]
    gains = 1 if m.actuator_gaintype[i] == GAINS[0] else 3
    biases = 3 if m.actuator_biastype[i] == int(mujoco.mjtBias.mjBIAS_AFFINE) else 0
    dynamics = m.actuator_dyntype[i]
    filters = [int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)]
    return {
        "name": name(m, mujoco.mjtObj.mjOBJ_ACTUATOR, i),
        "target": joint_name(m, target) if kind == "joint" else name(m, mujoco.mjtObj.mjOBJ_TENDON, target),
        "kind": kind,
        "gear": m.actuator_gear[i, 0],
        "gain": np.where(np.arange(3) < gains, m.actuator_gainprm[i, :3], 0),
        "bias": np.where(np.arange(3) < biases, m.actuator_biasprm[i, :3], 0),
        # Found from the masses of meshes, where there are any.
        "by_ratio": bool(spec.actuators[i].biasprm[2] > 0),
        "integrates": bool(dynamics == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)),
        "filter": m.actuator_dynprm[i, 0] if dynamics in filters else None,
        "control": limited(m.actuator_ctrllimited[i], m.actuator_ctrlrange[i]),
        "force": limited(m.actuator_forcelimited[i], m.actuator_forcerange[i]),
        "activation": limited(m.actuator_actlimited[i], m.actuator_actrange[i]),
    }


def tendon(m, i):
    wraps = range(m.tendon_adr[i], m.tendon_adr[i] + m.tendon_num[i])
    return {
        "name": name(m, mujoco.mjtObj.mjOBJ_TENDON, i),
        "joints": [joint_name(m, m.wrap_objid[w]) for w in wraps],
        "coefficients": [m.wrap_prm[w] for w in wraps],
        "range": limited(m.tendon_limited[i], m.tendon_range[i]),
        "spring": m.tendon_lengthspring[i],
        "numbers": [m.tendon_stiffness[i], m.tendon_damping[i], m.tendon_frictionloss[i], m.tendon_armature[i]],
    }


def equality(m, i):
    kind, data = m.eq_type[i], m.eq_data[i]
    told = {
        "name": name(m, mujoco.mjtObj.mjOBJ_EQUALITY, i),
        "active": bool(m.eq_active0[i]),
        "solver": np.concatenate([m.eq_solref[i], m.eq_solimp[i]]),
    }
    ids = [int(m.eq_obj1id[i]), int(m.eq_obj2id[i])]
    if kind == JOINT:
        return told | {"kind": "joint", "joints": [joint_name(m, j) if j >= 0 else "" for j in ids], "numbers": data[:5]}
    weld = kind == WELD
    anchors = [data[3:6], data[:3]] if weld else [data[:3], data[3:6]]
    turn = matrix(data[6:10]) if weld else np.eye(3)
    if m.eq_objtype[i] == int(mujoco.mjtObj.mjOBJ_SITE):
        anchors = [m.site_pos[s] for s in ids]
        turn = matrix(m.site_quat[ids[0]]) @ matrix(m.site_quat[ids[1]]).T
        ids = [m.site_bodyid[s] for s in ids]
    told |= {"kind": "weld" if weld else "connect", "bodies": [int(b) - 1 for b in ids], "anchors": anchors}
    return told | ({"rotation": turn, "scale": data[10]} if weld else {})


def keyframe(m, i):
    return {
        "name": name(m, mujoco.mjtObj.mjOBJ_KEY, i),
        "time": m.key_time[i],
        "positions": m.key_qpos[i],
        "velocities": m.key_qvel[i],
        "controls": [m.key_ctrl[i][a] for a in range(m.nu) if is_read(m, a)],
    }


def plain(value):
    if isinstance(value, dict):
        return {key: plain(x) for key, x in value.items()}
    if isinstance(value, (list, np.ndarray)):
        return [plain(x) for x in value]
    if isinstance(value, (float, np.floating)):
        return int(value) if value == int(value) else float(value)
    return value.item() if isinstance(value, np.generic) else value


def golden(folder, file):
    spec = mujoco.MjSpec.from_file(str(folder / file))
    m = spec.compile()
    meshes = {g.id: g.meshname for g in spec.geoms}
    excluded = [sorted([(int(s) >> 16) - 1, (int(s) & 0xFFFF) - 1]) for s in m.exclude_signature]
    constraints = [CONNECT, WELD, JOINT]
    return plain(
        {
            "file": file,
            "gravity": m.opt.gravity,
            "bodies": [body(m, spec, i) for i in range(1, m.nbody)],
            "joints": [joint(m, i) for i in range(m.njnt)],
            "geoms": [geom(m, meshes, i) for i in range(m.ngeom)],
            "sites": [site(m, i) for i in range(m.nsite)],
            "actuators": [actuator(m, spec, i) for i in range(m.nu) if is_read(m, i)],
            "tendons": [tendon(m, i) for i in range(m.ntendon) if is_fixed(m, i)],
            "equalities": [equality(m, i) for i in range(m.neq) if m.eq_type[i] in constraints],
            "exclusions": sorted(excluded),
            "keyframes": [keyframe(m, i) for i in range(m.nkey)],
        }
    )


ROBOTS = [
    "kuka_iiwa_14/iiwa14.xml",
    "robotiq_2f85/2f85.xml",
    "shadow_hand/right_hand.xml",
    "shadow_hand/left_hand.xml",
    "wonik_allegro/right_hand.xml",
    "wonik_allegro/left_hand.xml",
    "shadow_hand/scene_right.xml",
]
models = {
    "authored": golden(REPOSITORY / "crates/geometry/tests/mjcf", "everything.xml"),
    "robots": [golden(DATA / "robots", robot) for robot in ROBOTS],
}
print(json.dumps(models, separators=(",", ":")))
