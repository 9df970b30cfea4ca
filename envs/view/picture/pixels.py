"""Programs that work on many pixels at a time: what they load and store, and the machine code that they become."""

import ctypes
import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from llvmlite import ir

from haustra.envs.sim.linear.compile import engine_of, thread_of
from haustra.envs.sim.linear.trace import INDEX, Program, Value


class Pixels:
    """Numbers of pixels that stand side by side, plane after plane."""

    def __init__(
        self, program: Program, base: Any, first: Value, apart: Value | int = 0, *, whole: bool = False
    ) -> None:
        """`base` points at the first plane; planes are `apart` numbers apart, and `first` is the first pixel."""
        self._program, self._base, self._first, self._apart = program, base, first, apart
        self._one = INDEX if whole else program.real
        self._kind = self._one if program.lanes == 1 else ir.VectorType(self._one, program.lanes)

    def load(self, plane: int = 0) -> Value:
        """The numbers of a plane."""
        return Value(self._program, self._program.builder.load(self._place(plane), typ=self._kind, align=4))

    def vector(self, plane: int) -> tuple[Value, Value, Value]:
        """The numbers of three planes."""
        return self.load(plane), self.load(plane + 1), self.load(plane + 2)

    def store(self, value: Value, plane: int = 0) -> None:
        """Put numbers into a plane."""
        program = self._program
        written = (
            value.written if value.whole else program.alone(value) if program.lanes == 1 else program.spread(value)
        )
        program.builder.store(written, self._place(plane), align=4)

    def _place(self, plane: int) -> Any:
        place = self._first + self._apart * plane
        return self._program.builder.gep(self._base, [place.written], source_etype=self._one)


def begun(
    name: str, arrays: Sequence[str], counts: Sequence[str], *, lanes: int, approximate: bool = False
) -> tuple[Program, dict[str, Any]]:
    """A program in single precision without anything in it, and its arguments: pointers to arrays, whole numbers."""
    kinds = [ir.PointerType()] * len(arrays) + [INDEX] * len(counts)
    program = Program(name, kinds, lanes=lanes, real=np.dtype(np.float32), approximate=approximate)
    given = program.function.args
    arguments: dict[str, Any] = dict(zip(arrays, given, strict=False))
    numbers = (Value(program, each) for each in given[len(arrays) :])
    return program, arguments | dict(zip(counts, numbers, strict=True))


@contextmanager
def each_block(program: Program, first: Value, last: Value) -> Iterator[Value]:
    """Blocks of as many things as there are lanes: one after the other, or one in each thread of a graphics processor.

    There, where a block is one thing, the first is the first of all.
    """
    if program.lanes > 1:
        with program.loop(first, last) as block:
            yield block
        return
    thread = thread_of(program)
    with program.when(thread < last):
        yield thread


@functools.cache
def function_of(text: str, name: str, arrays: int, counts: int) -> tuple[Any, Callable[..., None]]:
    """What keeps a program's machine code alive, and its function of so many addresses and whole numbers."""
    engine = engine_of(text)
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arrays, *[ctypes.c_int32] * counts)
    return engine, kind(engine.get_function_address(name))
