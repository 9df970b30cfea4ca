"""The runtime type checker that tests put on every function and dataclass of haustra."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, partial, wraps
from inspect import getattr_static, signature
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype
from jaxtyping import config

_CALLS = 8
"""Calls of a function in one test that are checked: what is called more often is called alike, and a check takes longer
than most functions."""
_held = beartype(conf=BeartypeConf(is_pep484_tower=True))
_counters: list["_Counter"] = []


def check(target: Any) -> Any:
    """Hold arguments and results to their annotations, array shapes included; an int may stand for a float.

    jaxtyping gives a function's signature here, not the function, and throws away what it returns.
    """
    if isinstance(target, type):
        return _held(target)
    counter = _within(target) if "<locals>" in target.__qualname__ else _Counter(target)

    @wraps(target)
    def counted(*args: Any, **kwargs: Any) -> None:
        counter.count(args, kwargs)

    return counted


def check_anew() -> None:
    """Check the next calls of every function again."""
    for counter in _counters:
        counter.begin()
    _counters.clear()


class _Counter:
    def __init__(self, signature: Any) -> None:
        self._signature, self._calls = signature, 0
        self._released: Any = None

    @cached_property
    def _held(self) -> Callable[..., Any]:
        """The check, made at the first call: most functions that a test imports are never called by it."""
        return _held(self._signature)

    def count(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        """Check a call, or let it pass."""
        if not self._calls:
            _counters.append(self)
        self._calls += 1
        if self._calls <= _CALLS:
            self._held(*args, **kwargs)
        elif self._released is None and (found := _checked_function(self._signature)):
            self._released = found
            found.__no_type_check__ = True

    def begin(self) -> None:
        self._calls = 0
        if self._released is not None:
            self._released.__no_type_check__ = False
            self._released = None


_inner: dict[tuple[str, str, str], _Counter] = {}


def _within(target: Any) -> _Counter:
    """Count a function within a function once, not anew at every call of the outer one, which makes it anew: to write
    its check takes a millisecond."""
    key = target.__module__, target.__qualname__, str(signature(target))
    return _inner.setdefault(key, _Counter(target))


def _checked_function(signature: Any) -> Any:
    """The function that jaxtyping has put around the one of this signature; None where it is not to be found."""
    found: Any = sys.modules.get(signature.__module__)
    for name in signature.__qualname__.split("."):
        found = getattr_static(found, name, None)
        found = getattr(found, "__func__", None) or getattr(found, "fget", None) or found
    while found is not None and getattr(found, "__code__", None) is not _WRAPPER:
        found = getattr(found, "__wrapped__", None) or getattr(found, "func", None)
    return found


def spare_what_is_unchecked() -> None:
    """Give functions within functions back as they are where checks are left out (`unchecked`): to prepare a check that
    is not made takes far longer than most of them run."""
    prepared = jaxtyping.jaxtyped

    def jaxtyped(*target: Any, **options: Any) -> Any:
        if not target:
            return partial(jaxtyped, **options)
        if config.jaxtyping_disable and "<locals>" in getattr(target[0], "__qualname__", ""):
            return target[0]
        return prepared(*target, **options)

    jaxtyping.jaxtyped = jaxtyped


@contextmanager
def unchecked() -> Iterator[None]:
    """Leave the checks out where functions are called many thousand times that are checked elsewhere."""
    config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", False)


def _wrapper() -> Any:
    from jaxtyping import jaxtyped

    @jaxtyped(typechecker=lambda function: function)
    def example(value: int) -> int:
        return value

    return example.__code__


_WRAPPER = _wrapper()
"""Code of the functions that jaxtyping puts around others."""
