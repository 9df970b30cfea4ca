"""Where a program's numbers lie: one a world, one for all worlds, or in tables that each world looks up in."""

from collections.abc import Iterable, Iterator
from typing import Any, Protocol

from llvmlite import ir

from haustra.envs.sim.linear.trace import INDEX, Number, Program, Value, nth, order, undefined, vector

_SECTOR = 32
"""Bytes that a graphics processor's memory hands out together."""


class Slots(Protocol):
    """Numbers by their places in a row."""

    def load(self, slot: Number) -> Value:
        """The number there."""
        ...

    def load_next(self, slot: Number) -> Value:
        """As many numbers from there on as stand side by side."""
        ...

    def fetch(self, slot: Number, count: int = 1) -> None:
        """Ask memory ahead for that many numbers, where that helps; there need not be any."""
        ...


class Lanes:
    """Numbers that each world has of its own: worlds side by side, slot after slot."""

    def __init__(self, program: Program, base: Any, stride: int | Value) -> None:
        """`base` points at slot 0 of the program's lanes; slots are `stride` numbers apart."""
        self._program, self._base = program, base
        self._stride: Any = stride
        self._lanes = program.lanes

    def load(self, slot: Number) -> Value:
        """The number there."""
        return self.gather(slot) if _differ(slot) else self._loaded(slot, self._lanes)

    def load_next(self, slot: Number) -> Value:
        """As many numbers from there on as stand side by side; where nothing does, the number there."""
        program = self._program
        if program.in_lanes:
            return self._loaded(slot, program.abreast)
        return self.load(program.numbered(program.index(slot)))

    def _loaded(self, slot: Number, lanes: int) -> Value:
        program = self._program
        program.reads()
        kind = program.real if lanes == 1 else vector(program.real, lanes)
        return Value(program, program.builder.load(self.place(slot), typ=kind, align=size_of(program)))

    def store(self, slot: Number, value: Number) -> None:
        """Put a number there."""
        if _differ(slot):
            self.scatter(slot, value)
        else:
            self._stored(slot, self._program.alone(value) if self._lanes == 1 else self._program.spread(value))

    def store_next(self, slot: Number, value: Number) -> None:
        """Put as many numbers there and behind as stand side by side; where nothing does, one."""
        program = self._program
        if program.in_lanes:
            self._stored(slot, program.spread(value))
        else:
            self.store(program.numbered(program.index(slot)), value)

    def _stored(self, slot: Number, written: Any) -> None:
        self._program.writes()
        self._program.builder.store(written, self.place(slot), align=size_of(self._program))

    def rows(self, slot: Number, fours: int) -> "Rows":
        """These numbers as rows of `fours` times four, from a slot on that four divides; of a world that is alone."""
        return Rows(self._program, self.place(slot), fours)

    def from_slot(self, slot: Number) -> "Lanes":
        """These numbers, counted from a slot on."""
        return self.at(self.place(slot))

    def flat(self, first: Number) -> "Shared":
        """Numbers of the whole array one behind the other, counted from one that is so far behind slot 0."""
        program = self._program
        place = program.builder.gep(self._base, [program.index(first).written], source_etype=program.real)
        return Shared(program, place)

    def gather(self, slot: Any, start: Number = 0) -> Value:
        """The number there, where each lane has a slot of its own, counted from one that all share."""
        program, builder = self._program, self._program.builder
        if not _differ(slot):
            return self.load(slot + start)
        found: Any = undefined(vector(program.real, program.lanes))
        for lane, place in self._each(slot, start):
            number = builder.load(place, typ=program.real)
            found = builder.insert_element(found, number, nth(lane))
        return Value(program, found)

    def scatter(self, slot: Any, value: Number, start: Number = 0) -> None:
        """Put a number there, where each lane has a slot of its own, counted from one that all share."""
        program, builder = self._program, self._program.builder
        if not _differ(slot):
            self.store(slot + start, value)
            return
        spread = program.spread(value)
        for lane, place in self._each(slot, start):
            builder.store(builder.extract_element(spread, nth(lane)), place)

    def _each(self, slot: Value, start: Number) -> Iterator[tuple[int, Any]]:
        """Lanes, and the place of each one's own slot."""
        program, base, own = self._program, self.place(start), slot * self._stride
        if self._lanes > 1:  # worlds lie side by side
            own = own + Value(program, ir.Constant(own.written.type, list(range(own.lanes))))
        for lane, offset in enumerate(program.indices(own)):
            yield lane, program.builder.gep(base, [offset], source_etype=program.real)

    def fetch(self, slot: Number, count: int = 1) -> None:
        """Ask memory ahead for that many numbers, where that helps; there need not be any."""
        if self._program.fetches:
            assert isinstance(self._stride, int), "rows of all worlds are not asked for ahead"
            for more in sorted(
                {*range(0, count, max(1, _SECTOR // (self._stride * size_of(self._program)))), count - 1}
            ):
                self._program.fetch(self.place(slot + more))

    def vector(self, slot: Number) -> tuple[Value, Value, Value]:
        """Three numbers from there on."""
        return self.load(slot), self.load(slot + 1), self.load(slot + 2)

    def put(self, slot: Number, values: Any) -> None:
        """Put numbers from there on."""
        for more, value in enumerate(values):
            self.store(slot + more, value)

    def place(self, slot: Number) -> Any:
        """LLVM's pointer to the number there."""
        program = self._program
        offset = program.index(slot) * self._stride
        return program.builder.gep(self._base, [offset.written], source_etype=program.real)

    def at(self, place: Any) -> "Lanes":
        """Numbers that lie as these do, from a pointer on."""
        return Lanes(self._program, place, self._stride)


class OwnRows:
    """Numbers of each world that lie world by world, in place of rows of one number for all worlds."""

    def __init__(self, program: Program, rows: Lanes, world: Value, size: Value) -> None:
        """Bind them.

        Args:
            program: to write to.
            rows: the array, bound as if it had such rows.
            world: number of the first of the program's worlds.
            size: numbers of each world.
        """
        self._program, self._size = program, size
        self._lanes = rows.flat(world * (size - 1))

    def put(self, slot: Number, values: Iterable[Number]) -> None:
        """Put numbers of each world from there on."""
        program, builder = self._program, self._program.builder
        for more, value in enumerate(values):
            if program.lanes == 1:
                self._lanes.store(slot + more, value)
                continue
            spread = program.spread(value)
            for lane in range(program.lanes):
                own = Value(program, builder.extract_element(spread, nth(lane)))
                self._lanes.store(self._size * lane + (slot + more), own)


class Shared:
    """Numbers that all worlds share."""

    def __init__(self, program: Program, base: Any, *, whole: bool = False) -> None:
        """`base` points at the first."""
        self._program, self._base = program, base
        self._kind = INDEX if whole else program.real

    def load(self, slot: Number) -> Value:
        """The number there, the same in all lanes where they do not have slots of their own."""
        if _differ(slot):
            return self.gather(slot)
        program = self._program
        place = program.builder.gep(self._base, [program.index(slot).written], source_etype=self._kind)
        return Value(program, program.builder.load(place, typ=self._kind))

    def store(self, slot: Number, value: Number) -> None:
        """Put a number there."""
        program = self._program
        place = program.builder.gep(self._base, [program.index(slot).written], source_etype=self._kind)
        program.builder.store(program.alone(value), place)

    def load_next(self, slot: Number) -> Value:
        """As many numbers from there on as stand side by side; where nothing does, the number there."""
        program = self._program
        if not program.in_lanes:
            return self.load(program.numbered(program.index(slot)))
        place = program.builder.gep(self._base, [program.index(slot).written], source_etype=self._kind)
        kind = vector(self._kind, program.abreast)
        return Value(program, program.builder.load(place, typ=kind, align=size_of(program)))

    def fetch(self, slot: Number, count: int = 1) -> None:
        """Nothing: what all worlds look at is near."""

    def gather(self, slot: Any) -> Value:
        """The number there, where each lane has a slot of its own."""
        program, builder = self._program, self._program.builder
        if not _differ(slot):
            return self.load(slot)
        found: Any = undefined(vector(self._kind, slot.lanes))
        for lane in range(slot.lanes):
            number = self.load(Value(program, builder.extract_element(slot.written, nth(lane))))
            found = builder.insert_element(found, number.written, nth(lane))
        return Value(program, found)


def _differ(slot: Any) -> bool:
    """Whether each lane has a slot of its own."""
    return isinstance(slot, Value) and slot.lanes > 1


class Numbers:
    """Numbers of a world's joints or links, thing after thing; or of so many things at a time, kind after kind."""

    def __init__(self, slots: Any, first: Any, size: int, abreast: int) -> None:
        """Bind them.

        Args:
            slots: the array.
            first: slot of the first thing's first number.
            size: how many numbers a thing has.
            abreast: things that stand side by side.
        """
        self._slots, self._first, self._size, self._abreast = slots, first, size, abreast

    def slot(self, thing: Any, number: int) -> Any:
        """Where a number of a thing lies."""
        if self._abreast == 1:
            return self._first + thing * self._size + number
        apart = self._abreast * (self._size - 1)
        return self._first + thing + thing // self._abreast * apart + number * self._abreast

    def load(self, thing: Any, number: int) -> Value:
        """A number of a thing, and of those that stand beside it."""
        return self._slots.load_next(self.slot(thing, number))

    def vector(self, thing: Any, number: int) -> tuple[Value, Value, Value]:
        """Three numbers of a thing."""
        return self.load(thing, number), self.load(thing, number + 1), self.load(thing, number + 2)

    def put(self, thing: Any, number: int, values: Any) -> None:
        """Put numbers of a thing, from one on."""
        for more, value in enumerate(values):
            self._slots.store_next(self.slot(thing, number + more), value)

    def fetch(self, thing: Any, number: int, count: int) -> None:
        """Ask memory ahead for numbers of a thing, from one on; there need not be such a thing."""
        self._slots.fetch(self.slot(thing, number), count)


class NumberRows(Numbers):
    """Numbers of spheres: where these stand side by side, a row of each kind, which any of them may be the first in."""

    def __init__(self, slots: Any, first: Any, size: int, row: Any) -> None:
        """`row`: slots of a row; None where spheres do not stand side by side."""
        super().__init__(slots, first, size, 1)
        self._row = row

    def slot(self, thing: Any, number: int) -> Any:
        """Where a number of a sphere lies."""
        return super().slot(thing, number) if self._row is None else self._first + self._row * number + thing


class Rows:
    """A table with rows of four numbers or a multiple: what a world looks up of a row, it reads by fours."""

    def __init__(self, program: Program, base: Any, fours: int) -> None:
        """`base` points at the first row, of `fours` times four numbers."""
        self._program, self._base, self._fours = program, base, fours
        self._seen: dict[Any, list[Value]] = {}

    def read(self, row: Value, column: int) -> Value:
        """A number of a row, which may be another one in each lane."""
        program = self._program
        key = (program.builder.block, row.written, column // 4)
        if key not in self._seen:
            self._seen[key] = self._four(row * (4 * self._fours), column // 4 * 4)
        return self._seen[key][column % 4]

    def _four(self, row: Value, column: int) -> list[Value]:
        program, builder = self._program, self._program.builder
        four, base = vector(program.real, 4), self._base
        if column:
            base = builder.gep(base, [nth(column)], source_etype=program.real)

        def loaded(at: Any) -> Any:
            pointer = builder.gep(base, [at], source_etype=program.real)
            return builder.load(pointer, typ=four, align=4 * size_of(program))

        lanes = row.lanes
        if lanes == 1:
            whole = loaded(row.written)
            return [Value(program, builder.extract_element(whole, nth(i))) for i in range(4)]
        parts = [loaded(each) for each in program.indices(row)]
        # Side by side, those of lanes k, k + 4, k + 8, ...; then turned, fours by fours: shuffles within 16 bytes.
        sides = [self._joined(parts[k::4]) for k in range(4)]
        low = [self._picked(sides[k], sides[k + 1], _TURN_LOW, lanes) for k in (0, 2)]
        high = [self._picked(sides[k], sides[k + 1], _TURN_HIGH, lanes) for k in (0, 2)]
        halves = _FIRST_HALF, _SECOND_HALF
        turned = [self._picked(pair[0], pair[1], half, lanes) for pair in (low, high) for half in halves]
        return [Value(program, each) for each in turned]

    def put(self, row: Value, column: int, values: Any) -> None:
        """Put four numbers of rows that stand side by side, from one of a row on."""
        program, builder = self._program, self._program.builder
        a, b, c, d = (program.spread(value) for value in values)
        lanes = program.abreast
        if not program.in_lanes:
            four: Any = undefined(vector(program.real, 4))
            for at, number in enumerate((a, b, c, d)):
                four = builder.insert_element(four, number, nth(at))
            self._store_four(program.numbered(row), column, four)
            return
        for apart in range(4):
            turn, half = (_TURN_LOW, _TURN_HIGH)[apart // 2], (_FIRST_HALF, _SECOND_HALF)[apart % 2]
            first, last = (self._picked(*pair, turn, lanes) for pair in ((a, b), (c, d)))
            rows = self._picked(first, last, half, lanes)
            for start in range(0, lanes, 4):
                four = order(*range(start, start + 4))
                self._store_four(row + (start + apart), column, builder.shuffle_vector(rows, rows, four))

    def _store_four(self, row: Value, column: int, four: Any) -> None:
        program, builder = self._program, self._program.builder
        slot = row * (4 * self._fours) + column
        place = builder.gep(self._base, [slot.written], source_etype=program.real)
        builder.store(four, place, align=4 * size_of(program))

    def _joined(self, parts: list[Any]) -> Any:
        builder = self._program.builder
        while len(parts) > 1:
            count = parts[0].type.count
            mask = order(*range(2 * count))
            parts = [builder.shuffle_vector(parts[i], parts[i + 1], mask) for i in range(0, len(parts), 2)]
        return parts[0]

    def _picked(self, first: Any, second: Any, pattern: tuple[int, ...], lanes: int) -> Any:
        """One choice, made of every four numbers of both."""
        mask = [4 * four + at % 4 + lanes * (at // 4) for four in range(lanes // 4) for at in pattern]
        return self._program.builder.shuffle_vector(first, second, order(*mask))


_TURN_LOW, _TURN_HIGH = (0, 4, 1, 5), (2, 6, 3, 7)
_FIRST_HALF, _SECOND_HALF = (0, 1, 4, 5), (2, 3, 6, 7)


def size_of(program: Program) -> int:
    """Bytes of a real number."""
    return 8 if isinstance(program.real, ir.DoubleType) else 4
