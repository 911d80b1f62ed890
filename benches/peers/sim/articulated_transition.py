"""Times MuJoCo on one core: a step with contacts and mjd_transitionFD, on the trees of crates/sim/benches/articulated.rs over a floor.

    pip install mujoco
    taskset -c 0 python articulated_transition.py

The last link of each chain touches the floor with a ball. Finite differences are centered, as exact ones are compared with.
"""

import time

import mujoco
import numpy as np

EVALUATIONS, ROUNDS = 200, 15
AXES = ["1 0 0", "0 1 0", "0 0 1"]


def body(joint, inner):
    return f"""<body pos="0.1 0.05 0.2">{joint}
        <inertial mass="1" pos="0.02 -0.01 0.1" diaginertia="0.01 0.012 0.008"/>{inner}</body>"""


def chain(first, count):
    inner = '<geom size="0.03" conaffinity="0"/>'
    for k in reversed(range(first, first + count)):
        inner = body(f'<joint type="hinge" axis="{AXES[k % 3]}"/>', inner)
    return inner


def tree(joints, floats, height):
    model = body("<freejoint/>", "".join(chain(k, 6) for k in range(0, joints, 6))) if floats else chain(0, joints)
    return f"""<mujoco><option timestep="1e-4"/><worldbody><geom type="plane" size="9 9 1" pos="0 0 {height}"/>
        {world}</worldbody></mujoco>"""


def timed(name, evaluate):
    def measure():
        start = time.perf_counter()
        for _ in range(EVALUATIONS):
            evaluate()
        return time.perf_counter() - start

    print(f"{name:55} {1e6 * min(measure() for _ in range(ROUNDS)) / EVALUATIONS:9.1f} µs", flush=True)


def main():
    for name, joints, floats in [("7", 7, False), ("36", 30, True)]:
        height = -9.0
        for _ in range(2):
            model = mujoco.MjModel.from_xml_string(tree(joints, floats, height))
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            height = data.geom_xpos[1:, 2].min() - 0.029
        data.qvel[:] = 1e-3 * np.sin(np.arange(model.nv))
        mujoco.mj_forward(model, data)
        start = data.qpos.copy(), data.qvel.copy()
        a = np.zeros((2 * model.nv + model.na, 2 * model.nv + model.na))

        def step():
            data.qpos[:], data.qvel[:] = start
            mujoco.mj_step(model, data)

        def transition():
            data.qpos[:], data.qvel[:] = start
            mujoco.mjd_transitionFD(model, data, 1e-6, True, a, None, None, None)

        print(f"{data.ncon} contacts")
        timed(f"step with contacts, {name} degrees of freedom", step)
        timed(f"mjd_transitionFD, {name} degrees of freedom", transition)


main()
