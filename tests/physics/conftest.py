"""Comparisons with theory that also leave their figures in the test report, from which docs/validation is made."""

from collections.abc import Callable

import pytest


@pytest.fixture
def compare(record_property) -> Callable[..., None]:
    """Assert that a figure is where theory has it, and record both: `pytest --junitxml=FILE` keeps them.

    The error is relative, or a part of `scale` when one is given.
    """

    def check(what: str, measured: float, theory: float, *, within: float, scale: float | None = None) -> None:
        error = abs(measured - theory) / abs(scale or theory)
        record_property("figure", f"{what}|{measured:.6g}|{theory:.6g}|{error:.3g}|{within:.3g}")
        assert error <= within, f"{what}: {measured:.6g}, by theory {theory:.6g}: off by {error:.2%} > {within:.2%}"

    return check
