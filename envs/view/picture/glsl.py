"""Laws written for numpy, as text of a shader: called once, with values that write down OpenGL's shading language.

As `haustra.envs.sim.linear.trace` does in LLVM's: what numpy does with numbers, a `Number` writes down, and
`Shader.xp` takes the place of numpy.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

REAL, WHOLE, TRUTH = "float", "int", "bool"
"""The language's names of real and whole numbers, and of true and false."""


class Number:
    """A number of one shader."""

    def __init__(self, shader: "Glsl", kind: str, text: str) -> None:
        """`text` is its name, or a constant."""
        self.shader, self.kind, self.text = shader, kind, text

    def __add__(self, other: Any) -> "Number":
        return self.shader.combine("+", self, other)

    def __sub__(self, other: Any) -> "Number":
        return self.shader.combine("-", self, other)

    def __mul__(self, other: Any) -> "Number":
        return self.shader.combine("*", self, other)

    def __truediv__(self, other: Any) -> "Number":
        return self.shader.combine("/", self, other)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other: Any) -> "Number":
        return self.shader.combine("-", other, self)

    def __rtruediv__(self, other: Any) -> "Number":
        return self.shader.combine("/", other, self)

    def __neg__(self) -> "Number":
        return self.shader.put(self.kind, f"-{self.text}")

    def __pow__(self, power: int) -> "Number":
        assert power >= 1 and power == int(power), "only whole powers are written down"
        half = self if power == 1 else self ** (power // 2)
        return half if power == 1 else half * half * self if power % 2 else half * half

    def __and__(self, other: Any) -> "Number":
        sign = "&&" if self.kind == TRUTH else "&"
        return self.shader.put(self.kind, f"{self.text} {sign} {self.shader.text_of(other, self.kind)}")

    def __lt__(self, other: Any) -> "Number":
        return self.shader.combine("<", self, other)

    def __le__(self, other: Any) -> "Number":
        return self.shader.combine("<=", self, other)

    def __gt__(self, other: Any) -> "Number":
        return self.shader.combine(">", self, other)

    def __ge__(self, other: Any) -> "Number":
        return self.shader.combine(">=", self, other)

    def __bool__(self) -> bool:
        raise TypeError("A law that branches on numbers cannot be written down: use xp.where.")


class Glsl:
    """Statements under construction."""

    def __init__(self) -> None:
        """Begin."""
        self._lines: list[str] = []
        self._count, self._depth = 0, 1
        self.xp = Mathematics(self)
        """What laws ask of numpy."""

    @property
    def text(self) -> str:
        """All statements."""
        return "\n".join(self._lines)

    def say(self, statement: str) -> None:
        """Write a statement."""
        self._lines.append("  " * self._depth + statement)

    def given(self, text: str, kind: str = REAL) -> Number:
        """A number that the shader has already."""
        return Number(self, kind, text)

    def vector(self, text: str) -> tuple[Number, Number, Number]:
        """Components of a vector that the shader has."""
        return self.given(f"{text}.x"), self.given(f"{text}.y"), self.given(f"{text}.z")

    def put(self, kind: str, text: str) -> Number:
        """A new number of that value."""
        self._count += 1
        self.say(f"{kind} t{self._count} = {text};")
        return Number(self, kind, f"t{self._count}")

    def text_of(self, value: Any, kind: str) -> str:
        """A number or a constant as text, as a number of that kind."""
        if isinstance(value, Number):
            return value.text if value.kind == kind else f"{kind}({value.text})"
        return str(int(value)) if kind == WHOLE else f"({float(value)!r})"

    def combine(self, sign: str, first: Any, second: Any) -> Number:
        """Sum, difference, product, quotient or comparison: real if either is, and quotients always."""
        kinds = [each.kind if isinstance(each, Number) else _kind(each) for each in (first, second)]
        kind = REAL if REAL in kinds or sign == "/" else WHOLE
        text = f"{self.text_of(first, kind)} {sign} {self.text_of(second, kind)}"
        return self.put(TRUTH if sign[0] in "<>" else kind, text)

    def row(self, table: str, row: Any, count: int = 4) -> list[Number]:
        """Numbers of a row of fours that the shader has."""
        self._count += 1
        self.say(f"vec4 t{self._count} = {table}[{self.text_of(row, WHOLE)}];")
        return [self.given(f"t{self._count}.{each}") for each in "xyzw"[:count]]

    @contextmanager
    def when(self, condition: Number) -> Iterator[None]:
        """Do what is written within where a condition holds."""
        with self.block(f"if ({condition.text})"):
            yield

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """What is written within is a block behind that head."""
        self.say(f"{head} {{")
        self._depth += 1
        yield
        self._depth -= 1
        self.say("}")

    def set(self, variable: Number, value: Any) -> None:
        """Give a number another value."""
        self.say(f"{variable.text} = {self.text_of(value, variable.kind)};")

    def changed_where(
        self, condition: Number, change: Callable[[Sequence[Number]], Sequence[Any]], values: Sequence[Any]
    ) -> list[Number]:
        """Real numbers, changed where a condition holds, and not worked out where it does not."""
        held = [self.put(REAL, self.text_of(value, REAL)) for value in values]
        with self.when(condition):
            # Values are worked out before any of those that they are made of changes.
            new = [self.put(REAL, self.text_of(value, REAL)) for value in change(held)]
            for variable, value in zip(held, new, strict=True):
                self.set(variable, value)
        return held


class Mathematics:
    """What laws ask of numpy, in a shader."""

    def __init__(self, shader: Glsl) -> None:
        """For numbers of that shader."""
        self._shader = shader

    def where(self, condition: Number, yes: Any, no: Any) -> Number:
        """As numpy's."""
        own = self._shader
        return own.put(REAL, f"{condition.text} ? {own.text_of(yes, REAL)} : {own.text_of(no, REAL)}")

    def minimum(self, a: Any, b: Any) -> Number:
        """As numpy's."""
        return self._call("min", a, b)

    def maximum(self, a: Any, b: Any) -> Number:
        """As numpy's."""
        return self._call("max", a, b)

    def clip(self, value: Any, low: Any, high: Any) -> Number:
        """As numpy's."""
        return self._call("clamp", value, low, high)

    def abs(self, value: Any) -> Number:
        """As numpy's."""
        return self._call("abs", value)

    def sqrt(self, value: Any) -> Number:
        """As numpy's."""
        return self._call("sqrt", value)

    def floor(self, value: Any) -> Number:
        """As numpy's."""
        return self._call("floor", value)

    def exp(self, value: Any) -> Number:
        """As numpy's."""
        return self._call("exp", value)

    def int32(self, value: Any) -> Number:
        """The whole part."""
        return self._shader.put(WHOLE, f"int({self._shader.text_of(value, REAL)})")

    def _call(self, name: str, *values: Any) -> Number:
        own = self._shader
        return own.put(REAL, f"{name}({', '.join(own.text_of(each, REAL) for each in values)})")


def _kind(constant: Any) -> str:
    return WHOLE if isinstance(constant, int) else REAL
