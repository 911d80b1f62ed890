"""Rollouts as functions of JAX, with derivatives, under ``jit`` and ``vmap``.

Turn on double precision first, ``jax.config.update("jax_enable_x64", True)``: otherwise states and derivatives are rounded to single.

>>> import jax, prehend, prehend.jax
>>> jax.config.update("jax_enable_x64", True)
>>> model = prehend.Model()
>>> ball = model.add_body("ball", prehend.Shape.ball(0.1))
>>> throw = prehend.jax.rollout(model.rollout(0.1, 5, parameters=["gravity.z"]), end=True)
>>> start = model.neutral_states()
>>> height = jax.jit(lambda gravity: throw(start, gravity)[ball, 2])
>>> round(float(jax.grad(height)(jax.numpy.array([-9.81]))[0]), 6)
0.125
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ._callback import callback
from ._prehend import Rollout
from .jax_render import perturb, pose_loss, render

__all__ = ["perturb", "pose_loss", "render", "rollout"]

Array = Any
"""An array of JAX, or what becomes one."""

RolloutOfJax = Callable[..., Array]

STATE = 13
"""Numbers of a row of states."""


def rollout(function: Rollout, *, end: bool = False) -> RolloutOfJax:
    """The function (states, parameters, controls) → states at 0, dt, …, steps·dt, of shape (steps + 1, rows, 13), or at the end alone, (rows, 13).

    Parameters and controls that are left out are those of the model and none. For batches use ``jax.vmap``, whose worlds are simulated side by side.
    Derivatives are first ones, in reverse mode: ``jax.grad``, ``vjp`` and ``jacrev``, not ``jacfwd`` or ``hessian``.
    """

    own = (function.rows, STATE)

    def at_end(*arrays: Array) -> NDArray[Any]:
        batch, inputs = _flat(arrays, (2, 1, 2))
        return function(*inputs, end=True).reshape(*batch, *own)

    def at_all(*arrays: Array) -> NDArray[Any]:
        batch, inputs = _flat(arrays, (2, 1, 2))
        return function(*inputs).reshape(*batch, function.steps + 1, *own)

    def pull_back(*arrays: Array) -> list[NDArray[Any]]:
        return _pull_back(function, arrays)

    @jax.custom_vjp
    def run(states: Array, parameters: Array, controls: Array) -> Array:
        if not end:
            return whole_of(states, parameters, controls)
        result = jax.ShapeDtypeStruct(own, states.dtype)
        return callback(at_end, result, states, parameters, controls, vmap_method="broadcast_all")

    def whole_of(states: Array, parameters: Array, controls: Array) -> Array:
        result = jax.ShapeDtypeStruct((function.steps + 1, *own), states.dtype)
        return callback(at_all, result, states, parameters, controls, vmap_method="broadcast_all")

    def forward(states: Array, parameters: Array, controls: Array) -> tuple[Array, Any]:
        whole = whole_of(states, parameters, controls)
        return whole[-1] if end else whole, (whole, states, parameters, controls)

    def backward(kept: Any, adjoints: Array) -> tuple[Array, ...]:
        whole, *inputs = kept
        shapes = [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in inputs]
        gradients = callback(
            pull_back, shapes, whole, adjoints, *inputs, vmap_method="broadcast_all"
        )
        return tuple(gradients)

    run.defvjp(forward, backward)

    def with_defaults(states: Array, parameters: Array = None, controls: Array = None) -> Array:
        if parameters is None:
            parameters = function.values
        if controls is None:
            controls = np.zeros((function.steps, len(function.controls)))
            if controls.size:
                raise ValueError(f"controls are missing: {', '.join(function.controls)}")
        # As copies: under vmap, arrays of NumPy are no constants that JAX takes.
        given = [jnp.array(x) for x in (states, parameters, controls)]
        return run(*(x.astype(jnp.result_type(float, x)) for x in given))

    return with_defaults


def _pull_back(function: Rollout, arrays: Any) -> list[NDArray[Any]]:
    whole, adjoints, *given = arrays
    own = adjoints.ndim - (whole.ndim - 3)
    _, (run, flat, *inputs) = _flat(arrays, (3, own, 2, 1, 2))
    gradients = function.pullback(run, flat, *inputs)
    return [
        gradient.reshape(x.shape).astype(x.dtype)
        for gradient, x in zip(gradients, given, strict=True)
    ]


def _flat(arrays: Any, dimensions: tuple[int, ...]) -> tuple[tuple[int, ...], list[NDArray[np.float64]]]:
    """The shape of the batch, and arrays in double precision with one dimension for it, if there is one."""
    plain = [np.asarray(array, dtype=np.float64) for array in arrays]
    batch = plain[0].shape[: plain[0].ndim - dimensions[0]]
    if not batch:
        return batch, plain
    worlds = math.prod(batch)
    return batch, [
        array.reshape(worlds, *array.shape[array.ndim - own :])
        for array, own in zip(plain, dimensions, strict=True)
    ]
