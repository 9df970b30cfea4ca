"""Arrays go to other libraries by DLPack as they lie, and live as long as these look at them."""

import ctypes
import gc
import weakref
from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.linear import dlpack


class Columns:
    """Some rows of an array as columns, as `haustra.envs.sim.linear.cuda.DeviceColumns`, in the CPU's memory."""

    def __init__(self, of: np.ndarray, first: int, count: int) -> None:
        self._of, self._first, self._count = of, first, count

    def __dlpack__(self, **asked: object) -> Any:
        of, row = self._of, self._of.shape[1]
        there = of.ctypes.data + self._first * row * of.itemsize
        shape, strides = (self._count, len(of) - self._first), (1, row)
        return dlpack.capsule(self, there, shape, of.dtype, strides=strides, device=dlpack.CPU)

    def __dlpack_device__(self) -> tuple[int, int]:
        return dlpack.CPU, 0


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int32])
def test_numpy_and_jax_read_where_the_numbers_lie(kind):
    of = np.arange(12, dtype=kind).reshape(3, 4)
    taken = np.from_dlpack(Columns(of, 1, 2))
    np.testing.assert_array_equal(taken, of[1:, :2].T)
    of[2, 1] = -7
    assert taken[1, 1] == -7 and taken.dtype == kind
    jax = pytest.importorskip("jax")
    if kind != np.float64:
        np.testing.assert_array_equal(jax.dlpack.from_dlpack(Columns(of, 0, 4), copy=True), of.T)


def test_what_is_lent_is_given_back_whatever_others_ask_of_the_same_interface(monkeypatch):
    """Functions of `ctypes.pythonapi` are one for all modules, with the types that the last of them set."""
    objects = (ctypes.py_object, ctypes.c_char_p)
    for name in ("PyCapsule_IsValid", "PyCapsule_GetPointer"):
        monkeypatch.setattr(getattr(ctypes.pythonapi, name), "argtypes", objects)
    test_what_is_lent_lives_until_it_is_given_back()


def test_what_is_lent_lives_until_it_is_given_back():
    owner = Columns(np.ones((2, 2)), 0, 2)
    seen, taken = weakref.ref(owner), np.from_dlpack(owner)
    unused = owner.__dlpack__()
    del owner
    gc.collect()
    assert seen() is not None and taken.sum() == 4
    del taken, unused
    gc.collect()
    assert seen() is None
