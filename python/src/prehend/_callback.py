"""Functions of NumPy as operations of JAX.

On the processor through XLA's foreign-function interface: ``jax.pure_callback`` hands over arrays of JAX, and copies of large ones wait for the thread
that waits for the function (jax-ml/jax issues 24255, 25861): on one core it hangs from 100 kB on.
"""

from __future__ import annotations

import ctypes
import math
import threading
import traceback
import weakref
from collections.abc import Callable
from ctypes import POINTER, c_char_p, c_int, c_int64, c_size_t, c_uint32, c_void_p
from typing import Any

import jax
import ml_dtypes
import numpy as np
from numpy.typing import NDArray

TARGET = "prehend_callback"

TYPES = {
    1: np.bool_,
    4: np.int32,
    5: np.int64,
    10: np.float16,
    11: np.float32,
    12: np.float64,
    16: ml_dtypes.bfloat16,
}
"""Types of numbers by their code in XLA."""

METADATA = 1
"""Kind of the extension that asks for a handler's version."""

INTERNAL = 13
"""Code of XLA for an internal error."""


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


class _Registry:
    """Functions by number. They live as long as what JAX was given, which refers to them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_number: list[tuple[weakref.ref[Callable[..., Any]], Any]] = []
        self._numbers: weakref.WeakKeyDictionary[Callable[..., Any], dict[Any, int]] = (
            weakref.WeakKeyDictionary()
        )

    def number(self, function: Callable[..., Any], tree: Any) -> int:
        """The number of a function of arguments of that structure."""
        with self._lock:
            if not self._by_number:
                jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(_handle), platform="cpu")
            own = self._numbers.setdefault(function, {})
            if tree not in own:
                own[tree] = len(self._by_number)
                self._by_number.append((weakref.ref(function), tree))
            return own[tree]

    def call(self, number: int, arrays: list[NDArray[Any]]) -> list[Any]:
        """What the function of that number returns."""
        reference, tree = self._by_number[number]
        function = reference()
        if function is None:
            raise ReferenceError("the function that this program was compiled from is no more: keep it")
        return jax.tree.leaves(function(*jax.tree.unflatten(tree, arrays)))


_registry = _Registry()


def callback(function: Callable[..., Any], shapes: Any, *args: Any, vmap_method: str) -> Any:
    """``jax.pure_callback`` of a function of arrays that it may neither change nor keep."""
    if jax.default_backend() != "cpu":

        def cast(*arrays: Any) -> Any:
            found = function(*arrays)
            return jax.tree.map(lambda array, like: np.asarray(array, like.dtype), found, shapes)

        return jax.pure_callback(cast, shapes, *args, vmap_method=vmap_method)
    arguments, tree = jax.tree.flatten(args)
    results, structure = jax.tree.flatten(shapes)
    call = jax.ffi.ffi_call(TARGET, results, vmap_method=vmap_method)
    found = call(*arguments, function=np.int64(_registry.number(function, tree)))
    return jax.tree.unflatten(structure, found)


@ctypes.CFUNCTYPE(c_void_p, POINTER(_Call))
def _handle(frame: Any) -> int | None:
    # An exception that left this function would be an error at a random address.
    try:
        return _answer(frame.contents)
    except BaseException:
        try:
            text = traceback.format_exc().encode(errors="backslashreplace")
        except BaseException:
            text = b"an exception without a text"
        said = _Error(ctypes.sizeof(_Error), None, text, INTERNAL)
        return frame.contents.api.contents.create_error(ctypes.byref(said))  # type: ignore[no-any-return]


def _answer(call: Any) -> None:
    if call.extension and call.extension.contents.kind == METADATA:
        # Nothing here is newer than the first of these versions.
        asked = ctypes.cast(call.extension, POINTER(_MetadataExtension)).contents.metadata.contents
        own = call.api.contents.version
        asked.version.major, asked.version.minor = 0, own.minor if own.major == 0 else 1
        return
    arguments = _arrays(call.arguments)
    for array in arguments:
        array.flags.writeable = False
    found = _registry.call(call.attributes.values[0].contents.value[0], arguments)
    for array, result in zip(_arrays(call.results), found, strict=True):
        if np.shape(result) != array.shape:
            raise ValueError(f"a result of shape {np.shape(result)}, not {array.shape}")
        array[...] = result


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
