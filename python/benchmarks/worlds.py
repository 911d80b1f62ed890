"""Times what Python adds: a call, and a batch of worlds beside `cargo bench -p prehend-sim --bench batch`, whose work this is.

    python worlds.py
"""

import statistics
import time
from collections.abc import Callable

import numpy as np
import prehend

BALLS, RADIUS, DT, STEPS = 10, 0.05, 1e-3, 100


def balls() -> tuple[prehend.Model, prehend.State]:
    """Balls that slide and roll on a floor, one beside the other."""
    model = prehend.Model()
    model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    inertia = 3 * [0.4 * 0.5 * RADIUS**2]
    for ball in range(BALLS):
        model.add_body(f"ball {ball}", prehend.Shape.ball(RADIUS), mass=0.5, com=[0, 0, 0], inertia=inertia)
        model.add_contact(
            f"ball {ball}", "floor", "hunt_crossley",
            stiffness=1.56e5, damping=0.6, exponent=1.0, friction=0.4, slip_scale=0.1,
        )
    state = model.neutral_state()
    for ball in range(BALLS):
        model.set_pose(state, f"ball {ball}", [0.0, 0.2 * ball, RADIUS - 1e-3])
    return model, state


def median(run: Callable[[], object], times: int) -> float:
    taken = []
    for _ in range(times):
        start = time.perf_counter()
        run()
        taken.append(time.perf_counter() - start)
    return statistics.median(taken)


def main() -> None:
    model, state = balls()
    stone = prehend.Model()
    stone.add_body("stone", prehend.Shape.ball(0.1))
    step, rest = stone.rollout(1e-4, 1, integrator="semi_implicit_euler"), stone.neutral_state()
    print(f"a step of one free body: {1e6 * median(lambda: step(rest, end=True), 20001):.2f} µs a call")
    rollout = model.rollout(DT, STEPS, integrator="semi_implicit_euler")
    for count in (1, 64, 1024):
        speeds = np.zeros((count, model.nv))
        speeds[:, ::6] = 0.2 + 1e-4 * (np.arange(count) % 997)[:, None] + 0.01 * np.arange(BALLS)
        starts = prehend.State(*(np.repeat(x[None], count, 0) for x in state))._replace(v=speeds)

        def gradient(starts: prehend.State = starts, count: int = count) -> object:
            _, pullback = prehend.vjp(rollout, starts)
            adjoints = np.zeros((count, BALLS + 1, 13))
            adjoints[:, :, 0] = 1.0
            return pullback(prehend.Run(bodies=adjoints))

        runs = 21 if count < 256 else 5
        forward = 1e3 * median(lambda starts=starts: rollout(starts, end=True), runs)
        both = 1e3 * median(gradient, runs)
        print(f"{count:5} worlds: {forward:8.2f} ms, with gradient by all states {both:8.1f} ms")


if __name__ == "__main__":
    main()
