"""States of a model, runs of rollouts and gradients: named tuples of arrays, and so pytrees of JAX.

A batch of worlds has one more dimension in front of an array; arrays without it are the same for all worlds.
"""

from __future__ import annotations

from typing import Any, NamedTuple

Array = Any
"""An array of NumPy, JAX or PyTorch, or None: that of ``Model.neutral_state`` in a state, zero in derivatives."""


class State(NamedTuple):
    """All that a model's motion goes on from. An array that is None is that of ``Model.neutral_state``."""

    q: Array = None
    """Positions (nq): of free bodies (center of mass x, y, z [m], quaternion x, y, z, w), then of joints, in the order in which they were added."""
    v: Array = None
    """Velocities (nv): of free bodies (center of mass [m/s], then angular [rad/s], world's axes), then of joints."""
    act: Array = None
    """Deflections of contacts with bristles (na), six each: [m] and [rad], along the axes of the field."""
    fixed: Array = None
    """Bodies that no force moves (nf, 13): fixed ones, then mocap bodies; columns as those of ``Run.bodies``."""


class Run(NamedTuple):
    """States of a model one after the other, or one alone; or derivatives by them."""

    state: State = State()
    bodies: Array = None
    """Positions [m], quaternions (x, y, z, w), velocities [m/s] and angular velocities [rad/s] of all bodies (bodies, 13), world frame: of the center
    of mass, of links and fixed bodies of the origin of their frame."""


class PointContacts(NamedTuple):
    """Points at which bodies touch, arrays of NumPy."""

    bodies: Array
    """Numbers of the body with the samples and of that with the field (n, 2)."""
    position: Array
    """Positions on the surface of the samples [m] (n, 3), world frame."""
    normal: Array
    """Unit normals out of the body with the field (n, 3), world frame."""
    gap: Array
    """Gaps [m] (n), negative in penetration."""
    force: Array
    """Forces on the body with the samples [N] (n, 3), world frame."""


class Gradient(NamedTuple):
    """Derivatives by the inputs of a rollout, each in the shape of its input."""

    state: State
    parameters: Array
    controls: Array
