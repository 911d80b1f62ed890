"""Times MJX on one core: forward dynamics and a step with its Jacobian, on the trees of crates/sim/benches/articulated.rs.

    pip install mujoco-mjx
    taskset -c 0 python articulated_mjx.py

Evaluations follow each other in one compiled loop, in single precision as is MJX's default.
"""

import time

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx

EVALUATIONS, ROUNDS = 200, 7
AXES = ["1 0 0", "0 1 0", "0 0 1"]


def body(name, joint, inner):
    return f"""<body name="{name}" pos="0.1 0.05 0.2">{joint}
        <inertial mass="1" pos="0.02 -0.01 0.1" diaginertia="0.01 0.012 0.008"/>{inner}</body>"""


def chain(first, count):
    inner = ""
    for k in reversed(range(first, first + count)):
        inner = body(f"b{k}", f'<joint type="hinge" axis="{AXES[k % 3]}"/>', inner)
    return inner


def tree(joints, floats):
    if floats:
        chains = "".join(chain(first, 6) for first in range(0, joints, 6))
        model = body("root", "<freejoint/>", chains)
    else:
        model = chain(0, joints)
    option = '<option timestep="1e-4"><flag contact="disable" constraint="disable"/></option>'
    return f"<mujoco>{option}<worldbody>{world}</worldbody></mujoco>"


def timed(name, step, x):
    run = jax.jit(lambda x: jax.lax.fori_loop(0, EVALUATIONS, lambda _, x: step(x), x))
    jax.block_until_ready(run(x))
    best = min(measure(run, x) for _ in range(ROUNDS))
    print(f"{name:55} {1e6 * best / EVALUATIONS:9.1f} µs", flush=True)


def measure(run, x):
    start = time.perf_counter()
    jax.block_until_ready(run(x))
    return time.perf_counter() - start


def main():
    for name, joints, floats in [("7", 7, False), ("36", 30, True)]:
        model = mujoco.MjModel.from_xml_string(tree(joints, floats))
        data = mujoco.MjData(model)
        own, start = mjx.put_model(model), mjx.put_data(model, data)
        start = start.replace(qvel=jnp.sin(jnp.arange(model.nv, dtype=jnp.float32)))
        timed(f"step, {name} degrees of freedom", lambda d: mjx.step(own, d), start)

        def velocities(v, d):
            return mjx.step(own, d.replace(qvel=v)).qvel

        def jacobian(d):
            by = jax.jacfwd(velocities)(d.qvel, d)
            # What is computed has to be used, and positions have to change.
            moved = mjx.step(own, d)
            return moved.replace(qvel=moved.qvel + 1e-12 * by.sum())

        timed(f"and its Jacobian by velocities, {name} degrees", jacobian, start)


main()
