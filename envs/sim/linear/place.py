"""Where programs run: on threads of the CPU, or on an NVIDIA GPU, behind one interface."""

import copy
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from threading import Lock
from typing import Any, Protocol

import numpy as np

from haustra.envs.sim.linear.compile import WARP, assembled, compiled, lanes_of, write_kernel, write_program
from haustra.envs.sim.linear.cuda import DeviceArray, DeviceColumns, Kernel
from haustra.envs.sim.linear.program import ARGUMENTS, WRITTEN


class Held(Protocol):
    """Numbers that a program works on."""

    def read(self) -> np.ndarray:
        """What they are now, not to be written to."""
        ...

    def change(self, first: int = 0, last: int | None = None) -> np.ndarray:
        """What they are now, to be written to before the next run: rows from the first to before the last, or all."""
        ...

    def head(self, rows: int) -> np.ndarray:
        """The first `rows` of them now."""
        ...

    def columns(self, rows: slice, count: int) -> Any:
        """Some rows as columns (count, rows), where they lie: whoever takes them reads and writes without a copy."""
        ...


class Place(Protocol):
    """Where programs run."""

    lanes: int
    """Worlds of a block."""

    def hold(self, values: np.ndarray) -> Any:
        """Numbers there."""
        ...

    def run(self, arrays: dict[str, Any], counts: Sequence[int], worlds: int) -> None:
        """Run the program on all worlds."""
        ...

    def beside(self, **program: Any) -> "Place":
        """This place with another program of its worlds, which needs no more room to work in."""
        ...

    def close(self) -> None:
        """End what is held open."""
        ...


class _Here:
    """Numbers in the CPU's memory."""

    def __init__(self, values: np.ndarray) -> None:
        self._values = values
        self.pointer = values.ctypes.data

    def read(self) -> np.ndarray:
        return self._values

    def change(self, first: int = 0, last: int | None = None) -> np.ndarray:
        return self._values

    def head(self, rows: int) -> np.ndarray:
        return self._values[:rows]

    def columns(self, rows: slice, count: int) -> np.ndarray:
        return self._values[rows, :count].T


_MAKING = Lock()


class CpuPlace:
    """Threads of the CPU."""

    def __init__(self, *, worlds: int, threads: int, real: Any, room: int, **program: Any) -> None:
        """Compile a program, or read what was compiled before.

        Args:
            worlds: how many; one alone has no lanes to fill, nor are any left where derivatives fill them.
            threads: that share the blocks.
            real: precision.
            room: slots of a block to work in.
            program: the rest of what `write_program` wants.
        """
        alone = worlds == 1 or program.get("directions", 0) > lanes_of(real)
        self._real, self.lanes = np.dtype(real), 1 if alone else lanes_of(real)
        with _MAKING:  # once, whichever threads ask for it
            self._engine, self._function = compiled(write_program(lanes=self.lanes, real=real, **program))
        self._rooms = [_Here(aligned(np.zeros((room, self.lanes)), real)) for _ in range(threads)]
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def hold(self, values: np.ndarray) -> _Here:
        """Numbers where vectors of any width may be read."""
        return _Here(values if values.dtype == np.int32 else aligned(values, self._real))

    def run(self, arrays: dict[str, _Here], counts: Sequence[int], worlds: int) -> None:
        """Run the program on all worlds, a part of the blocks a thread."""
        blocks = -(-worlds // self.lanes)
        parts = len(self._rooms)

        def part(index: int) -> None:
            own = arrays | {"room": self._rooms[index]}
            bounds = blocks * index // parts, blocks * (index + 1) // parts
            self._function(*(own[name].pointer for name in ARGUMENTS), *counts, *bounds)

        others = [self._pool.submit(part, index) for index in range(1, parts)] if self._pool else []
        part(0)
        for other in others:
            other.result()

    def beside(self, **program: Any) -> "CpuPlace":
        """As `Place.beside`."""
        other = copy.copy(self)
        with _MAKING:
            other._engine, other._function = compiled(write_program(lanes=self.lanes, real=self._real.type, **program))
        return other

    def close(self) -> None:
        """End the threads."""
        if self._pool:
            self._pool.shutdown()


class _There:
    """Numbers in a graphics processor's memory, copied when they are asked for."""

    def __init__(self, values: np.ndarray) -> None:
        self.there = DeviceArray(values)
        self._here: np.ndarray | None = None
        self._changed = 0, 0

    def read(self) -> np.ndarray:
        if self._here is None:
            self._here = self.there.get()
        return self._here

    def change(self, first: int = 0, last: int | None = None) -> np.ndarray:
        low, high = self._changed
        end = self.there.shape[0] if last is None else last
        self._changed = (min(first, low), max(end, high)) if high else (first, end)
        return self.read()

    def head(self, rows: int) -> np.ndarray:
        return self.there.get(rows)

    def columns(self, rows: slice, count: int) -> DeviceColumns:
        return DeviceColumns(self.there, rows, count)

    def run(self, *, written: bool) -> DeviceArray:
        """Give it to a program, which may write to it."""
        low, high = self._changed
        if high and self._here is not None:
            self.there.put(self._here[low:high], first=low)
        self._changed, self._here = (0, 0), None if written else self._here
        return self.there


@cache
def _made(text: str) -> Kernel:
    return Kernel(assembled(text), "advance")


def _kernel(**program: Any) -> Kernel:
    """The kernel of a program, made once in a process, whichever threads ask for it."""
    with _MAKING:
        return _made(write_kernel(**program))


_GROUPS, _FEW, _MANY = 1024, 256, 8
"""Groups of threads that fill a graphics processor, eight on each of its 132 parts; and where worlds are fewer, so many
groups, of so many worlds at most: worlds wait for each other less, and for memory that is near."""


def group_of(worlds: int) -> int:
    """Worlds of a block on a graphics processor, from 1 to those of a whole warp (docs/decisions/linear-gpu.md)."""
    most = max(min(worlds // _FEW, _MANY), worlds // _GROUPS, 1)
    return min(WARP, 1 << most.bit_length() - 1)


TEAM, _TEAMS = 16, 2_048
"""Threads of a team, and at most so many worlds have teams: with more of them, a thread a world is faster."""


def team_of(worlds: int, real: Any) -> int:
    """Threads that step one world on a graphics processor together (docs/decisions/linear-gpu.md); else 1."""
    return TEAM if worlds <= _TEAMS and np.dtype(real) == np.float32 else 1


def forget() -> None:
    """Forget all programs that this process has written or read, as a new one begins."""
    for kept in (write_program, write_kernel, compiled, _made):
        kept.cache_clear()


class GpuPlace:
    """The first NVIDIA GPU; a thread steps a world, or a team of threads does."""

    def __init__(self, *, worlds: int, real: Any, room: int, **program: Any) -> None:
        """Compile a program.

        Args:
            worlds: how many.
            real: precision.
            room: slots to work in, of each world that is stepped at the same time as others.
            program: the rest of what `write_kernel` wants.

        Raises:
            MissingDependencyError: when there is no such GPU.
        """
        team = program.get("abreast", 1)
        self._real, self.lanes = np.dtype(real), group_of(worlds) if team == 1 else 1
        self._threads = self.lanes * team
        self._kernel = _kernel(real=real, group=self.lanes, **program)
        self._groups = min(-(-worlds // self.lanes), self._kernel.resident(self._threads))
        self._room = DeviceArray(np.zeros((self._groups, room, self.lanes), self._real))

    def hold(self, values: np.ndarray) -> _There:
        """Numbers in its memory."""
        return _There(values if values.dtype == np.int32 else values.astype(self._real))

    def run(self, arrays: dict[str, _There], counts: Sequence[int], worlds: int) -> None:
        """Run the program on all worlds."""
        own = {name: array.run(written=name in WRITTEN) for name, array in arrays.items()} | {"room": self._room}
        self._kernel([own[name] for name in ARGUMENTS], [*counts, 0, worlds], groups=self._groups, group=self._threads)
        self._kernel.wait()

    def beside(self, **program: Any) -> "GpuPlace":
        """As `Place.beside`."""
        other = copy.copy(self)
        other._kernel = _kernel(real=self._real.type, group=self.lanes, **program)
        return other

    def close(self) -> None:
        """Nothing is held open."""


def aligned(values: np.ndarray, real: Any) -> np.ndarray:
    """A copy that begins where vectors of any width may be read."""
    kind = np.dtype(real)
    raw = np.zeros(values.size * kind.itemsize + 64, np.uint8)
    start = -raw.ctypes.data % 64
    copy = raw[start : start + values.size * kind.itemsize].view(kind).reshape(values.shape)
    copy[...] = values
    return copy
