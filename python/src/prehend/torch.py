"""Rollouts as functions of PyTorch's autograd.

>>> import prehend, prehend.torch, torch
>>> model = prehend.Model()
>>> ball = model.add_body("ball", prehend.Shape.ball(0.1))
>>> throw = model.rollout(0.1, 5, parameters=["gravity.z"])
>>> gravity = torch.tensor([-9.81], dtype=torch.float64, requires_grad=True)
>>> states = torch.from_numpy(model.neutral_states())
>>> end = prehend.torch.rollout(throw, states, gravity, end=True)
>>> end[ball, 2].backward()
>>> round(gravity.grad.item(), 6)
0.125
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ._prehend import Rollout
from .torch_render import _array, perturb, pose_loss, render

__all__ = ["perturb", "pose_loss", "render", "rollout"]

Array = NDArray[np.float64]


def rollout(
    function: Rollout,
    states: torch.Tensor,
    parameters: torch.Tensor | None = None,
    controls: torch.Tensor | None = None,
    *,
    end: bool = False,
) -> torch.Tensor:
    """The states of a rollout, of shape (steps + 1, rows, 13), or those at its end, (rows, 13); inputs with one more dimension in front are a batch.

    Computed in double precision on the processor, whatever the inputs are; the result is of their type and device. Derivatives are first ones.
    """
    given = [None if x is None else torch.as_tensor(x) for x in (states, parameters, controls)]
    return _Rollout.apply(function, end, *given)  # type: ignore[no-any-return, no-untyped-call]


def _given(tensor: torch.Tensor | None) -> Array | None:
    return None if tensor is None else _array(tensor)


def _like(array: Array, like: torch.Tensor) -> torch.Tensor:
    """As of the type and device of another tensor, in double precision if that has no fractions."""
    dtype = like.dtype if like.is_floating_point() else torch.float64
    return torch.from_numpy(array).to(like.device, dtype)


class _Rollout(torch.autograd.Function):
    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any,
        function: Rollout,
        end: bool,
        states: torch.Tensor,
        parameters: torch.Tensor | None,
        controls: torch.Tensor | None,
    ) -> torch.Tensor:
        needed = any(ctx.needs_input_grad)
        others = map(_given, (parameters, controls))
        run = function(_array(states), *others, end=end and not needed)
        if not needed:
            return _like(run, states)
        ctx.function = function
        # Autograd watches for changes of what is saved; the run is a copy that nobody else has.
        ctx.save_for_backward(states, parameters, controls, torch.from_numpy(run))
        return _like((run[..., -1, :, :] if end else run).copy(), states)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, adjoints: torch.Tensor) -> tuple[torch.Tensor | None, ...]:  # type: ignore[override]
        *inputs, run = ctx.saved_tensors
        gradients = ctx.function.pullback(run.numpy(), _array(adjoints), *map(_given, inputs))
        by_inputs = [
            _like(gradient, like) if needed else None
            for needed, like, gradient in zip(
                ctx.needs_input_grad[2:], inputs, gradients, strict=True
            )
        ]
        return (None, None, *by_inputs)
