"""Functions of NumPy as operations of JAX.

On the processor through XLA's foreign-function interface: ``jax.pure_callback`` hands over arrays of JAX, and copies of large ones wait for the thread
that waits for the function (jax-ml/jax issues 24255, 25861): on one core it hangs from 100 kB on.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import POINTER, c_char_p, c_int, c_int64, c_size_t, c_uint32, c_void_p
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

TARGET = "prehend_callback"

TYPES = {1: np.bool_, 4: np.int32, 5: np.int64, 11: np.float32, 12: np.float64}
"""Types of numbers by their code in XLA."""

METADATA = 1
"""Kind of the extension that asks for a handler's version."""

INTERNAL = 13
"""Code of an error of a function."""


class _Extension(ctypes.Structure):
    pass


_Extension._fields_ = [("struct_size", c_size_t), ("kind", c_int), ("next", POINTER(_Extension))]


class _Version(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("extension", c_void_p), ("major", c_int), ("minor", c_int)]


class _Metadata(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("version", _Version), ("traits", c_uint32)]


class _MetadataExtension(ctypes.Structure):
    _fields_ = [("base", _Extension), ("metadata", POINTER(_Metadata))]


class _Error(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("extension", c_void_p), ("message", c_char_p), ("code", c_int)]


class _Api(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_size_t),
        ("extension", c_void_p),
        ("version", _Version),
        ("internal", c_void_p),
        ("create_error", ctypes.CFUNCTYPE(c_void_p, POINTER(_Error))),
    ]


class _Buffer(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_size_t),
        ("extension", c_void_p),
        ("dtype", c_int),
        ("data", c_void_p),
        ("rank", c_int64),
        ("dims", POINTER(c_int64)),
    ]


class _Buffers(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_size_t),
        ("extension", c_void_p),
        ("size", c_int64),
        ("types", POINTER(c_int)),
        ("buffers", POINTER(POINTER(_Buffer))),
    ]


class _Scalar(ctypes.Structure):
    _fields_ = [("dtype", c_int), ("value", POINTER(c_int64))]


class _Attributes(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_size_t),
        ("extension", c_void_p),
        ("size", c_int64),
        ("types", POINTER(c_int)),
        ("names", c_void_p),
        ("values", POINTER(POINTER(_Scalar))),
    ]


class _Call(ctypes.Structure):
    """XLA's ``XLA_FFI_CallFrame``, as far as all versions have it."""

    _fields_ = [
        ("struct_size", c_size_t),
        ("extension", POINTER(_Extension)),
        ("api", POINTER(_Api)),
        ("context", c_void_p),
        ("stage", c_int),
        ("arguments", _Buffers),
        ("results", _Buffers),
        ("attributes", _Attributes),
    ]


_functions: list[Callable[..., Any]] = []
"""Functions by number. Compiled programs call them as long as the process lives."""

_numbers: dict[tuple[Callable[..., Any], Any], int] = {}


def callback(function: Callable[..., Any], shapes: Any, *args: Any, vmap_method: str) -> Any:
    """``jax.pure_callback`` of a function that is kept for the life of the process."""
    if jax.default_backend() != "cpu":
        return jax.pure_callback(function, shapes, *args, vmap_method=vmap_method)
    arguments, tree = jax.tree.flatten(args)
    results, structure = jax.tree.flatten(shapes)
    call = jax.ffi.ffi_call(TARGET, results, vmap_method=vmap_method)
    found = call(*arguments, function=np.int64(_number(function, tree)))
    return jax.tree.unflatten(structure, found)


def _number(function: Callable[..., Any], tree: Any) -> int:
    if not _numbers:
        jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(_handle), platform="cpu")
    if (function, tree) not in _numbers:
        _functions.append(lambda arrays: jax.tree.leaves(function(*jax.tree.unflatten(tree, arrays))))
        _numbers[function, tree] = len(_functions) - 1
    return _numbers[function, tree]


@ctypes.CFUNCTYPE(c_void_p, POINTER(_Call))
def _handle(frame: Any) -> int | None:
    call = frame.contents
    try:
        if call.extension and call.extension.contents.kind == METADATA:
            # Nothing here is newer than the first version.
            asked = ctypes.cast(call.extension, POINTER(_MetadataExtension)).contents.metadata.contents
            own = call.api.contents.version
            asked.version.major, asked.version.minor = own.major, own.minor
            return None
        number = call.attributes.values[0].contents.value[0]
        found = _functions[number](_arrays(call.arguments))
        for array, result in zip(_arrays(call.results), found, strict=True):
            array[...] = result
    except BaseException as error:  # noqa: BLE001: whatever it is, JAX raises it.
        said = _Error(ctypes.sizeof(_Error), None, f"{type(error).__name__}: {error}".encode(), INTERNAL)
        return call.api.contents.create_error(ctypes.byref(said))  # type: ignore[no-any-return]
    return None


def _arrays(buffers: Any) -> list[NDArray[Any]]:
    """Memory of XLA, valid during the call."""
    return [_array(buffers.buffers[k].contents) for k in range(buffers.size)]


def _array(buffer: Any) -> NDArray[Any]:
    shape, dtype = tuple(buffer.dims[: buffer.rank]), np.dtype(TYPES[buffer.dtype])
    size = math.prod(shape) * dtype.itemsize
    if not size:
        return np.empty(shape, dtype)
    memory = (ctypes.c_char * size).from_address(buffer.data)
    return np.frombuffer(memory, dtype).reshape(shape)
