"""Worlds of ten balls that slide and roll on a plane, 100 steps of 1 ms, in MJX: values and gradient by ten speeds.

The work of `cargo bench -p prehend-sim --bench batch`. Needs `pip install mujoco-mjx`.
"""

import sys
import time

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

BALLS, STEPS, RADIUS = 10, 100, 0.05
bodies = "".join(
    f'<body pos="0 {0.2 * i} {RADIUS - 1e-3}"><freejoint/>'
    f'<geom type="sphere" size="{RADIUS}" mass="0.5" contype="1" conaffinity="0"/></body>'
    for i in range(BALLS)
)
MODEL = f"""
<mujoco>
  <option timestep="0.001" iterations="1" ls_iterations="4"><flag eulerdamp="disable"/></option>
  <worldbody><geom type="plane" size="9 9 1" contype="0" conaffinity="1"/>{bodies}</worldbody>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(MODEL)
put = mjx.put_model(model)
start = mjx.put_data(model, mujoco.MjData(model))
places = 6 * np.arange(BALLS)


def far(faster, index):
    speeds = 0.2 + 1e-4 * (index % 997) + 0.01 * jnp.arange(BALLS) + faster
    data = start.replace(qvel=start.qvel.at[places].set(speeds))
    step = lambda data, _: (mjx.step(put, data), None)
    data, _ = jax.lax.scan(step, data, None, length=STEPS)
    return jnp.sum(data.qpos[7 * np.arange(BALLS)])


def total(faster, indices):
    return jnp.sum(jax.vmap(far, (None, 0))(faster, indices))


def median(run, runs=3):
    run()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return sorted(times)[runs // 2]


value, gradient = jax.jit(total), jax.jit(jax.value_and_grad(total))
zero = jnp.zeros(BALLS)
for count in [int(x) for x in sys.argv[1:]] or [1, 16, 256, 1024, 4096]:
    indices = jnp.arange(count)
    forward = median(lambda: value(zero, indices).block_until_ready())
    both = median(lambda: jax.block_until_ready(gradient(zero, indices)))
    print(f"| {count} | {1e3 * forward:.1f} ms | {1e3 * both:.1f} ms |", flush=True)
