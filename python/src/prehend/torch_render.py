"""Rendering and the loss of a pose as functions of PyTorch's autograd.

>>> import prehend, prehend.torch_render, torch
>>> vertices, faces = [[-0.1, -0.1, 0], [0.1, -0.1, 0], [0, 0.1, 0]], [[0, 2, 1]]
>>> K = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
>>> renderer = prehend.Renderer((vertices, faces), K, (48, 64))
>>> base = torch.eye(4, dtype=torch.float64)
>>> base[2, 3] = 0.5
>>> twist = torch.zeros(6, dtype=torch.float64, requires_grad=True)
>>> image = prehend.torch_render.render(renderer, prehend.torch_render.perturb(base, twist))
>>> image.coverage.sum().backward()  # the farther, the smaller
>>> bool(twist.grad[2] < 0)
True
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from ._prehend import PoseLoss, Renderer
from .render import Image, twist_generators

Tensor = torch.Tensor

INPUTS = ("pose", "vertices", "colors", "texels", "light", "background", "intrinsics")
"""What a picture is a function of."""


def render(
    renderer: Renderer,
    pose: Tensor,
    *,
    vertices: Tensor | None = None,
    colors: Tensor | None = None,
    texels: Tensor | None = None,
    light: Tensor | None = None,
    background: Tensor | None = None,
    intrinsics: Tensor | None = None,
) -> Image:
    """The picture of a mesh at a pose, mesh to camera frame (4, 4), as tensors with derivatives by all that is given.

    Shapes and batches are those of ``prehend.Renderer.render``. Computed in double precision on the processor, whatever the inputs are; the picture
    is of the pose's type and device. Of the pose's upper left block the nearest rotation counts, and derivatives by it are along rotations. Derivatives are first ones.
    """
    given = (pose, vertices, colors, texels, light, background, intrinsics)
    tensors = [None if x is None else torch.as_tensor(x) for x in given]
    return Image(*_Render.apply(renderer, *tensors))  # type: ignore[no-untyped-call]


def pose_loss(loss: PoseLoss, pose: Tensor, *, light: ArrayLike | None = None) -> Tensor:
    """The loss of an object's pose, mesh to camera frame: a number for a matrix (4, 4), B of them for a batch (B, 4, 4), with derivatives by the pose.

    The light is an array (3, 5), without derivatives. Pixels are computed in single precision.
    """
    return _PoseLoss.apply(loss, light, torch.as_tensor(pose))  # type: ignore[no-any-return, no-untyped-call]


def perturb(pose: Tensor, twist: Tensor, center: Tensor | None = None) -> Tensor:
    """A pose (4, 4) moved by a twist (6,) from the left: translation [m], then rotation [rad] about ``center`` (3,), by default the origin.

    With derivatives by all three; any number of dimensions may be in front of all. Optimize the twist from zero, about the object's center, and every pose is
    a rotation and a translation.
    """
    generators = torch.as_tensor(twist_generators(), dtype=twist.dtype, device=twist.device)
    motion = torch.linalg.matrix_exp(torch.einsum("...k,kij->...ij", twist, generators))
    if center is None:
        return motion @ pose
    rotation = motion[..., :3, :3]
    shift = motion[..., :3, 3] + center - (rotation @ center[..., None])[..., 0]
    about = torch.cat([torch.cat([rotation, shift[..., None]], -1), motion[..., 3:, :]], -2)
    return about @ pose


def _array(tensor: Tensor) -> NDArray[np.float64]:
    return tensor.detach().to("cpu", torch.float64).numpy()


def _like(array: ArrayLike, like: Tensor) -> Tensor:
    """As of the type and device of another tensor, in double precision if that has no fractions."""
    dtype = like.dtype if like.is_floating_point() else torch.float64
    return torch.as_tensor(array).to(like.device, dtype)


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, renderer: Renderer, *tensors: Tensor | None) -> tuple[Tensor, ...]:  # type: ignore[override]
        pose = tensors[0]
        assert pose is not None
        given: dict[str, Any] = {name: _array(x) for name, x in zip(INPUTS, tensors, strict=True) if x is not None}
        if any(ctx.needs_input_grad):
            image, ctx.pullback = renderer.vjp(**given)
        else:
            image = renderer.render(**given)
        ctx.set_materialize_grads(False)
        ctx.like = [(x.dtype, x.device) if x is not None else None for x in tensors]
        return tuple(_like(x, pose) for x in image)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: Tensor | None) -> tuple[Tensor | None, ...]:  # type: ignore[override]
        gradient = ctx.pullback(*(None if x is None else _array(x) for x in adjoints))
        by_inputs: list[Tensor | None] = []
        for name, needed, like in zip(INPUTS, ctx.needs_input_grad[1:], ctx.like, strict=True):
            own = getattr(gradient, name) if needed else None
            by_inputs.append(torch.from_numpy(own).to(like[1], like[0]) if own is not None else None)
        return (None, *by_inputs)


class _PoseLoss(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, loss: PoseLoss, light: ArrayLike | None, pose: Tensor) -> Tensor:  # type: ignore[override]
        if ctx.needs_input_grad[2]:
            at = loss.linearize(_array(pose), light=light)
            ctx.by_pose = _like(at.pose, pose)
            value = at.value
        else:
            value = loss(_array(pose), light=light)
        return _like(value, pose)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, adjoint: Tensor) -> tuple[Tensor | None, ...]:  # type: ignore[override]
        return None, None, adjoint[..., None, None] * ctx.by_pose
