"""Rollouts as functions of JAX, with derivatives, under ``jit`` and ``vmap``.

Turn on double precision first, ``jax.config.update("jax_enable_x64", True)``: otherwise states and derivatives are rounded to single.

>>> import jax, prehend, prehend.jax
>>> jax.config.update("jax_enable_x64", True)
>>> model = prehend.Model()
>>> ball = model.add_body("ball", prehend.Shape.ball(0.1))
>>> throw = prehend.jax.rollout(model.rollout(0.1, 5, parameters=["gravity.z"]), end=True)
>>> start = model.neutral_state()
>>> height = jax.jit(lambda gravity: throw(start, {"gravity.z": gravity}).bodies[ball, 2])
>>> round(float(jax.grad(height)(-9.81)), 6)
0.125
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ._callback import callback
from ._prehend import Rollout
from .jax_render import perturb, pose_loss, render
from .state import Gradient, Run, State

__all__ = ["perturb", "pose_loss", "render", "rollout"]

Array = Any
"""An array of JAX, or what becomes one."""

RolloutOfJax = Callable[..., Run]


def rollout(function: Rollout, *, end: bool = False) -> RolloutOfJax:
    """The function (state, parameters, controls) → ``Run`` of states and bodies at 0, dt, …, steps·dt, with steps + 1 in front of its arrays, or at the end alone.

    Parameters are an array of all or a dict of some by name. Those and controls that are left out are those of the model and none. For batches
    use ``jax.vmap``, whose worlds are simulated side by side.
    Derivatives are first ones, in reverse mode: ``jax.grad``, ``vjp`` and ``jacrev``, not ``jacfwd`` or ``hessian``.
    """

    rest = function.neutral_state

    def at_end(*inputs: Any) -> Run:
        return _evaluate(function, inputs, end=True)

    def at_all(*inputs: Any) -> Run:
        return _evaluate(function, inputs, end=False)

    def pull_back(*arrays: Any) -> tuple[Any, ...]:
        return _pull_back(function, arrays)

    def shapes(state: State, *times: int) -> Run:
        dtype = jnp.result_type(*state)
        own = [*(x.shape for x in rest), (len(function.bodies), 13)]
        arrays = [jax.ShapeDtypeStruct((*times, *shape), dtype) for shape in own]
        return Run(State(*arrays[:-1]), arrays[-1])

    @jax.custom_vjp
    def run(*inputs: Any) -> Run:
        if not end:
            return whole_of(*inputs)
        return callback(at_end, shapes(inputs[0]), *inputs, vmap_method="broadcast_all")  # type: ignore[no-any-return]

    def whole_of(*inputs: Any) -> Run:
        result = shapes(inputs[0], function.steps + 1)
        return callback(at_all, result, *inputs, vmap_method="broadcast_all")  # type: ignore[no-any-return]

    def forward(*inputs: Any) -> tuple[Run, Any]:
        whole = whole_of(*inputs)
        return jax.tree.map(lambda x: x[-1], whole) if end else whole, (whole, *inputs)

    def backward(kept: Any, adjoints: Run) -> tuple[Any, ...]:
        whole, *inputs = kept
        like = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), tuple(inputs))
        return callback(pull_back, like, whole, adjoints, *inputs, vmap_method="broadcast_all")  # type: ignore[no-any-return]

    run.defvjp(forward, backward)

    def with_defaults(state: State, parameters: Any = None, controls: Array = None) -> Run:
        state = State(*(x if own is None else own for own, x in zip(state, rest, strict=True)))
        if parameters is None:
            parameters = function.values
        if controls is None:
            controls = np.zeros((function.steps, len(function.controls)))
            if controls.size:
                raise ValueError(f"controls are missing: {', '.join(function.controls)}")
        if isinstance(parameters, dict):
            parameters = {name: _array(own) for name, own in parameters.items()}
        else:
            parameters = _array(parameters)
        return run(State(*map(_array, state)), parameters, _array(controls))

    return with_defaults


def _array(x: Array) -> Array:
    """As a copy: under vmap, arrays of NumPy are no constants that JAX takes."""
    copied = jnp.array(x)
    return copied.astype(jnp.result_type(float, copied))


def _evaluate(function: Rollout, inputs: Any, *, end: bool) -> Run:
    batch, inputs = _flat(inputs, 1)
    run = function(*inputs, end=end)
    return jax.tree.map(lambda x: x.reshape(*batch, *x.shape[bool(batch) :]), run)  # type: ignore[no-any-return]


def _pull_back(function: Rollout, arrays: Any) -> tuple[Any, ...]:
    _, (run, adjoints, *inputs) = _flat(arrays, 2)
    gradient: Gradient = function.pullback(run, adjoints, *inputs)
    like = tuple(arrays[2:])
    return jax.tree.map(lambda by, x: by.reshape(x.shape).astype(x.dtype), tuple(gradient), like)  # type: ignore[no-any-return]


def _flat(arrays: Any, own: int) -> tuple[tuple[int, ...], Any]:
    """The shape of the batch, and arrays in double precision with one dimension for it, if there is one; the first has ``own`` others."""
    leaves, tree = jax.tree.flatten(arrays)
    plain = [np.asarray(array, dtype=np.float64) for array in leaves]
    batch = plain[0].shape[: plain[0].ndim - own]
    if batch:
        worlds = math.prod(batch)
        plain = [array.reshape(worlds, *array.shape[len(batch) :]) for array in plain]
    return batch, jax.tree.unflatten(tree, plain)
