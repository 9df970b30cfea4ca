"""Where programs over pixels run: on threads of the CPU, or on an NVIDIA GPU, behind one interface."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, final

import numpy as np

from haustra.envs.sim.linear.compile import assembled
from haustra.envs.sim.linear.cuda import DeviceArray, Kernel
from haustra.envs.sim.linear.place import aligned
from haustra.envs.view.picture.pixels import function_of

_GROUP = 128
"""Threads of a GPU that are placed together."""


class Launcher(ABC):
    """Runs programs over blocks of the things of all worlds (`haustra.envs.view.picture.pixels.each_block`)."""

    lanes: int
    """Things of a block."""

    @abstractmethod
    def hold(self, values: np.ndarray) -> Any:
        """Numbers where programs run."""

    @abstractmethod
    def run(self, name: str, text: str, arrays: Sequence[Any], counts: Sequence[int], worlds: int) -> None:
        """Run a program.

        Args:
            name: of its function.
            text: of the program, in LLVM's language.
            arrays: that were held.
            counts: whole numbers; the first is how many blocks a world has.
            worlds: how many.
        """

    @abstractmethod
    def fetch(self, held: Any) -> np.ndarray:
        """Numbers that were held, as they are now: a copy."""


@final
class CpuLauncher(Launcher):
    """Threads that share the worlds."""

    def __init__(self, lanes: int, threads: int) -> None:
        """So many things at a time on each of so many threads."""
        self.lanes, self._threads = lanes, threads
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def hold(self, values: np.ndarray) -> np.ndarray:
        """As `Launcher.hold`: where vectors of any width may be read."""
        return aligned(values, values.dtype)

    def run(self, name: str, text: str, arrays: Sequence[np.ndarray], counts: Sequence[int], worlds: int) -> None:
        """As `Launcher.run`."""
        _, function = function_of(text, name, len(arrays), len(counts) + 2)
        given, blocks = [each.ctypes.data for each in arrays], counts[0]

        def part(index: int) -> None:
            bounds = (worlds * each // self._threads * blocks for each in (index, index + 1))
            function(*given, *counts, *bounds)

        others = [self._pool.submit(part, index) for index in range(1, self._threads)] if self._pool else []
        part(0)
        for other in others:
            other.result()

    def fetch(self, held: np.ndarray) -> np.ndarray:
        """As `Launcher.fetch`."""
        return held.copy()


@cache
def _kernel(text: str, name: str) -> Kernel:
    return Kernel(assembled(text), name)


@final
class GpuLauncher(Launcher):
    """The first NVIDIA GPU, a thread for each thing."""

    lanes = 1

    def hold(self, values: np.ndarray) -> DeviceArray:
        """As `Launcher.hold`: in its memory."""
        return DeviceArray(np.ascontiguousarray(values))

    def run(self, name: str, text: str, arrays: Sequence[DeviceArray], counts: Sequence[int], worlds: int) -> None:
        """As `Launcher.run`."""
        last = counts[0] * worlds
        _kernel(text, name)(arrays, [*counts, 0, last], groups=-(-last // _GROUP), group=_GROUP)
        Kernel.wait()

    def fetch(self, held: DeviceArray) -> np.ndarray:
        """As `Launcher.fetch`."""
        return held.get()
