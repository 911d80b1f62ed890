"""Rendering and the loss of a pose as functions of JAX, with derivatives, under ``jit`` and ``vmap``.

Turn on double precision first, ``jax.config.update("jax_enable_x64", True)``: otherwise poses, pictures and derivatives are rounded to single.

>>> import jax, jax.numpy as jnp, prehend, prehend.jax_render
>>> jax.config.update("jax_enable_x64", True)
>>> vertices, faces = [[-0.1, -0.1, 0], [0.1, -0.1, 0], [0, 0.1, 0]], [[0, 2, 1]]
>>> K = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
>>> render = prehend.jax_render.render(prehend.Renderer((vertices, faces), K, (48, 64)))
>>> base = jnp.eye(4).at[2, 3].set(0.5)
>>> area = jax.jit(lambda twist: render(prehend.jax_render.perturb(base, twist)).coverage.sum())
>>> bool(jax.grad(area)(jnp.zeros(6))[2] < 0)  # the farther, the smaller
True
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ._callback import callback
from ._prehend import PoseLoss, Renderer
from .render import Image, twist_generators

Array = Any
"""An array of JAX, or what becomes one."""

OWN = {"pose": 2, "vertices": 2, "colors": 2, "texels": 3, "light": 2, "background": 1, "intrinsics": 1}
"""What a picture is a function of, with the number of dimensions of each."""

OUTPUTS = (3, 2, 2, 3)
"""Dimensions of color, coverage, depth and normal."""


def render(renderer: Renderer) -> Callable[..., Image]:
    """The function from a pose, mesh to camera frame (4, 4), and by name ``vertices``, ``colors``, ``texels``, ``light``, ``background`` and ``intrinsics``, each in the
    place of the renderer's own, to the picture, with derivatives by all that is given.

    Shapes are those of ``prehend.Renderer.render``. For batches use ``jax.vmap``, whose pictures are rendered side by side. Of the pose's upper left block the
    nearest rotation counts, and derivatives by it are along rotations. Reverse mode only; the derivative renders once more.
    """

    def shapes(dtype: Any) -> Image:
        rows, columns = renderer.size
        sizes = ((rows, columns, 3), (rows, columns), (rows, columns), (rows, columns, 3))
        return Image(*(jax.ShapeDtypeStruct(size, dtype) for size in sizes))

    def draw(given: dict[str, Array]) -> Image:
        batch, flat = _flat([(x, OWN[name]) for name, x in given.items()])
        image = renderer.render(**dict(zip(given, flat, strict=True)))
        return Image(*(_unflat(x, batch, given["pose"].dtype) for x in image))

    def pull_back(given: dict[str, Array], adjoints: Image) -> dict[str, Array]:
        arrays = [(x, OWN[name]) for name, x in given.items()]
        batch, flat = _flat([*arrays, *zip(adjoints, OUTPUTS, strict=True)])
        inputs = dict(zip(given, flat[: len(given)], strict=True))
        if batch:
            # A batch even where the picture is the same for all adjoints.
            count = int(np.prod(batch))
            inputs["pose"] = np.broadcast_to(inputs["pose"], (count, 4, 4))
            flat[len(given) :] = [
                np.broadcast_to(x, (count, *x.shape[x.ndim - own :]))
                for x, own in zip(flat[len(given) :], OUTPUTS, strict=True)
            ]
        gradient = renderer.vjp(**inputs)[1](*flat[len(given) :], each=True)
        return {name: _unflat(getattr(gradient, name), batch, x.dtype) for name, x in given.items()}

    @jax.custom_vjp
    def run(given: dict[str, Array]) -> Image:
        return callback(draw, shapes(given["pose"].dtype), given, vmap_method="expand_dims")  # type: ignore[no-any-return]

    def forward(given: dict[str, Array]) -> tuple[Image, dict[str, Array]]:
        return run(given), given

    def backward(given: dict[str, Array], adjoints: Image) -> tuple[dict[str, Array]]:
        like = {name: jax.ShapeDtypeStruct(x.shape, x.dtype) for name, x in given.items()}
        return (callback(pull_back, like, given, adjoints, vmap_method="expand_dims"),)

    run.defvjp(forward, backward)

    def with_names(pose: Array, **others: Array) -> Image:
        unknown = [name for name in others if name not in OWN]
        if unknown:
            raise TypeError(f"a picture is no function of {unknown[0]!r}")
        given = {"pose": pose, **{name: x for name, x in others.items() if x is not None}}
        return run({name: _floating(x) for name, x in given.items()})

    return with_names


def pose_loss(loss: PoseLoss) -> Callable[..., Array]:
    """The function from an object's pose, mesh to camera frame (4, 4), to its loss, with derivatives by the pose.

    For batches use ``jax.vmap``, whose poses are compared side by side. A second argument is the light (3, 5), without derivatives. Pixels are computed in single
    precision. Reverse mode only.
    """

    def value(pose: Array, light: Array) -> NDArray[Any]:
        batch, flat = _flat([(pose, 2), (light, 2)])
        return _unflat(np.asarray(loss(flat[0], light=flat[1])), batch, pose.dtype)

    def both(pose: Array, light: Array) -> tuple[NDArray[Any], NDArray[Any]]:
        batch, flat = _flat([(pose, 2), (light, 2)])
        at = loss.linearize(flat[0], light=flat[1])
        return _unflat(np.asarray(at.value), batch, pose.dtype), _unflat(at.pose, batch, pose.dtype)

    @jax.custom_vjp
    def run(pose: Array, light: Array) -> Array:
        number = jax.ShapeDtypeStruct((), pose.dtype)
        return callback(value, number, pose, light, vmap_method="expand_dims")

    def forward(pose: Array, light: Array) -> tuple[Array, tuple[Array, Array]]:
        shapes = jax.ShapeDtypeStruct((), pose.dtype), jax.ShapeDtypeStruct((4, 4), pose.dtype)
        total, by_pose = callback(both, shapes, pose, light, vmap_method="expand_dims")
        return total, (by_pose, jnp.zeros_like(light))

    def backward(kept: tuple[Array, Array], adjoint: Array) -> tuple[Array, Array]:
        by_pose, by_light = kept
        return adjoint * by_pose, by_light

    run.defvjp(forward, backward)

    def with_light(pose: Array, light: Array = None) -> Array:
        light = loss.light if light is None else light
        return run(_floating(pose), jax.lax.stop_gradient(_floating(light)))

    return with_light


def perturb(pose: Array, twist: Array, center: Array = None) -> Array:
    """A pose (4, 4) moved by a twist (6,) from the left: translation [m], then rotation [rad] about ``center`` (3,), by default the origin.

    With derivatives by all three. Optimize the twist from zero, about the object's center, and every pose is a rotation and a translation.
    """
    twist = _floating(twist)
    generators = jnp.asarray(twist_generators(), twist.dtype)
    motion = jax.scipy.linalg.expm(jnp.einsum("k,kij->ij", twist, generators))
    if center is not None:
        center = jnp.array(center)
        motion = motion.at[:3, 3].add(center - motion[:3, :3] @ center)
    return motion @ jnp.array(pose)


def _floating(x: Array) -> Array:
    """As a copy: under vmap, arrays of NumPy are no constants that JAX takes."""
    return jnp.array(x, jnp.result_type(float, x))


def _flat(arrays: list[tuple[Array, int]]) -> tuple[tuple[int, ...], list[NDArray[np.float64]]]:
    """The shape of the batch, and arrays in double precision with one dimension for it, or none if they are the same for all of it.

    Each comes with the number of its own dimensions; those in front are the batch's, or ones.
    """
    plain = [(np.asarray(x, dtype=np.float64), own) for x, own in arrays]
    batch = np.broadcast_shapes(*(x.shape[: x.ndim - own] for x, own in plain))
    flat = []
    for x, own in plain:
        front, shape = x.shape[: x.ndim - own], x.shape[x.ndim - own :]
        if all(n == 1 for n in front) and batch:
            flat.append(x.reshape(shape))
        else:
            flat.append(np.broadcast_to(x, (*batch, *shape)).reshape((-1, *shape) if batch else shape))
    if batch and all(x.ndim == own for x, (_, own) in zip(flat, plain, strict=True)):
        # A batch of ones.
        flat[0] = flat[0][None]
    return batch, flat


def _unflat(x: NDArray[Any], batch: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """In the shape of the batch."""
    return x.reshape(*batch, *x.shape[1:]).astype(dtype) if batch else x.astype(dtype)
