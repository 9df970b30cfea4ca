"""Arrays for other libraries by DLPack, the protocol by which numpy, JAX, torch and CuPy share memory without a copy.

Structures are those of DLPack 0.8 (dlpack.h, Data APIs consortium), which every consumer reads.
"""

import ctypes
from typing import Any

import numpy as np

CPU, CUDA = 1, 2
"""Kinds of device: kDLCPU, kDLCUDA."""
_KINDS = {"i": 0, "u": 1, "f": 2}
"""kDLInt, kDLUInt, kDLFloat, by numpy's letters."""
_UNUSED = b"dltensor"
"""Name of a capsule that nobody has taken; who takes it gives it another."""


class _Tensor(ctypes.Structure):
    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device", ctypes.c_int32 * 2),
        ("ndim", ctypes.c_int32),
        ("code", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    )


class _Managed(ctypes.Structure):
    _fields_ = (("tensor", _Tensor), ("context", ctypes.c_void_p), ("deleter", ctypes.c_void_p))


_lent: dict[int, tuple[Any, ...]] = {}
"""What is kept alive while another library looks at it, by the address of what describes it."""


@ctypes.CFUNCTYPE(None, ctypes.c_void_p)
def _given_back(managed: int) -> None:
    _lent.pop(managed, None)


_python = ctypes.PyDLL(None)  # not `ctypes.pythonapi`, whose functions other modules give types of their own
_destructor = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
_python.PyCapsule_New.restype = ctypes.py_object
_python.PyCapsule_New.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
_python.PyCapsule_IsValid.argtypes = (ctypes.c_void_p, ctypes.c_char_p)
_python.PyCapsule_GetPointer.restype = ctypes.c_void_p
_python.PyCapsule_GetPointer.argtypes = (ctypes.c_void_p, ctypes.c_char_p)


@_destructor
def _dropped(capsule: int) -> None:
    """A capsule that nobody has taken gives back what it lent."""
    if _python.PyCapsule_IsValid(capsule, _UNUSED):
        _lent.pop(_python.PyCapsule_GetPointer(capsule, _UNUSED), None)


def capsule(
    owner: Any, pointer: int, shape: tuple[int, ...], kind: np.dtype, *, strides: tuple[int, ...], device: int
) -> Any:
    """A capsule for `from_dlpack` of numpy, JAX, torch or CuPy.

    Args:
        owner: kept alive until who takes it lets go.
        pointer: address of the first number.
        shape: of the array.
        kind: of its numbers.
        strides: from a number to the next along each axis, in numbers.
        device: `CPU` or `CUDA`, the first of its kind.
    """
    sizes = ctypes.c_int64 * len(shape)
    own, apart = sizes(*shape), sizes(*strides)
    of = (ctypes.c_int32 * 2)(device, 0)
    tensor = _Tensor(pointer, of, len(shape), _KINDS[kind.kind], 8 * kind.itemsize, 1, own, apart, 0)
    managed = _Managed(tensor, None, ctypes.cast(_given_back, ctypes.c_void_p))
    address = ctypes.addressof(managed)
    _lent[address] = (owner, managed, own, apart)
    return _python.PyCapsule_New(address, _UNUSED, ctypes.cast(_dropped, ctypes.c_void_p))
