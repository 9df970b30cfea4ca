"""Along the nodes of an axis, once: what is found at a node is kept in registers for those behind it.

Where one world is stepped alone, several of its nodes stand side by side (`Program.side_by_side`), and the same is
written: `Before` then moves numbers from lane to lane, and only what follows node from node goes in turn (`in_turn`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.trace import Number, Program, Value, Variable
from haustra.models.wall.vectors import Vector


@dataclass(frozen=True)
class Nodes:
    """A node, or those that stand side by side; beyond the ends of an axis, those at its ends are read."""

    first: Value
    """The first of them."""
    each: Value
    """Number of each, which may be beyond the ends."""
    within: Value
    """Number of each, or of the end that it is beyond."""
    slot: Value
    """Where the first one's numbers lie; where nodes stand side by side, there is room beyond the ends."""
    count: Value
    """How many the axis has."""

    @classmethod
    def at(cls, program: Program, first: Value, count: Value) -> "Nodes":
        """These, of an axis of that many."""
        xp = program.xp
        each = program.numbered(first)
        within = xp.minimum(xp.maximum(each, 0), count - 1)
        return cls(first, each, within, within if program.abreast == 1 else first, count)

    def back(self, by: int) -> "Nodes":
        """So many nodes before these."""
        return Nodes.at(self.first.program, self.first - by, self.count)


class NodeNumbers:
    """Numbers of nodes in one of a world's arrays."""

    def __init__(self, lanes: Lanes, start: Callable[[int], Any], apart: int) -> None:
        """Bind them.

        Args:
            lanes: the array.
            start: slot from which a number is counted (`haustra.envs.sim.linear.layout.Layout`).
            apart: slots from a node to the next.
        """
        self._lanes, self._start, self._apart = lanes, start, apart

    def load(self, at: Nodes, number: int) -> Value:
        """A number of these nodes."""
        return self._lanes.load_next(at.slot * self._apart + self._start(number))

    def vector(self, at: Nodes, number: int) -> Vector:
        """Three numbers of these nodes."""
        return self.load(at, number), self.load(at, number + 1), self.load(at, number + 2)

    def put(self, at: Nodes, number: int, values: Sequence[Number]) -> None:
        """Put numbers of these nodes, from one on."""
        for more, value in enumerate(values):
            self._lanes.store_next(at.slot * self._apart + self._start(number + more), value)

    def fetch(self, node: Any, number: int, count: int) -> None:
        """Ask memory ahead for numbers of a node, from one on; there need not be such a node."""
        self._lanes.fetch(node * self._apart + self._start(number), count)

    def gather(self, node: Value, number: int) -> Value:
        """A number of a node, which may be another one in each lane."""
        return self._lanes.gather(node * self._apart, self._start(number))

    def gather_vector(self, node: Value, number: int) -> Vector:
        """Three numbers of such a node."""
        return self.gather(node, number), self.gather(node, number + 1), self.gather(node, number + 2)

    def scatter(self, node: Value, number: int, value: Number) -> None:
        """Put a number of such a node."""
        self._lanes.scatter(node * self._apart, value, self._start(number))


class NodeRows:
    """Numbers of nodes that stand side by side, node by node: other things look them up by fours, each at its own."""

    def __init__(self, lanes: Lanes, start: Any, fours: int) -> None:
        """Bind them.

        Args:
            lanes: the array.
            start: slot of the first node's numbers.
            fours: of numbers that a node has.
        """
        self._rows = lanes.rows(start, fours)

    def load(self, at: Nodes, number: int) -> Value:
        """A number of these nodes."""
        return self.gather(at.each, number)

    def vector(self, at: Nodes, number: int) -> Vector:
        """Three numbers of these nodes."""
        return self.gather_vector(at.each, number)

    def put(self, at: Nodes, number: int, values: Sequence[Number]) -> None:
        """Put numbers of these nodes, from one on, which four divides; up to the next that it divides."""
        padded = *values, *[0.0] * (-len(values) % 4)
        for four in range(0, len(padded), 4):
            self._rows.put(at.first, number + four, padded[four : four + 4])

    def fetch(self, node: Any, number: int, count: int) -> None:
        """Nothing: no graphics processor has such numbers."""

    def gather(self, node: Value, number: int) -> Value:
        """A number of a node, which may be another one in each lane."""
        return self._rows.read(node, number)

    def gather_vector(self, node: Value, number: int) -> Vector:
        """Three numbers of such a node."""
        return self.gather(node, number), self.gather(node, number + 1), self.gather(node, number + 2)


@contextmanager
def along(program: Program, count: Value, start: Number, stop: Number, *, backwards: bool = False) -> Iterator[Nodes]:
    """Go along an axis of that many nodes, from one to before another; beyond the ends too, where these are."""
    abreast = program.abreast
    if abreast == 1:
        with program.loop(start, stop, backwards=backwards) as node:
            yield Nodes.at(program, node, count)
        return
    groups = (program.index(stop) - start + (abreast - 1)) // abreast
    with program.loop(0, groups, backwards=backwards) as group:
        yield Nodes.at(program, group * abreast + start, count)


class Before:
    """Numbers of the nodes before those that a sweep is at."""

    def __init__(self, program: Program, *start: Number) -> None:
        """`start`: those of the node before the first."""
        self._program, self._kept = program, [program.variable(number) for number in start]

    def __call__(self, *values: Number) -> Any:
        """Numbers of the nodes before; keep these for the next."""
        found = tuple(each.value for each in self._kept)
        for each, value in zip(self._kept, values, strict=True):
            each.value = value
        if self._program.abreast == 1:
            return found
        program = self._program
        now = (Value(program, program.spread(value)) for value in values)
        return tuple(program.later(before, each) for before, each in zip(found, now, strict=True))


def in_turn(
    program: Program,
    follow: Callable[[tuple[Value, ...], tuple[Value, ...]], tuple[tuple[Value, ...], tuple[Value, ...]]],
    kept: Sequence[Variable],
    given: Sequence[Value],
    *,
    backwards: bool = False,
) -> Any:
    """What follows node from node: found one by one where nodes stand side by side.

    Args:
        program: to write to.
        follow: from what was kept of the node before, and what is given of this one, to what is kept and what is found.
        kept: of the node before; numbers of one node each (`kept_numbers`).
        given: of these nodes.
        backwards: whether the last of them comes first.
    """
    apart = list(zip(*(program.apart(value) for value in given), strict=True))
    state, found = tuple(each.value for each in kept), []
    for own in reversed(apart) if backwards else apart:
        state, result = follow(state, own)
        found.append(result)
    for each, value in zip(kept, state, strict=True):
        each.value = value
    return tuple(program.together(part) for part in zip(*(found[::-1] if backwards else found), strict=True))


def kept_numbers(program: Program, *start: float) -> list[Variable]:
    """Variables that hold a number of one node, though several stand side by side."""
    return [program.variable(number, kind=None if program.abreast == 1 else program.real) for number in start]
