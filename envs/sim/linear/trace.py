"""Laws that are written for numpy and JAX, compiled: called once, with values that write down LLVM instructions.

A `Value` stands for one number a world, in as many worlds as the target has lanes (one on a GPU, where each world has a
thread). What numpy does with numbers, it writes down; `Program.xp` takes the place of numpy. Loops over links and nodes
stay loops (`Program.loop`), so that a program is as long as the law of one link.
"""

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np
from llvmlite import ir

INDEX = ir.IntType(32)
BIT = ir.IntType(1)
_FREE = ("reassoc", "contract", "arcp", "nsz")
"""What LLVM may do to sums and quotients: what is no number stays so, for the world that has it to be found."""

Number: TypeAlias = "Value | float | int"


@functools.cache
def vector(element: Any, count: int) -> Any:
    """LLVM's type of so many numbers side by side; made once, as constants are, since a program has thousands."""
    return ir.VectorType(element, count)


@functools.cache
def order(*numbers: int) -> Any:
    """LLVM's vector of whole numbers, such as those that a shuffle takes."""
    return ir.Constant(vector(INDEX, len(numbers)), list(numbers))


@functools.cache
def nth(number: int) -> Any:
    """LLVM's value of a whole number, such as that of a lane."""
    return ir.Constant(INDEX, number)


@functools.cache
def undefined(kind: Any) -> Any:
    """LLVM's value of that type that is still to be filled."""
    return ir.Constant(kind, ir.Undefined)


@functools.cache
def _constant(kind: Any, number: float, sign: float) -> Any:
    """LLVM's value of a number; `sign` tells the two zeros apart."""
    assert math.copysign(1.0, number) == sign
    return ir.Constant(kind, number)


@functools.cache
def _everywhere(constant: Any, lanes: int) -> Any:
    """LLVM's vector of one constant in all lanes."""
    return ir.Constant(vector(constant.type, lanes), [constant] * lanes)


class Value:
    """A number that is known when the program runs: real, whole, or true or false; in one world or in all lanes."""

    def __init__(self, program: "Program", written: Any) -> None:
        """`written` is LLVM's value."""
        self.program, self.written = program, written
        kind = written.type
        several = isinstance(kind, ir.VectorType)
        self.lanes: int = kind.count if several else 1
        """In how many worlds it is held; 1 for what all share."""
        self.element: Any = kind.element if several else kind
        """LLVM's type of one number."""
        self.whole = isinstance(self.element, ir.IntType)
        """Whether it is a whole number, or true or false."""

    def __add__(self, other: Number) -> "Value":
        return self.program.combine("add", self, other)

    def __sub__(self, other: Number) -> "Value":
        return self.program.combine("sub", self, other)

    def __mul__(self, other: Number) -> "Value":
        return self.program.combine("mul", self, other)

    def __truediv__(self, other: Number) -> "Value":
        return self.program.combine("div", self, other)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other: Number) -> "Value":
        return self.program.combine("sub", other, self)

    def __rtruediv__(self, other: Number) -> "Value":
        return self.program.combine("div", other, self)

    def __neg__(self) -> "Value":
        return (
            0 - self
            if self.whole
            else Value(self.program, self.program.builder.fneg(self.written, flags=self.program.flags))
        )

    def __pow__(self, power: int) -> "Value":
        assert power >= 1 and power == int(power), "only whole powers are written down"
        half = self if power == 1 else self ** (power // 2)
        return half if power == 1 else half * half * self if power % 2 else half * half

    def __mod__(self, divisor: "Value | int") -> "Value":
        """Rest of a whole number, as Python's: not negative."""
        program = self.program
        own, other = program.alike(self, divisor)
        rest = Value(program, program.builder.srem(own, other))
        return program.xp.where(rest < 0, rest + divisor, rest)

    def __floordiv__(self, divisor: "Value | int") -> "Value":
        """A whole number that is not negative, over another, without the rest."""
        return Value(self.program, self.program.builder.udiv(*self.program.alike(self, divisor)))

    def __lt__(self, other: Number) -> "Value":
        return self.program.compare("<", self, other)

    def __le__(self, other: Number) -> "Value":
        return self.program.compare("<=", self, other)

    def __gt__(self, other: Number) -> "Value":
        return self.program.compare(">", self, other)

    def __ge__(self, other: Number) -> "Value":
        return self.program.compare(">=", self, other)

    def __ne__(self, other: object) -> Any:
        return self.program.compare("!=", self, other)

    def __eq__(self, other: object) -> Any:
        return self.program.compare("==", self, other)

    __hash__ = object.__hash__

    def __and__(self, other: "Value | int") -> "Value":
        return Value(self.program, self.program.builder.and_(*self.program.alike(self, other)))

    def __or__(self, other: "Value") -> "Value":
        return Value(self.program, self.program.builder.or_(*self.program.alike(self, other)))

    def __invert__(self) -> "Value":
        return Value(self.program, self.program.builder.not_(self.written))

    def __bool__(self) -> bool:
        raise TypeError("A law that branches on numbers cannot be written down: use xp.where.")


class Program:
    """One function under construction, for worlds in lanes."""

    def __init__(
        self, name: str, arguments: Sequence[Any], *, lanes: int, real: np.dtype, approximate: bool = False
    ) -> None:
        """Begin.

        Args:
            name: of the function.
            arguments: LLVM types of its arguments; pointers are to arrays that do not overlap.
            lanes: worlds that one instruction serves.
            real: precision of real numbers.
            approximate: whether quotients and roots may be off in their last digits, as graphics processors have them.
        """
        self.lanes = lanes
        self.flags: tuple[str, ...] = (*_FREE, *(("afn",) if approximate else ()))
        """What LLVM may do to sums and quotients."""
        self.fetches = False
        """Whether memory is asked ahead for what will be read soon."""
        self.abreast = 1
        """How many things of one world its lanes hold now (`side_by_side`)."""
        self.real = ir.DoubleType() if np.dtype(real) == np.float64 else ir.FloatType()
        self.module = ir.Module(name)
        self.function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), arguments), name)
        for argument in self.function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        self._entry = self.function.append_basic_block("entry")
        self.builder = ir.IRBuilder(self.function.append_basic_block("begin"))
        self.xp = Mathematics(self)
        self._known: dict[Any, Any] = {}

    def finish(self) -> str:
        """The function in LLVM's language."""
        self.builder.ret_void()
        with self.builder.goto_block(self._entry):
            self.builder.branch(self.function.basic_blocks[1])
        return str(self.module)

    def limit_registers(self, most: int) -> None:
        """Let a thread of the kernel that this is have so many registers at most."""
        about = self.module.add_metadata([self.function, "maxnreg", ir.Constant(INDEX, most)])
        self.module.add_named_metadata("nvvm.annotations", about)

    def constant(self, number: float, like: Any = None) -> Value:
        """A number of that LLVM type, or real."""
        kind = like or self.real
        exact = int(number) if isinstance(kind, ir.IntType) else float(number)
        return Value(self, _constant(kind, exact, math.copysign(1.0, exact)))

    def index(self, number: Number) -> Value:
        """A whole number that all worlds share."""
        return number if isinstance(number, Value) else self.constant(number, INDEX)

    def spread(self, value: Number) -> Any:
        """LLVM's value of a number in all lanes."""
        own = value if isinstance(value, Value) else self.constant(value)
        if own.lanes == self.lanes:
            return own.written
        if isinstance(own.written, ir.Constant):
            return _everywhere(own.written, self.lanes)
        empty = undefined(vector(own.element, self.lanes))
        first = self.builder.insert_element(empty, own.written, nth(0))
        return self.builder.shuffle_vector(first, first, order(*[0] * self.lanes))

    def alone(self, value: Number) -> Any:
        """LLVM's value of a number that is not spread."""
        return (value if isinstance(value, Value) else self.constant(value)).written

    @contextmanager
    def side_by_side(self, count: int, registers: int = 1) -> Iterator[int]:
        """Let so many registers hold `count` things of one world each, instead of a number of several worlds.

        1 changes nothing. Tells how many things they hold together.
        """
        if count == 1:
            yield 1
            return
        assert self.lanes == 1, "worlds stand in the lanes already"
        self.lanes = self.abreast = count * registers
        yield self.abreast
        self.lanes = self.abreast = 1

    @property
    def in_lanes(self) -> bool:
        """Whether things of one world stand in the lanes of an instruction now: side by side, and not in threads."""
        return self.abreast > 1 and self.lanes > 1

    def settle(self) -> None:
        """Wait until all of a team have read and written what they had to, where there is one."""

    def reads(self) -> None:
        """Take note that a number of the world is read."""

    def writes(self) -> None:
        """Make sure that a number of the world may be written to."""

    def numbered(self, first: Value) -> Value:
        """Whole numbers from one on, of what stands side by side; where nothing does, the first."""
        if self.abreast == 1:
            return first
        return first + Value(self, order(*range(self.abreast)))

    def apart(self, value: Value) -> list[Value]:
        """A number of each thing that stands side by side."""
        if self.abreast == 1:
            return [value]
        spread, builder = self.spread(value), self.builder
        return [Value(self, builder.extract_element(spread, nth(lane))) for lane in range(self.abreast)]

    def indices(self, value: Value) -> list[Any]:
        """LLVM's values of a whole number that differs by lane, as wide as addresses are."""
        if ("indices", value.written) not in self._known:
            builder, lanes = self.builder, range(value.lanes)
            own = [builder.extract_element(value.written, nth(lane)) for lane in lanes]
            self._known["indices", value.written] = [builder.sext(each, ir.IntType(64)) for each in own]
        return self._known["indices", value.written]

    def together(self, values: Sequence[Value]) -> Value:
        """What `apart` took apart."""
        if self.abreast == 1:
            return values[0]
        found: Any = undefined(vector(values[0].element, self.abreast))
        for lane, value in enumerate(values):
            found = self.builder.insert_element(found, value.written, nth(lane))
        return Value(self, found)

    def fetch(self, pointer: Any) -> None:
        """Let what is in memory there come nearer, on a graphics processor."""
        address: Any = self.builder.ptrtoint(pointer, ir.IntType(64))
        kind = ir.FunctionType(ir.VoidType(), [address.type])
        self.builder.asm(kind, "prefetch.L1 [$0];", "l", [address], side_effect=True)

    def later(self, before: Value, now: Value) -> Value:
        """Numbers of what stands side by side, each in the place of the next; the first is the last of `before`."""
        mask = order(*range(self.abreast - 1, 2 * self.abreast - 1))
        return Value(self, self.builder.shuffle_vector(before.written, now.written, mask))

    def alike(self, first: Any, second: Any) -> tuple[Any, Any]:
        """LLVM's values of two numbers, of one type: real if either is, in all lanes if either is."""
        if not isinstance(first, Value):
            first = self._fitting(first, second.element)
        elif not isinstance(second, Value):
            second = self._fitting(second, first.element)
        if first.whole != second.whole:
            first, second = self._as_real(first), self._as_real(second)
        if first.lanes != second.lanes:
            return self.spread(first), self.spread(second)
        return first.written, second.written

    def _fitting(self, number: float, element: Any) -> Value:
        whole = isinstance(element, ir.IntType) and isinstance(number, (int, np.integer))
        return self.constant(number, element if whole else self.real)

    def _as_real(self, value: Value) -> Value:
        if not value.whole:
            return value
        kind = self.real if value.lanes == 1 else vector(self.real, value.lanes)
        return Value(self, self.builder.sitofp(value.written, kind))

    def combine(self, what: str, first: Any, second: Any) -> Value:
        """Sum, difference, product or quotient."""
        a, b = self.alike(first, second)
        whole = Value(self, a).whole
        if not whole or what == "div":
            if whole:
                a, b = (self._as_real(Value(self, each)).written for each in (a, b))
            return Value(self, getattr(self.builder, f"f{what}")(a, b, flags=self.flags))
        # Whole numbers are rows of tables: the same one is to be known again. None is as large as to wrap around.
        key = (what, str(a) if isinstance(a, ir.Constant) else a, str(b) if isinstance(b, ir.Constant) else b)
        if key not in self._known:
            self._known[key] = Value(self, getattr(self.builder, what)(a, b, flags=("nsw",)))
        return self._known[key]

    def compare(self, what: str, first: Any, second: Any) -> Value:
        """Whether; false where one is no number, but for '!='."""
        a, b = self.alike(first, second)
        if Value(self, a).whole:
            return Value(self, self.builder.icmp_signed(what, a, b))
        compared = self.builder.fcmp_unordered if what == "!=" else self.builder.fcmp_ordered
        return Value(self, compared(what, a, b))

    def call(self, name: str, *values: Value) -> Value:
        """One of LLVM's intrinsics of real numbers."""
        written = values[0].written
        suffix = ("f64" if isinstance(self.real, ir.DoubleType) else "f32") if values[0].lanes == 1 else (
            f"v{self.lanes}" + ("f64" if isinstance(self.real, ir.DoubleType) else "f32")
        )  # fmt: skip
        kind = ir.FunctionType(written.type, [written.type] * len(values))
        function = self._declared(f"llvm.{name}.{suffix}", kind)
        return Value(self, self.builder.call(function, [each.written for each in values], fastmath=self.flags))

    def _declared(self, name: str, kind: Any) -> Any:
        known = self.module.globals.get(name)
        return known if known is not None else ir.Function(self.module, kind, name)

    def whole(self, value: Value) -> Value:
        """The whole part; 0 of what is no number."""
        if value.lanes == 1:
            real = "f64" if isinstance(self.real, ir.DoubleType) else "f32"
            function = self._declared(f"llvm.fptosi.sat.i32.{real}", ir.FunctionType(INDEX, [value.written.type]))
            return Value(self, self.builder.call(function, [value.written]))
        # LLVM takes what saturates apart, lane by lane.
        sound = self.xp.where(value == value, self.xp.clip(value, -_WHOLE, _WHOLE), 0.0)
        return Value(self, self.builder.fptosi(sound.written, vector(INDEX, value.lanes)))

    def any(self, condition: Value) -> Any:
        """LLVM's value of whether it holds in any lane."""
        if condition.lanes == 1:
            return condition.written
        kind = condition.written.type
        name = f"llvm.vector.reduce.or.v{condition.lanes}i1"
        return self.builder.call(self._declared(name, ir.FunctionType(BIT, [kind])), [condition.written])

    def most(self, value: Value, *, least: bool = False) -> Value:
        """The largest of a whole number's lanes, or the least, which all share."""
        if value.lanes == 1:
            return value
        name = f"llvm.vector.reduce.{'smin' if least else 'smax'}.v{value.lanes}i32"
        kind = ir.FunctionType(INDEX, [value.written.type])
        return Value(self, self.builder.call(self._declared(name, kind), [value.written]))

    def real_of(self, value: Value) -> Value:
        """A whole number as a real one."""
        return self._as_real(value)

    @contextmanager
    def loop(self, start: Number, stop: Number, *, backwards: bool = False) -> Iterator[Value]:
        """Count from `start` to before `stop`, or the same backwards; both are shared by all worlds."""
        first, last = self.index(start), self.index(stop)
        counter = self.variable(last - 1 if backwards else first, kind=INDEX)
        test, body, after = (self.function.append_basic_block(part) for part in ("test", "body", "after"))
        self.go(test)
        now = counter.value
        self.builder.cbranch((now >= first if backwards else now < last).written, body, after)
        self._enter(body)
        yield now
        counter.value = now - 1 if backwards else now + 1
        self.go(test, enter=after)

    @contextmanager
    def repeat(self, going: Callable[[], Value]) -> Iterator[None]:
        """Do something again and again, as long as a condition holds in any lane."""
        test, body, after = (self.function.append_basic_block(part) for part in ("again", "held", "after"))
        self.go(test)
        self.builder.cbranch(self.any(going()), body, after)
        self._enter(body)
        yield
        self.go(test, enter=after)

    @contextmanager
    def when(self, condition: Value) -> Iterator[None]:
        """Do something only if the condition holds in any lane."""
        held, after = (self.function.append_basic_block(part) for part in ("held", "after"))
        self.builder.cbranch(self.any(condition), held, after)
        self._enter(held)
        yield
        self.go(after)

    def go(self, block: Any, *, enter: Any = None) -> None:
        """Go on in a block; what is written next stands there, or in `enter`."""
        self.builder.branch(block)
        self._enter(enter or block)

    def _enter(self, block: Any) -> None:
        self.builder.position_at_end(block)
        self._known = {}

    def variable(self, value: Number, *, kind: Any = None) -> "Variable":
        """A number that may change; real, in all lanes, unless a type is given."""
        return Variable(self, value, kind or (self.real if self.lanes == 1 else vector(self.real, self.lanes)))

    def allocated(self, kind: Any) -> Any:
        """Room for one value."""
        with self.builder.goto_block(self._entry):
            return self.builder.alloca(kind)


_WHOLE = float(np.nextafter(np.float32(2**31), np.float32(0)))
"""The largest whole number of 32 bits that is a number of single precision too."""

_LEAST = 1e-30
"""What a quotient is divided by at least where both of its parts may be nothing."""


class Variable:
    """A number that may change while the program runs."""

    def __init__(self, program: Program, value: Number, kind: Any) -> None:
        """Begin with a value."""
        self._program, self._kind = program, kind
        self._place = program.allocated(kind)
        self.value = value

    @property
    def value(self) -> Any:
        """The value now."""
        return Value(self._program, self._program.builder.load(self._place, typ=self._kind))

    @value.setter
    def value(self, value: Number) -> None:
        program = self._program
        spread = isinstance(self._kind, ir.VectorType) and not (isinstance(value, Value) and value.whole)
        program.builder.store(program.spread(value) if spread else program.alone(value), self._place)


class Changing:
    """A tuple of numbers that may change."""

    def __init__(self, program: Program, values: Any) -> None:
        """Begin with these values."""
        self._parts = [program.variable(value) for value in values]

    @property
    def now(self) -> Any:
        """The numbers now."""
        return tuple(part.value for part in self._parts)

    @now.setter
    def now(self, values: Any) -> None:
        for part, value in zip(self._parts, values, strict=True):
            part.value = value


class Mathematics:
    """What laws ask of numpy or jax.numpy, in a program."""

    nan = float("nan")

    def __init__(self, program: Program) -> None:
        """For values of that program."""
        self._program = program

    def where(self, condition: Value, yes: Number, no: Number) -> Value:
        """As numpy's."""
        program = self._program
        if not isinstance(yes, Value) and not isinstance(no, Value):
            yes = program.constant(yes)
        a, b = program.alike(yes, no)
        lanes = max(condition.lanes, Value(program, a).lanes)
        if lanes > 1:
            a, b = program.spread(Value(program, a)), program.spread(Value(program, b))
        return Value(program, program.builder.select(condition.written, a, b))

    def minimum(self, a: Number, b: Number) -> Value:
        """As numpy's, but for what is no number: the second."""
        return self.where(self._program.compare("<", a, b), a, b)

    def maximum(self, a: Number, b: Number) -> Value:
        """As numpy's, but for what is no number: the second."""
        return self.where(self._program.compare(">", a, b), a, b)

    def clip(self, value: Number, low: Number, high: Number) -> Value:
        """As numpy's."""
        return self.maximum(self.minimum(value, high), low)

    def abs(self, value: Value) -> Value:
        """As numpy's."""
        return self._program.call("fabs", value)

    def sqrt(self, value: Value) -> Value:
        """As numpy's."""
        return self._program.call("sqrt", value)

    def floor(self, value: Value) -> Value:
        """As numpy's."""
        return self._program.call("floor", value)

    def rint(self, value: Value) -> Value:
        """As numpy's."""
        return self._program.call("rint", value)

    def int32(self, value: Value) -> Value:
        """The whole part; 0 of what is no number."""
        return self._program.whole(value)

    def isfinite(self, value: Value) -> Value:
        """As numpy's."""
        return self.abs(value) < float(np.finfo(np.float32).max)

    def exp(self, value: Value) -> Value:
        """As numpy's, from -40 to 40: the series of a 64th part, squared six times."""
        return self._series(_EXP, self.clip(value, -40.0, 40.0) * (1 / 64)) ** 64

    def sine_versine(self, angle: Value) -> tuple[Value, Value]:
        """Sine and 1 - cosine: series of a quarter of the angle within a turn, doubled twice."""
        turns = self.floor(angle * (0.5 / np.pi) + 0.5)
        high = float(np.float32(2 * np.pi) // 2**-10 * 2**-10)
        quarter = (angle - turns * high - turns * (2 * np.pi - high)) * 0.25
        square = quarter * quarter
        sine, versine = quarter * self._series(_SIN, square), square * self._series(_VERSINE, square)
        for _ in range(2):
            sine, versine = 2.0 * sine * (1.0 - versine), 2.0 * sine * sine
        return sine, versine

    def sin(self, angle: Value) -> Value:
        """As numpy's."""
        return self.sine_versine(angle)[0]

    def cos(self, angle: Value) -> Value:
        """As numpy's."""
        return 1.0 - self.sine_versine(angle)[1]

    def arctan2(self, y: Value, x: Value) -> Value:
        """As numpy's."""
        across, along = self.abs(y), self.abs(x)
        less, more = self.minimum(across, along), self.maximum(across, along)
        # Within an eighth of a turn; beyond half of that, from its bisector.
        steep = less > more * float(np.tan(np.pi / 8))
        ratio = self.where(steep, less - more, less) / self.maximum(self.where(steep, less + more, more), _LEAST)
        angle = ratio * self._series(_ARCTAN, ratio * ratio) + self.where(steep, np.pi / 4, 0.0)
        angle = self.where(across > along, np.pi / 2 - angle, angle)
        angle = self.where(x < 0, np.pi - angle, angle)
        return self.where(y < 0, -angle, angle)

    def _series(self, terms: np.ndarray, at: Value) -> Value:
        """Polynomial of as many terms as the precision is worth."""
        double = isinstance(self._program.real, ir.DoubleType)
        used = terms if double else terms[: len(terms) // 2 + 1]
        total: Any = float(used[-1])
        for term in used[-2::-1]:
            total = at * total + float(term)
        return total


def _factorials(start: int, count: int, sign: int) -> np.ndarray:
    """1 / start!, sign / (start + 2)!, ..."""
    grown = np.cumprod([1.0, *range(1, start + 2 * count)])
    return np.array([sign**i / grown[start + 2 * i] for i in range(count)])


_SIN, _VERSINE = _factorials(1, 10, -1), _factorials(2, 10, -1)
_EXP = 1 / np.cumprod([1.0, *range(1, 14)])
_ARCTAN = np.array([(-1) ** i / (2 * i + 1) for i in range(20)])
