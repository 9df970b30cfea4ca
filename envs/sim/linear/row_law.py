"""Laws over short arrays of a world's numbers, written for numpy and JAX, compiled: called once, with what writes them.

Numpy asks a microsecond for each of the hundreds of sums and quotients of such a law, however few the numbers; machine
code asks less for all of them. A `Row` stands for an array of one world's numbers, each of which is written down alone.
"""

import ctypes
import operator
from collections.abc import Callable, Sequence
from functools import cache, reduce
from typing import Any

import numpy as np
from jaxtyping import Float
from llvmlite import ir

from haustra.envs.sim.linear.compile import engine_of
from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.trace import INDEX, Program, Value

Size = int | None
"""Numbers of an array that each world has; None: one number, without an axis."""


class RowLaw:
    """A law as machine code, in double precision: rows of what each world gives it in, rows of what it says out."""

    def __init__(self, law: Callable[..., Sequence[Any]], given: tuple[Size, ...]) -> None:
        """Compile, or read what was compiled before.

        Args:
            law: of (xp, ...), with an array for each of `given`; it returns arrays.
            given: sizes of the arrays, which lie side by side in a row.
        """
        program = Program("advance", [ir.PointerType(), ir.PointerType(), INDEX], lanes=1, real=np.dtype(float))
        source, target, count = program.function.args
        taken = sum(size or 1 for size in given)
        with program.loop(0, Value(program, count)) as world:
            own = _behind(program, source, world * taken)
            found = law(RowMathematics(program), *_loaded(own, given))
            numbers = [np.atleast_1d(each.numbers) for each in found]
            self._tells = sum(map(len, numbers))
            to = _behind(program, target, world * self._tells)
            to.put(0, [_real(each) for each in np.concatenate(numbers)])
        self._engine = engine_of(program.finish())
        kinds = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int32
        self._function = ctypes.CFUNCTYPE(None, *kinds)(self._engine.get_function_address("advance"))

    def __call__(self, given: Float[np.ndarray, "worlds given"]) -> Float[np.ndarray, "worlds told"]:
        """What the law says of each world."""
        rows = np.ascontiguousarray(given, float)
        told = np.empty((len(rows), self._tells))
        self._function(rows.ctypes.data, told.ctypes.data, len(rows))
        return told


row_law = cache(RowLaw)
"""`RowLaw`, once in a process for the same law."""


class Row:
    """An array of numbers of a program, one world's; numpy's operators write down what they do to each."""

    __array_ufunc__ = None  # an array of numpy's leaves its operators to this

    def __init__(self, numbers: Any) -> None:
        """Hold an object array of values and plain numbers."""
        self.numbers = np.asarray(numbers, dtype=object)
        self.shape, self.dtype = self.numbers.shape, np.dtype(float)

    def __getitem__(self, at: Any) -> "Row":
        return Row(self.numbers[at])

    def sum(self, axis: int) -> "Row":
        """The sum of all numbers, which have one axis."""
        assert self.numbers.ndim == 1 and axis == -1, "rows have one axis"
        return Row(reduce(operator.add, map(_real, self.numbers)))

    def __neg__(self) -> "Row":
        return _each(lambda one: 0.0 - _real(one), self)


def _each(operation: Callable[..., Any], *arrays: Any) -> Row:
    """An operation on each number."""
    numbers = (each.numbers if isinstance(each, Row) else np.asarray(each, dtype=object) for each in arrays)
    return Row(np.frompyfunc(operation, len(arrays), 1)(*numbers))


def _real(number: Any) -> Any:
    """A number to reckon with: 1 for true, 0 for false."""
    if not isinstance(number, Value):
        return float(number)
    return number.program.xp.where(number, 1.0, 0.0) if number.whole else number


def _operator(operation: Callable[[Any, Any], Any], *, turned: bool = False) -> Callable[[Row, Any], Row]:
    def both(a: Any, b: Any) -> Any:
        return operation(_real(a), _real(b))

    return lambda self, other: _each(both, other, self) if turned else _each(both, self, other)


for _name in ("add", "sub", "mul", "truediv"):
    setattr(Row, f"__{_name}__", _operator(getattr(operator, _name)))
    setattr(Row, f"__r{_name}__", _operator(getattr(operator, _name), turned=True))
for _name in ("lt", "le", "gt", "ge", "eq"):
    setattr(Row, f"__{_name}__", _operator(getattr(operator, _name)))


class RowMathematics:
    """What laws over short arrays ask of numpy or jax.numpy, in a program."""

    def __init__(self, program: Program) -> None:
        """For values of that program."""
        self._program, self._own = program, program.xp

    def asarray(self, values: Any, dtype: Any = None) -> Row:
        """As numpy's; there is one precision."""
        return values if isinstance(values, Row) else Row(values)

    def zeros_like(self, row: Row) -> Row:
        """As numpy's."""
        return Row(np.zeros(row.numbers.shape, dtype=object))

    def concatenate(self, rows: Sequence[Row], axis: int) -> Row:
        """As numpy's."""
        return Row(np.concatenate([each.numbers for each in rows], axis))

    def stack(self, rows: Sequence[Row], axis: int) -> Row:
        """As numpy's."""
        return Row(np.stack([each.numbers for each in rows], axis))

    def where(self, condition: Any, yes: Any, no: Any) -> Row:
        """As numpy's."""

        def picked(holds: Any, a: Any, b: Any) -> Any:
            return self._own.where(holds, a, b) if isinstance(holds, Value) else a if holds else b

        return _each(picked, condition, yes, no)

    def minimum(self, a: Any, b: Any) -> Row:
        """As numpy's, but for what is no number."""
        return _each(lambda one, other: self._own.minimum(self._value(one), self._value(other)), a, b)

    def maximum(self, a: Any, b: Any) -> Row:
        """As numpy's, but for what is no number."""
        return _each(lambda one, other: self._own.maximum(self._value(one), self._value(other)), a, b)

    def exp(self, row: Any) -> Row:
        """As the C library's."""
        return _each(lambda one: self._program.call("exp", self._value(one)), row)

    def log(self, row: Any) -> Row:
        """As the C library's."""
        return _each(lambda one: self._program.call("log", self._value(one)), row)

    def sqrt(self, row: Any) -> Row:
        """As numpy's."""
        return _each(lambda one: self._own.sqrt(self._value(one)), row)

    def _value(self, number: Any) -> Value:
        real = _real(number)
        return real if isinstance(real, Value) else self._program.constant(real)


def _behind(program: Program, base: Any, start: Value) -> Lanes:
    """A world's own row, so many numbers behind the first."""
    return Lanes(program, program.builder.gep(base, [start.written], source_etype=program.real), 1)


def _loaded(own: Lanes, sizes: Sequence[Size]) -> list[Row]:
    found, start = [], 0
    for size in sizes:
        numbers = [own.load(start + more) for more in range(size or 1)]
        found.append(Row(numbers[0] if size is None else numbers))
        start += size or 1
    return found
