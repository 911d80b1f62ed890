"""What rendering gives back, for NumPy, PyTorch and JAX alike."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = Any
"""An array of NumPy or JAX, or a tensor of PyTorch. Of a batch of B pictures with B in front of its shape."""


class Image(NamedTuple):
    """The picture of a mesh, H rows and W columns from the top-left."""

    color: Array
    """(H, W, 3): over the background; not clamped."""
    coverage: Array
    """(H, W): share of the pixel that the mesh covers, 0..1; its silhouette."""
    depth: Array
    """(H, W): z of the surface at the pixel's center [m], 0 where there is none."""
    normal: Array
    """(H, W, 3): unit normal there, on the side that is seen, camera frame; zero where there is none."""


class RenderGradient(NamedTuple):
    """Derivatives of a number by what makes a picture, each in the shape of its input."""

    pose: Array
    """(4, 4): by the entries of the matrix, of whose upper left block the nearest rotation counts."""
    twist: Array
    """(6,): by a left twist of the pose, translation [m] then rotation [rad], about the mesh's center, along the axes of the camera frame."""
    vertices: Array | None
    """(n, 3), mesh frame; None unless vertices were given."""
    colors: Array | None
    """(n, 3); None unless colors were given."""
    texels: Array | None
    """(H, W, 3), of the texture; None unless texels were given."""
    light: Array
    """(3, 5)."""
    background: Array
    """(3,)."""
    intrinsics: Array
    """(4,): by fx, fy, cx and cy [1/px]."""


class LinearizedLoss(NamedTuple):
    """The loss of a pose with its derivatives."""

    value: Any
    """The loss."""
    gradient: Array
    """(6,): by a left twist of the pose, translation [m] then rotation [rad], about `center`, along the axes of the camera frame."""
    hessian: Array
    """(6, 6): the Gauss–Newton matrix by the same twist."""
    pose: Array
    """(4, 4): the gradient by the entries of the matrix, of whose upper left block the nearest rotation counts."""
    center: Array
    """(3,): center of the object, camera frame [m]."""


def twist_generators() -> NDArray[np.float64]:
    """The matrices (6, 4, 4) whose sum, weighted by the numbers of a twist, has as its exponential the motion of the twist."""
    generators = np.zeros((6, 4, 4))
    for k in range(3):
        generators[k, k, 3] = 1.0
        i, j = (k + 1) % 3, (k + 2) % 3
        generators[3 + k, j, i], generators[3 + k, i, j] = 1.0, -1.0
    return generators
