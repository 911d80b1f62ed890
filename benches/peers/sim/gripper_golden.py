"""Motion of the closed loops of a gripper by MuJoCo, for crates/sim/tests/it/robots/gripper.rs.

    pip install mujoco
    python gripper_golden.py DATA_FOLDER > crates/sim/tests/it/golden/gripper.json

The gripper closes with its control at 200, and opens with 40 from half of the time on. Contacts are left out, steps are short.
"""

import json
import os
import sys

import mujoco

STEP, EVERY, TIME = 5e-5, 0.02, 0.8
CONTROLS = [200.0, 40.0]

path = os.path.join(sys.argv[1], "robots/robotiq_2f85/2f85.xml")
model = mujoco.MjModel.from_xml_path(path)
model.opt.timestep = STEP
model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
data = mujoco.MjData(model)
names = [model.joint(i).name for i in range(model.njnt)]
run = []
every = round(EVERY / STEP)
for step in range(round(TIME / STEP) + 1):
    if step % every == 0:
        run.append(data.qpos.tolist())
    data.ctrl[0] = CONTROLS[0] if step * STEP < 0.5 * TIME - 1e-9 else CONTROLS[1]
    mujoco.mj_step(model, data)
json.dump({"every": EVERY, "controls": CONTROLS, "joints": names, "positions": run}, sys.stdout)
