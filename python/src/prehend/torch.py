"""Rollouts as functions of PyTorch's autograd.

>>> import prehend, prehend.torch, torch
>>> world = prehend.World()
>>> ball = world.add_body("ball", prehend.Shape.ball(0.1))
>>> throw = world.rollout(0.1, 5, parameters=["gravity.z"])
>>> gravity = torch.tensor([-9.81], dtype=torch.float64, requires_grad=True)
>>> states = torch.from_numpy(world.neutral_states())
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
    return _Rollout.apply(function, end, states, parameters, controls)  # type: ignore[no-any-return, no-untyped-call]


def _array(tensor: torch.Tensor | None) -> Array | None:
    if tensor is None:
        return None
    return tensor.detach().to("cpu", torch.float64).numpy()


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
        inputs = [_array(states), _array(parameters), _array(controls)]
        needed = any(ctx.needs_input_grad)
        run = function(*inputs, end=end and not needed)
        ctx.function, ctx.inputs = function, inputs
        ctx.tensors = [(x.dtype, x.device) if x is not None else None for x in (states, parameters, controls)]
        if needed:
            ctx.run = run
            if end:
                # A copy: a view would keep the whole run.
                run = run[..., -1, :, :].copy()
        return torch.from_numpy(run).to(states.device, states.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, adjoints: torch.Tensor) -> tuple[torch.Tensor | None, ...]:  # type: ignore[override]
        own = adjoints.detach().to("cpu", torch.float64).contiguous().numpy()
        gradients = ctx.function.pullback(ctx.run, own, *ctx.inputs)
        wanted = zip(ctx.needs_input_grad[2:], ctx.tensors, gradients, strict=True)
        by_inputs = [
            torch.from_numpy(gradient).to(own[1], own[0]) if needed and own is not None else None
            for needed, own, gradient in wanted
        ]
        return (None, None, *by_inputs)
