"""Derivatives beside numbers: the same laws, written down once more with what each step of them does to derivatives.

A `Dual` is a number together with its derivatives along some directions (forward differentiation). A program of them is
the plain one and, beside every operation on numbers, the chain rule for it. Derivatives of one number stand together in
one vector, direction after direction and in each the worlds of the lanes, so that the number is computed once for all
directions. What a choice leaves out does not count: `where` has the derivative of what it takes, and so have limits,
absolute values and look-ups; what is whole has none.
"""

from typing import Any

import numpy as np
from llvmlite import ir

from haustra.envs.sim.linear.memory import Lanes, size_of
from haustra.envs.sim.linear.trace import Mathematics, Number, Program, Value, Variable, nth, order, undefined, vector


class Dual(Value):
    """A real number in all lanes, and its derivatives."""

    program: "DualProgram"

    def __init__(self, program: "DualProgram", written: Any, slopes: Any) -> None:
        """`slopes`: LLVM's vector of derivatives, those of all lanes along the first direction first."""
        super().__init__(program, written)
        self.slopes = slopes

    def __neg__(self) -> Value:
        """As of any value."""
        return self.program.chain(super().__neg__(), (-1.0, self))


class DualProgram(Program):
    """A function under construction that carries derivatives."""

    def __init__(self, name: str, arguments: Any, *, directions: int, **about: Any) -> None:
        """Begin.

        Args:
            name: of the function.
            arguments: as of `Program`.
            directions: along how many there are derivatives.
            about: the rest of what `Program` wants.
        """
        super().__init__(name, arguments, **about)
        self.directions = directions
        self.slopes = vector(self.real, directions * self.lanes)
        self.xp = DualMathematics(self)

    def combine(self, what: str, first: Any, second: Any) -> Value:
        """As of any program, by the rule of sums, products and quotients."""
        value = super().combine(what, first, second)
        if not isinstance(first, Dual) and not isinstance(second, Dual):
            return value
        a, b = _plain(first), _plain(second)
        if what in ("add", "sub"):
            return self.chain(value, (1.0, first), (1.0 if what == "add" else -1.0, second))
        if what == "mul":
            return self.chain(value, (b, first), (a, second))
        inverse = 1.0 / b
        return self.chain(value, (inverse, first), (-value * inverse, second))

    def call(self, name: str, *values: Value) -> Value:
        """As of any program: absolute values and roots have derivatives; a root of 0 has none, and a floor never."""
        found = super().call(name, *values)
        (at,) = values
        if not isinstance(at, Dual) or name in ("floor", "rint"):
            return found
        rate = {
            "fabs": lambda: self.xp.where(at < 0, -1.0, 1.0),
            "sqrt": lambda: self.xp.where(found > 0, 0.5 / found, 0.0),
        }[name]()
        return self.chain(found, (rate, at))

    def chain(self, found: Value, *parts: tuple[Number, Any]) -> Value:
        """A value by the chain rule: its rate over each number that it was made from, and that number."""
        builder: Any = self.builder
        total = None
        for rate, of in parts:
            if isinstance(of, Dual):
                own = self._as_real(rate) if isinstance(rate, Value) else rate
                more = builder.fmul(self.beside(own), of.slopes, flags=self.flags)
                total = more if total is None else builder.fadd(total, more, flags=self.flags)
        return found if total is None else Dual(self, self.spread(found), total)

    def variable(self, value: Number, *, kind: Any = None) -> Variable:
        """A number that may change, and its derivatives with it."""
        return super().variable(value, kind=kind) if kind else DualVariable(self, value)

    def beside(self, value: Number) -> Any:
        """LLVM's vector with a number of the worlds beside each of its derivatives."""
        if not isinstance(value, Value):
            return ir.Constant(self.slopes, [float(value)] * self.slopes.count)
        own = self.spread(value)
        mask = [lane for _ in range(self.directions) for lane in range(self.lanes)]
        if self.lanes == 1:
            empty = undefined(vector(own.type, 1))
            own = self.builder.insert_element(empty, own, nth(0))
        return self.builder.shuffle_vector(own, own, order(*mask))

    def slopes_of(self, value: Number) -> Any:
        """LLVM's vector of the derivatives of a number."""
        return value.slopes if isinstance(value, Dual) else self.beside(0.0)


class DualVariable(Variable):
    """A number that may change while the program runs, with its derivatives."""

    def __init__(self, program: DualProgram, value: Number) -> None:
        """Begin with a value."""
        self._dual, self._slopes = program, program.allocated(program.slopes)
        lanes = vector(program.real, program.lanes)
        super().__init__(program, value, program.real if program.lanes == 1 else lanes)

    @property
    def value(self) -> Any:
        """The value now."""
        program = self._dual
        written = program.builder.load(self._place, typ=self._kind)
        return Dual(program, written, program.builder.load(self._slopes, typ=program.slopes))

    @value.setter
    def value(self, value: Number) -> None:
        program = self._dual
        program.builder.store(program.spread(value), self._place)
        program.builder.store(program.slopes_of(value), self._slopes)


class DualMathematics(Mathematics):
    """What laws ask of numpy, with derivatives: series are not differentiated, but what they stand for."""

    _program: DualProgram

    def where(self, condition: Value, yes: Number, no: Number) -> Value:
        """As numpy's."""
        program, found = self._program, super().where(condition, yes, no)
        if not isinstance(yes, Dual) and not isinstance(no, Dual):
            return found
        chosen = condition.written if condition.lanes == 1 and program.lanes > 1 else program.beside(condition)
        slopes = program.builder.select(chosen, program.slopes_of(yes), program.slopes_of(no))
        return Dual(program, program.spread(found), slopes)

    def exp(self, value: Value) -> Value:
        """As numpy's."""
        power = super().exp(_plain(value))
        return self._program.chain(power, (power, value))

    def sine_versine(self, angle: Value) -> tuple[Value, Value]:
        """Sine and 1 - cosine."""
        sine, versine = super().sine_versine(_plain(angle))
        chain = self._program.chain
        return chain(sine, (1.0 - versine, angle)), chain(versine, (sine, angle))

    def arctan2(self, y: Value, x: Value) -> Value:
        """As numpy's."""
        up, along = _plain(y), _plain(x)
        share = 1.0 / (up * up + along * along)
        return self._program.chain(super().arctan2(up, along), (along * share, y), (-up * share, x))


class DualLanes(Lanes):
    """Numbers that each world has of its own, and behind all of them their derivatives, in the same order."""

    _program: DualProgram

    def __init__(self, program: DualProgram, base: Any, stride: int, *, slopes: Any) -> None:
        """`base` points at slot 0 and `slopes` at its derivatives; `stride` is how many lanes there are."""
        assert stride == program.lanes, "derivatives are carried on a CPU"
        super().__init__(program, base, stride)
        self._slopes = slopes

    @classmethod
    def behind(cls, program: DualProgram, base: Any, stride: int, *, slots: Value) -> "DualLanes":
        """Numbers with their derivatives behind so many of them."""
        slopes = program.builder.gep(base, [(slots * stride).written], source_etype=program.real)
        return cls(program, base, stride, slopes=slopes)

    def from_slot(self, slot: Number) -> "DualLanes":
        """These numbers, counted from a slot on."""
        return DualLanes(self._program, self.place(slot), self._stride, slopes=self._at(slot))

    def load(self, slot: Number) -> Value:
        """The number there."""
        program = self._program
        slopes = program.builder.load(self._at(slot), typ=program.slopes, align=size_of(program))
        return Dual(program, super().load(slot).written, slopes)

    def store(self, slot: Number, value: Number) -> None:
        """Put a number there."""
        program = self._program
        super().store(slot, value)
        program.builder.store(program.slopes_of(value), self._at(slot), align=size_of(program))

    def gather(self, slot: Value, start: Number = 0) -> Value:
        """The number there, where each lane has a slot of its own, counted from one that all share."""
        program, builder = self._program, self._program.builder
        found = super().gather(slot, start)
        if isinstance(found, Dual):
            return found
        slopes: Any = undefined(program.slopes)
        for place, where in self._each_slope(slot + start):
            slopes = builder.insert_element(slopes, builder.load(where, typ=program.real), nth(place))
        return Dual(program, found.written, slopes)

    def scatter(self, slot: Value, value: Number, start: Number = 0) -> None:
        """Put a number there, where each lane has a slot of its own, counted from one that all share."""
        super().scatter(slot, value, start)
        program, builder = self._program, self._program.builder
        if slot.lanes == 1:
            return
        slopes = program.slopes_of(value)
        for place, where in self._each_slope(slot + start):
            builder.store(builder.extract_element(slopes, nth(place)), where)

    def _at(self, slot: Number) -> Any:
        program = self._program
        offset = program.index(slot) * program.slopes.count
        return program.builder.gep(self._slopes, [offset.written], source_etype=program.real)

    def _each_slope(self, slot: Value) -> Any:
        """Places in a vector of derivatives, and where each lane's own slot has them."""
        program, builder = self._program, self._program.builder
        offset = (slot * program.slopes.count).written
        for lane in range(program.lanes):
            own = builder.extract_element(offset, nth(lane))
            for place in range(lane, program.slopes.count, program.lanes):
                at = builder.add(own, nth(place))
                yield place, builder.gep(self._slopes, [at], source_etype=program.real)


def with_slopes(values: np.ndarray, directions: int) -> np.ndarray:
    """Numbers of blocks of worlds (blocks, slots, lanes), and room for their derivatives behind them, all 0."""
    return np.pad(values, ((0, 0), (0, directions * values.shape[1]), (0, 0)))


def _plain(value: Any) -> Any:
    """The number without derivatives."""
    return Value(value.program, value.written) if isinstance(value, Dual) else value
