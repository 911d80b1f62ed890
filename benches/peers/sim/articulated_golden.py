"""Golden values of articulated bodies by Pinocchio, for crates/sim/tests/it/articulated/golden.rs.

    pip install pin
    python articulated_golden.py > ../../../crates/sim/tests/it/golden/articulated.json

Trees are drawn at random: joints of all kinds, floating bases, branches. Matrices are told by their products with random vectors.
"""

import json

import numpy as np
import pinocchio as pin

rng = np.random.default_rng(26)


def rotation():
    quaternion = rng.normal(size=4)
    return pin.Quaternion(*(quaternion / np.linalg.norm(quaternion)))


def inertia():
    mass = rng.uniform(0.2, 2.0)
    root = rng.normal(size=(3, 3)) * 0.1
    return mass, rng.normal(size=3) * 0.1, root @ root.T + 0.01 * np.eye(3)


def joint(kind, axis):
    return {
        "revolute": lambda: pin.JointModelRevoluteUnaligned(axis),
        "prismatic": lambda: pin.JointModelPrismaticUnaligned(axis),
        "spherical": pin.JointModelSpherical,
        "floating": pin.JointModelFreeFlyer,
    }[kind]()


def tree(name, kinds, branches):
    """Link i hangs on link i - 1, or on `branches[i]`."""
    model = pin.Model()
    model.gravity.linear = np.array([0.3, -0.2, -9.81])
    links = []
    for index, kind in enumerate(kinds):
        parent = branches.get(index, index - 1)
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turn, place = rotation(), rng.normal(size=3) * 0.3
        mass, com, about_com = inertia()
        placement = pin.SE3(turn.matrix(), place)
        added = model.addJoint(parent + 1, joint(kind, axis), placement, f"{name}{index}")
        model.appendBodyToJoint(added, pin.Inertia(mass, com, about_com), pin.SE3.Identity())
        links.append(
            {
                "parent": parent,
                "kind": kind,
                "axis": axis.tolist(),
                "place": place.tolist(),
                "turn": turn.coeffs().tolist(),
                "mass": mass,
                "com": com.tolist(),
                "inertia": about_com.flatten().tolist(),
            }
        )
    data = model.createData()
    n = model.nv
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=n))
    v, a, tau, w = (rng.normal(size=n) for _ in range(4))
    golden = {"name": name, "links": links, "q": q, "v": v, "a": a, "tau": tau, "direction": w}
    golden["inverse_dynamics"] = pin.rnea(model, data, q, v, a)
    golden["forward_dynamics"] = pin.aba(model, data, q, v, tau)
    crba = pin.crba(model, data, q)
    mass_matrix = np.triu(crba) + np.triu(crba, 1).T
    golden["mass_matrix"] = mass_matrix @ w
    by_q, by_v, _ = pin.computeRNEADerivatives(model, data, q, v, a)
    golden["inverse_by_position"], golden["inverse_by_velocity"] = by_q @ w, by_v @ w
    by_q, by_v, by_tau = pin.computeABADerivatives(model, data, q, v, tau)
    by_tau = np.triu(by_tau) + np.triu(by_tau, 1).T
    golden["forward_by_position"], golden["forward_by_velocity"] = by_q @ w, by_v @ w
    golden["forward_by_effort"] = by_tau @ w
    golden["kinetic"] = pin.computeKineticEnergy(model, data, q, v)
    golden["potential"] = pin.computePotentialEnergy(model, data, q)
    last = len(kinds)
    pin.computeJointJacobians(model, data, q)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    golden["jacobian"] = pin.getJointJacobian(model, data, last, frame).reshape(6, n) @ v
    pin.forwardKinematics(model, data, q, v)
    golden["place"] = data.oMi[last].translation
    return {k: x.tolist() if isinstance(x, np.ndarray) else x for k, x in golden.items()}


cycle = ["revolute", "prismatic", "revolute", "spherical"]
trees = [
    tree("pendulum", ["revolute"], {}),
    tree("slider", ["prismatic", "revolute"], {}),
    tree("ball", ["spherical", "revolute", "revolute"], {}),
    tree("body", ["floating"], {}),
    tree("arm", ["revolute"] * 7, {}),
    tree("mixed", [cycle[i % 4] for i in range(12)], {4: 1, 8: 5}),
    tree("humanoid", ["floating"] + ["revolute"] * 30, {7: 0, 13: 0, 19: 14, 25: 14}),
]
print(json.dumps(trees))
