"""Worlds of ten balls that slide and roll on a plane, 100 steps of 1 ms, in Warp: values and gradient by ten speeds.

The work of `cargo bench -p prehend-sim --bench batch`, with the same penalty law, as one kernel a step. Warp's CPU device runs one
thread. Needs `pip install warp-lang`.
"""

import sys
import time

import numpy as np
import warp as wp

BALLS, STEPS = 10, 100
DT = wp.constant(1e-3)
RADIUS = wp.constant(0.05)
MASS = wp.constant(0.5)
INERTIA = wp.constant(0.4 * 0.5 * 0.05 * 0.05)
# As `HuntCrossley::from_target`: 1 mm deep at rest, half the speed after an impact of 1 m/s.
STIFFNESS = wp.constant(0.5 * 9.81 / 1e-3)
DAMPING = wp.constant(0.75)
FRICTION = wp.constant(0.4)
SLIP = wp.constant(0.1)


@wp.kernel
def begin(faster: wp.array(dtype=float), x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    ball = i % 10
    speed = 0.2 + 1.0e-4 * float((i // 10) % 997) + 0.01 * float(ball) + faster[ball]
    x[i] = wp.vec3(0.0, 0.2 * float(ball), 0.049)
    v[i] = wp.vec3(speed, 0.0, 0.0)


@wp.kernel
def step(
    x: wp.array(dtype=wp.vec3),
    q: wp.array(dtype=wp.quat),
    v: wp.array(dtype=wp.vec3),
    w: wp.array(dtype=wp.vec3),
    x1: wp.array(dtype=wp.vec3),
    q1: wp.array(dtype=wp.quat),
    v1: wp.array(dtype=wp.vec3),
    w1: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    lever = wp.vec3(0.0, 0.0, -RADIUS)
    gap = x[i][2] - RADIUS
    point = v[i] + wp.cross(w[i], lever)
    force = wp.vec3(0.0, 0.0, 0.0)
    if gap < 0.0:
        normal = wp.max(-STIFFNESS * gap * (1.0 - DAMPING * point[2]), 0.0)
        slip = wp.vec3(point[0], point[1], 0.0)
        along = -slip * (FRICTION * normal / wp.sqrt(wp.dot(slip, slip) + SLIP * SLIP))
        force = along + wp.vec3(0.0, 0.0, normal)
    torque = wp.cross(lever, force)
    velocity = v[i] + (force / MASS + wp.vec3(0.0, 0.0, -9.81)) * DT
    spin = w[i] + torque * (DT / INERTIA)
    v1[i] = velocity
    w1[i] = spin
    x1[i] = x[i] + velocity * DT
    turn = wp.quat(spin[0], spin[1], spin[2], 0.0) * q[i]
    q1[i] = wp.normalize(q[i] + turn * (0.5 * DT))


@wp.kernel
def far(x: wp.array(dtype=wp.vec3), sum: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(sum, 0, x[i][0])


class Worlds:
    def __init__(self, count):
        n = self.n = count * BALLS
        vectors = lambda: [wp.zeros(n, dtype=wp.vec3, requires_grad=True) for _ in range(STEPS + 1)]
        self.x, self.v, self.w = vectors(), vectors(), vectors()
        turns = np.tile(np.array([0, 0, 0, 1], np.float32), (n, 1))
        self.q = [wp.array(turns, dtype=wp.quat, requires_grad=True) for _ in range(STEPS + 1)]
        self.faster = wp.zeros(BALLS, dtype=float, requires_grad=True)
        self.sum = wp.zeros(1, dtype=float, requires_grad=True)

    def value(self):
        self.sum.zero_()
        wp.launch(begin, self.n, [self.faster, self.x[0], self.v[0]])
        for k in range(STEPS):
            now = [self.x[k], self.q[k], self.v[k], self.w[k]]
            after = [self.x[k + 1], self.q[k + 1], self.v[k + 1], self.w[k + 1]]
            wp.launch(step, self.n, now + after)
        wp.launch(far, self.n, [self.x[STEPS], self.sum])

    def gradient(self):
        tape = wp.Tape()
        with tape:
            self.value()
        tape.backward(self.sum)
        gradient = self.faster.grad.numpy().copy()
        tape.zero()
        return gradient


def median(run, runs=5):
    run()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return sorted(times)[runs // 2]


wp.config.quiet = True
wp.init()
with wp.ScopedDevice("cpu"):
    for count in [int(x) for x in sys.argv[1:]] or [1, 16, 256, 1024, 4096]:
        worlds = Worlds(count)
        forward, both = median(worlds.value), median(worlds.gradient)
        print(f"| {count} | {1e3 * forward:.1f} ms | {1e3 * both:.1f} ms |", flush=True)
