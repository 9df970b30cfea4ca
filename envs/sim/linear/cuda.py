"""NVIDIA's driver, as far as programs need it: memory, kernels and launches, through ctypes."""

import ctypes
import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from haustra.envs.sim.linear.dlpack import CUDA, capsule
from haustra.errors import MissingDependencyError

_OUT_OF_MEMORY = 2
"""CUDA_ERROR_OUT_OF_MEMORY."""
_PARTS = 16
"""CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT."""


@cache
def _driver() -> tuple[Any, Any]:
    """The driver, and the first device's context.

    Raises:
        MissingDependencyError: when there is no device or no driver.
    """
    try:
        library = ctypes.CDLL("libcuda.so.1")
    except OSError as error:
        raise MissingDependencyError("No NVIDIA driver was found (libcuda.so.1): use the CPU.") from error
    device, context = ctypes.c_int(), ctypes.c_void_p()
    for code in (
        library.cuInit(0),
        library.cuDeviceGet(ctypes.byref(device), 0),
        library.cuDevicePrimaryCtxRetain(ctypes.byref(context), device),
    ):
        if code:
            raise MissingDependencyError(f"NVIDIA's driver found no device (error {code}): use the CPU.")
    return library, context


_STREAM = ctypes.c_void_p(2)
"""CU_STREAM_PER_THREAD: what several threads launch runs side by side."""


def _wait() -> None:
    _call("cuStreamSynchronize", _STREAM)


def _call(name: str, *arguments: Any) -> None:
    driver, context = _driver()
    driver.cuCtxSetCurrent(context)  # of this thread
    code = getattr(driver, name)(*arguments)
    if code:
        text = ctypes.c_char_p()
        driver.cuGetErrorString(code, ctypes.byref(text))
        kind = MemoryError if code == _OUT_OF_MEMORY else RuntimeError
        raise kind(f"{name}: {text.value.decode() if text.value else code}")


class DeviceArray:
    """Numbers in the memory of a graphics processor; JAX, torch and CuPy take them as they are."""

    def __init__(self, values: np.ndarray) -> None:
        """Copy them there."""
        self.shape, self.dtype = values.shape, values.dtype
        self._pointer = ctypes.c_uint64()
        _call("cuMemAlloc_v2", ctypes.byref(self._pointer), ctypes.c_size_t(max(values.nbytes, 16)))
        self.put(values)

    @property
    def pointer(self) -> int:
        """Address."""
        return int(self._pointer.value)

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """Version 3 of the interface by which libraries share arrays."""
        return {"shape": self.shape, "typestr": self.dtype.str, "data": (self.pointer, False), "version": 3}

    def __dlpack__(self, **asked: Any) -> Any:
        """A capsule by which libraries share arrays; whatever was launched has ended, so no stream has to wait."""
        strides = tuple(math.prod(self.shape[axis + 1 :]) for axis in range(len(self.shape)))
        return capsule(self, self.pointer, self.shape, self.dtype, strides=strides, device=CUDA)

    def __dlpack_device__(self) -> tuple[int, int]:
        """The first NVIDIA GPU."""
        return CUDA, 0

    def put(self, values: np.ndarray, *, first: int = 0) -> None:
        """Copy values of the same shape there, or of some rows, from the first of them on."""
        own = np.ascontiguousarray(values, self.dtype)
        size = ctypes.c_size_t(own.nbytes)
        there = ctypes.c_uint64(self.pointer + first * self.dtype.itemsize * math.prod(self.shape[1:]))
        _call("cuMemcpyHtoDAsync_v2", there, ctypes.c_void_p(own.ctypes.data), size, _STREAM)
        _wait()

    def get(self, rows: int | None = None) -> np.ndarray:
        """Copy them here, or their first rows."""
        own = np.empty(self.shape if rows is None else (rows, *self.shape[1:]), self.dtype)
        size = ctypes.c_size_t(own.nbytes)
        _call("cuMemcpyDtoHAsync_v2", ctypes.c_void_p(own.ctypes.data), self._pointer, size, _STREAM)
        _wait()
        return own

    def __del__(self) -> None:
        if getattr(self, "_pointer", None):
            _driver()[0].cuMemFree_v2(self._pointer)


class DeviceColumns:
    """Rows of an array as columns, where they lie; JAX, torch and CuPy take them as they are."""

    def __init__(self, of: DeviceArray, rows: slice, count: int) -> None:
        """The first `count` numbers of some rows of an array of rows."""
        self._of = of
        self.shape, self._first = (count, rows.stop - rows.start), rows.start

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """Version 3 of the interface by which libraries share arrays; as of `DeviceArray`."""
        size, row = self._of.dtype.itemsize, self._of.shape[1]
        there = {"data": (self._pointer, False), "strides": (size, row * size)}
        return self._of.__cuda_array_interface__ | {"shape": self.shape} | there

    @property
    def _pointer(self) -> int:
        return self._of.pointer + self._first * self._of.shape[1] * self._of.dtype.itemsize

    def __dlpack__(self, **asked: Any) -> Any:
        """As of `DeviceArray`."""
        strides = 1, self._of.shape[1]
        return capsule(self._of, self._pointer, self.shape, self._of.dtype, strides=strides, device=CUDA)

    def __dlpack_device__(self) -> tuple[int, int]:
        """As of `DeviceArray`."""
        return self._of.__dlpack_device__()


class Kernel:
    """A kernel on the first device."""

    def __init__(self, assembly: str, name: str) -> None:
        """Let the driver finish it.

        Raises:
            RuntimeError: when it cannot.
        """
        module, self._function = ctypes.c_void_p(), ctypes.c_void_p()
        _call("cuModuleLoadData", ctypes.byref(module), assembly.encode())
        _call("cuModuleGetFunction", ctypes.byref(self._function), module, name.encode())

    def resident(self, group: int) -> int:
        """Groups of so many threads that run at the same time."""
        each, parts, device = ctypes.c_int(), ctypes.c_int(), ctypes.c_int()
        size = ctypes.c_int(group), ctypes.c_size_t(0)
        _call("cuOccupancyMaxActiveBlocksPerMultiprocessor", ctypes.byref(each), self._function, *size)
        _call("cuCtxGetDevice", ctypes.byref(device))
        _call("cuDeviceGetAttribute", ctypes.byref(parts), _PARTS, device)
        return max(each.value * parts.value, 1)

    def __call__(self, arrays: Sequence[DeviceArray], counts: Sequence[int], *, groups: int, group: int) -> None:
        """Launch it.

        Args:
            arrays: first arguments.
            counts: whole numbers that follow.
            groups: of threads.
            group: threads that are placed together.
        """
        own = [ctypes.c_uint64(array.pointer) for array in arrays] + [ctypes.c_int32(count) for count in counts]
        arguments = (ctypes.c_void_p * len(own))(*(ctypes.addressof(each) for each in own))
        size = (groups, 1, 1, group, 1, 1, 0)
        _call("cuLaunchKernel", self._function, *size, _STREAM, arguments, None)

    @staticmethod
    def wait() -> None:
        """Until all that this thread launched is done."""
        _wait()
