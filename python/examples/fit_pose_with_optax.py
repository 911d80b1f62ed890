"""Fits the pose of a vase with a bump to a picture with optax's Adam on the derivatives of the renderer; then with Gauss–Newton on the loss of the pose.

``python fit_pose_with_optax.py`` needs jax and optax, and takes some seconds.
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
import optax

import prehend
import prehend.jax_render

jax.config.update("jax_enable_x64", True)  # or poses are rounded to single precision


def lathe(profile: list[tuple[float, float]], around: int = 32) -> tuple[np.ndarray, np.ndarray]:
    """A closed surface of revolution about y through points (radius, y) [m], with a bump that tells how it is turned."""
    angles = 2 * np.pi * np.arange(around) / around
    bump = 1 + 0.35 * np.exp(-((angles - np.pi) ** 2) / 0.1)
    rings = [np.stack([r * bump * np.cos(angles), 0 * angles + y, r * bump * np.sin(angles)], 1) for r, y in profile]
    ends = [[[0, profile[0][1], 0]], [[0, profile[-1][1], 0]]]
    vertices = np.concatenate([*rings, *ends])
    faces, count = [], around * len(profile)
    for i in range(around):
        j = (i + 1) % around
        for ring in range(0, count - around, around):
            faces += [[ring + i, ring + around + i, ring + j], [ring + j, ring + around + i, ring + around + j]]
        faces += [[count, i, j], [count + 1, count - around + j, count - around + i]]
    return vertices, np.array(faces)


def error(pose: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Distance [mm] and angle [degrees] between poses."""
    cosine = (np.trace(pose[:3, :3].T @ truth[:3, :3]) - 1) / 2
    return 1e3 * float(np.linalg.norm(pose[:3, 3] - truth[:3, 3])), float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def say(when: str, pose: np.ndarray, truth: np.ndarray, seconds: float = 0.0) -> None:
    distance, angle = error(pose, truth)
    print(f"{when:<32} {distance:8.3f} mm {angle:8.3f} degrees   {seconds:6.2f} s")


vertices, faces = lathe([(0.03, -0.05), (0.035, -0.02), (0.03, 0.01), (0.038, 0.05)])
stripes = 0.5 + 0.4 * np.sin(90 * vertices @ [[1.0, 0.5, 0.2], [0.3, 1.0, -0.4], [0.2, -0.5, 1.0]])
K = [[150.0, 0.0, 47.5], [0.0, 150.0, 35.5], [0.0, 0.0, 1.0]]
light = prehend.headlight(0.4, 0.6)
renderer = prehend.Renderer((vertices, faces), K, (72, 96), colors=stripes, light=light)

base = np.eye(4)
base[2, 3] = 0.35
truth = prehend.perturb(base, [0, 0, 0, 0.3, -0.8, 0.2], base[:3, 3])
photograph = renderer.render(truth)
# What a tracker may believe: 18 mm and 17 degrees off.
start = prehend.perturb(truth, [0.01, -0.008, 0.013, 0.2, -0.15, 0.17], truth[:3, 3])
say("before", start, truth)

# By Adam on a twist about the center; a radian counts as 5 cm.
render = prehend.jax_render.render(renderer)
center = start[:3, :3] @ renderer.center + start[:3, 3]
units = jnp.array([1, 1, 1, 20, 20, 20])


def posed(twist: jax.Array) -> jax.Array:
    return prehend.jax_render.perturb(start, units * twist, center)


def difference(twist: jax.Array) -> jax.Array:
    image = render(posed(twist))
    color, coverage = image.color - photograph.color, image.coverage - photograph.coverage
    return (color**2).sum() + (coverage**2).sum()


optimizer = optax.adam(optax.exponential_decay(1e-3, 50, 0.5))


@jax.jit
def step(twist: jax.Array, state: optax.OptState) -> tuple[jax.Array, optax.OptState]:
    updates, state = optimizer.update(jax.grad(difference)(twist), state)
    return optax.apply_updates(twist, updates), state


began = time.perf_counter()
twist = jnp.zeros(6)
state = optimizer.init(twist)
for _ in range(300):
    twist, state = step(twist, state)
by_adam = np.asarray(posed(twist))
say("Adam, 300 steps", by_adam, truth, time.perf_counter() - began)

# The same by Gauss–Newton (damped, as by Levenberg and Marquardt), which knows the curvature.
began = time.perf_counter()
loss = prehend.PoseLoss(
    (vertices, faces), K, photograph.color, photograph.coverage, colors=stripes, light=light, mask_weight=1.0
)
pose, damping, steps = start, 1e-2, 0
at = loss.linearize(pose)
while damping < 1e6 and at.value > 1e-9 and steps < 50:
    steps += 1
    damped = at.hessian + damping * np.diag(np.diag(at.hessian))
    moved = prehend.perturb(pose, -np.linalg.solve(damped, at.gradient), at.center)
    if loss(moved) < at.value:
        pose, damping = moved, damping / 5
        at = loss.linearize(pose)
    else:
        damping *= 4
say(f"Gauss-Newton, {steps} steps", pose, truth, time.perf_counter() - began)

for found in (by_adam, pose):
    distance, angle = error(found, truth)
    assert distance < 0.1 and angle < 0.2, "the pose was not found"
