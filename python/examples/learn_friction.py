"""Learns the friction of a floor from slides that were seen, by Gauss–Newton steps: NumPy alone.

    python learn_friction.py
"""

import numpy as np
import prehend
from numpy.typing import NDArray
from prehend import POSITION

TRUTH = 0.3


def scene() -> tuple[prehend.Model, int, str]:
    """A box over a floor: its number, and the name of their friction."""
    model = prehend.Model()
    floor = model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    box = model.add_body("box", prehend.Shape.cuboid([0.05, 0.04, 0.03], spacing=0.02), density=500.0)
    contact = model.add_contact(
        box, floor, "hunt_crossley", smoothing=5e-5,
        stiffness=1e8, damping=1.0, exponent=1.0, friction=TRUTH, slip_scale=1e-2,
    )
    return model, box, contact["friction"]


def main() -> None:
    model, box, friction = scene()
    random = np.random.default_rng(1)
    start = model.neutral_state()
    model.set_pose(start, box, [0.0, 0.0, 0.035])
    # Eight throws from one place: of what is no batch, all worlds have the same.
    speeds = np.zeros((8, model.nv))
    speeds[:, :3] = random.normal(size=(8, 3)) * [0.5, 0.5, 0.0]
    throws = start._replace(v=speeds)
    rollout = model.rollout(0.02, 10, parameters=[friction])
    seen = rollout(throws).bodies[:, 1:, box, POSITION]
    seen += 1e-4 * random.normal(size=seen.shape)

    def linearized(value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What is off, and its derivative by the friction."""
        run, along = rollout.jvp((throws, [value], None), (None, [1.0], None))
        off, slope = run.bodies[:, 1:, box, POSITION] - seen, along.bodies[:, 1:, box, POSITION]
        return off.ravel(), slope.ravel()

    value, steps = 0.5, 0
    for steps in range(1, 20):
        off, slope = linearized(value)
        step = float(slope @ off) / float(slope @ slope)
        value = max(value - step, 0.0)
        if abs(step) < 1e-6:
            break
    deviation = 1e-4 / float(np.linalg.norm(slope))
    print(f"friction {value:.5f} ± {deviation:.5f} in {steps} steps, truth {TRUTH}")
    assert abs(value - TRUTH) < 4 * deviation


if __name__ == "__main__":
    main()
