"""Programs of teams of threads on a graphics processor: a team steps one world, whose things stand in its threads.

Where a CPU holds nodes or spheres of one world in the lanes of an instruction, a team holds one in each thread, and
what follows one from the other goes from thread to thread. All the rest every thread of a team does alike.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from llvmlite import ir

from haustra.envs.sim.linear.trace import BIT, INDEX, Program, Value

_LAST = 31
"""The last thread of a warp, which what is passed on within one may come from."""
_PASS = "llvm.nvvm.shfl.sync.idx."
"""What passes a number from a thread to others, by LLVM's name."""


class TeamProgram(Program):
    """One function under construction, for teams of threads."""

    def __init__(
        self,
        name: str,
        arguments: Sequence[Any],
        *,
        real: np.dtype,
        team: int,
        written: Sequence[int],
        approximate: bool,
    ) -> None:
        """Begin.

        Args:
            name: of the function.
            arguments: LLVM types of its arguments; pointers are to arrays that do not overlap.
            real: precision of real numbers; single.
            team: threads, of one warp.
            written: arguments that are written to: LLVM is not told that nobody else does.
            approximate: as every program's.
        """
        super().__init__(name, arguments, lanes=1, real=real, approximate=approximate)
        for index in written:
            self.function.args[index].attributes.remove("noalias")
        self._team, self._everybody = team, ir.Constant(INDEX, 2**team - 1)
        asked = ir.Function(self.module, ir.FunctionType(INDEX, []), "llvm.nvvm.read.ptx.sreg.tid.x")
        self._thread = Value(self, self.builder.call(asked, []))
        self._read = False
        """Whether some of a team may still be about to read what others would write."""

    @contextmanager
    def side_by_side(self, count: int, registers: int = 1) -> Iterator[int]:
        """As every program's; each thread holds one thing, in however many registers they are asked for."""
        assert count == self._team, "a team has as many threads as things stand side by side"
        self.abreast = count
        self.settle()
        yield count
        self.abreast = 1
        self.settle()

    def numbered(self, first: Value) -> Value:
        """As every program's."""
        return first if self.abreast == 1 else first + self._thread

    def apart(self, value: Value) -> list[Value]:
        """As every program's."""
        if self.abreast == 1 or isinstance(value.written, ir.Constant):
            return [value] * self.abreast
        return [self._passed(value, ir.Constant(INDEX, thread)) for thread in range(self.abreast)]

    def together(self, values: Sequence[Value]) -> Value:
        """As every program's."""
        found = values[0]
        for thread, value in enumerate(values[1:], 1):
            found = self.xp.where(self._thread == thread, value, found)
        return found

    def later(self, before: Value, now: Value) -> Value:
        """As every program's."""
        last = self._team - 1
        given = self.xp.where(self._thread == last, before, now)
        return self._passed(given, self.xp.where(self._thread == 0, self.index(last), self._thread - 1).written)

    def any(self, condition: Value) -> Any:
        """As every program's, in any thread."""
        if self.abreast == 1:
            return condition.written
        vote = self._declared("llvm.nvvm.vote.any.sync", ir.FunctionType(BIT, [INDEX, BIT]))
        return self.builder.call(vote, [self._everybody, condition.written])

    def settle(self) -> None:
        """As every program's."""
        wait = self._declared("llvm.nvvm.bar.warp.sync", ir.FunctionType(ir.VoidType(), [INDEX]))
        self.builder.call(wait, [self._everybody])
        self._read = False

    def reads(self) -> None:
        """As every program's."""
        self._read = True

    def writes(self) -> None:
        """Wait for those who are to read what was there before."""
        if self._read and self.abreast == 1:
            self.settle()

    def _enter(self, block: Any) -> None:
        super()._enter(block)
        self.settle()

    def _passed(self, value: Value, thread: Any) -> Value:
        """A number of another thread."""
        if value.element is BIT:
            return self._passed(Value(self, self.builder.zext(value.written, INDEX)), thread) != 0
        kind = value.element
        suffix = "i32" if value.whole else "f32"
        take = self._declared(f"{_PASS}{suffix}", ir.FunctionType(kind, [INDEX, kind, INDEX, INDEX]))
        given = [self._everybody, value.written, thread, ir.Constant(INDEX, _LAST)]
        return Value(self, self.builder.call(take, given))
