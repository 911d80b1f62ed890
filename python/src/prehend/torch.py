"""Rollouts as functions of PyTorch's autograd.

>>> import prehend, prehend.torch, torch
>>> model = prehend.Model()
>>> ball = model.add_body("ball", prehend.Shape.ball(0.1))
>>> throw = model.rollout(0.1, 5, parameters=["gravity.z"])
>>> gravity = torch.tensor([-9.81], dtype=torch.float64, requires_grad=True)
>>> end = prehend.torch.rollout(throw, model.neutral_state(), gravity, end=True)
>>> end.bodies[ball, 2].backward()
>>> round(gravity.grad.item(), 6)
0.125
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ._prehend import Rollout
from .state import Run, State
from .torch_render import _array, perturb, pose_loss, render

__all__ = ["perturb", "pose_loss", "render", "rollout"]

Array = NDArray[np.float64]


def rollout(
    function: Rollout,
    state: State,
    parameters: torch.Tensor | dict[str, torch.Tensor] | None = None,
    controls: torch.Tensor | None = None,
    *,
    end: bool = False,
) -> Run:
    """The ``Run`` of a rollout in tensors, with steps + 1 in front, or its end alone; inputs with one more dimension in front are a batch.

    Computed in double precision on the processor, whatever the inputs are; the results are of the type and device of the first of the state's arrays.
    Derivatives are first ones.
    """
    names = tuple(parameters) if isinstance(parameters, dict) else None
    some = parameters.values() if isinstance(parameters, dict) else [parameters]
    given = [None if x is None else torch.as_tensor(x) for x in (*state, *some, controls)]
    return _run(_Rollout.apply(function, end, names, *given))  # type: ignore[no-untyped-call]


def _run(arrays: Sequence[Any]) -> Run:
    *state, bodies = arrays
    return Run(State(*state), bodies)


def _inputs(names: tuple[str, ...] | None, tensors: Sequence[torch.Tensor | None]) -> tuple[Any, ...]:
    """State, parameters and controls in arrays of NumPy."""
    arrays = [None if tensor is None else _array(tensor) for tensor in tensors]
    some = arrays[4:-1]
    parameters = some[0] if names is None else dict(zip(names, some, strict=True))
    return State(*arrays[:4]), parameters, arrays[-1]


def _like(array: Array, like: torch.Tensor | None) -> torch.Tensor:
    """As of the type and device of another tensor, in double precision if there is none or that has no fractions."""
    if like is None:
        return torch.from_numpy(array)
    dtype = like.dtype if like.is_floating_point() else torch.float64
    return torch.from_numpy(array).to(like.device, dtype)


class _Rollout(torch.autograd.Function):
    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any, function: Rollout, end: bool, names: tuple[str, ...] | None, *tensors: torch.Tensor | None
    ) -> tuple[torch.Tensor, ...]:
        needed = any(ctx.needs_input_grad)
        run = function(*_inputs(names, tensors), end=end and not needed)
        arrays: list[Array] = [*run.state, run.bodies]
        if needed:
            ctx.function, ctx.names = function, names
            ctx.set_materialize_grads(False)
            # Autograd watches for changes of what is saved; the run is a copy that nobody else has.
            ctx.save_for_backward(*tensors, *map(torch.from_numpy, arrays))
            last = [(..., -1, slice(None)), (..., -1, slice(None), slice(None))]
            arrays = [x[last[k > 2]].copy() if end else x.copy() for k, x in enumerate(arrays)]
        like = next((tensor for tensor in tensors if tensor is not None), None)
        return tuple(_like(array, like) for array in arrays)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: torch.Tensor | None) -> tuple[torch.Tensor | None, ...]:  # type: ignore[override]
        inputs, run = ctx.saved_tensors[:-5], ctx.saved_tensors[-5:]
        by_run = [None if adjoint is None else _array(adjoint) for adjoint in adjoints]
        gradient = ctx.function.pullback(
            _run([own.numpy() for own in run]), _run(by_run), *_inputs(ctx.names, inputs)
        )
        some = [gradient.parameters] if ctx.names is None else [gradient.parameters[name] for name in ctx.names]
        by_inputs = [
            _like(by, like) if needed else None
            for needed, like, by in zip(
                ctx.needs_input_grad[3:], inputs, [*gradient.state, *some, gradient.controls], strict=True
            )
        ]
        return (None, None, None, *by_inputs)
