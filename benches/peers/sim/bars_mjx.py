"""Two crossed bars, edge on edge, in MJX: are derivatives by place, velocity and law those of the motion?

The scene is that of `crates/sim/tests/it/mesh_contact`. Needs `pip install mujoco-mjx`; prints for each group the derivative of where
the end of the bar is after 60 ms along a fixed direction, by forward mode and by central differences of the same program.
"""

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

TIME, STEP = 0.06, 5e-4
DIRECTION = np.array([0.8, -0.5, 0.3])
HALF = [0.06, 6e-3, 6e-3]


def turn(axis, angle):
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * np.asarray(axis)])


def product(a, b):
    out = np.zeros(4)
    mujoco.mju_mulQuat(out, a, b)
    return out


edge_up = turn([1, 0, 0], np.pi / 4)
across = product(turn([0, 1, 0], 0.03), product(turn([0, 0, 1], 1.3), edge_up))
apart = 2 * HALF[1] * np.sqrt(2) + 5e-4
text = lambda v: " ".join(f"{x:.17g}" for x in v)
MODEL = f"""
<mujoco>
  <option timestep="{STEP}" integrator="Euler" cone="pyramidal" iterations="20" ls_iterations="20"/>
  <worldbody>
    <geom type="box" size="{text(HALF)}" quat="{text(edge_up)}" friction="0.3 0 0"/>
    <body pos="{text([0.004, 0.002, apart])}" quat="{text(across)}">
      <freejoint/>
      <geom type="box" size="{text(HALF)}" density="2700" friction="0.3 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(MODEL)
put = mjx.put_model(model)
start = mjx.put_data(model, mujoco.MjData(model))
MARK = jnp.array([HALF[0], 0.0, 0.0])


def rotated(q, v):
    t = 2 * jnp.cross(q[1:], v)
    return v + q[0] * t + jnp.cross(q[1:], t)


def end(changes):
    """Where the end of the bar is, after changes of place (3), velocity (3) and of the logarithm of friction (1)."""
    scaled = put.replace(geom_friction=put.geom_friction * jnp.exp(changes[6]))
    data = start.replace(
        qpos=start.qpos.at[:3].add(changes[:3]), qvel=start.qvel.at[:3].add(changes[3:6])
    )
    # MJX makes indices of 64 bits out of such of 32.
    alike = lambda new, old: new.astype(old.dtype)
    step = lambda data, _: (jax.tree.map(alike, mjx.step(scaled, data), data), None)
    data = jax.tree.map(jnp.asarray, data)
    data, _ = jax.lax.scan(step, data, None, length=round(TIME / STEP))
    return data.qpos[:3] + rotated(data.qpos[3:7], MARK)


end = jax.jit(end)
slope = jax.jit(lambda x, along: jax.jvp(end, (x,), (along,))[1])
groups = {
    "place": (np.r_[DIRECTION, 0, 0, 0, 0], 2e-6),
    "velocity": (np.r_[0, 0, 0, DIRECTION, 0], 1e-4),
    "friction": (np.r_[0, 0, 0, 0, 0, 0, 1.0], 1e-3),
}
zero = np.zeros(7)
for name, (along, h) in groups.items():
    exact = np.asarray(slope(zero, along))
    difference = [np.asarray(end(h * along) - end(-h * along)) / (2 * h) for h in (h, 0.1 * h)]
    size = np.linalg.norm(difference[0])
    off = 100 * np.linalg.norm(exact - difference[0]) / size
    settled = 100 * np.linalg.norm(difference[1] - difference[0]) / size
    print(f"by {name}: {size:.2e}, off by {off:.3g} %, differences by {settled:.3g} %", flush=True)
