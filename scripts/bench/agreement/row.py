"""One line of the table of agreement: a quantity, a backend against the native one, the tolerance and its reason."""

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Agreement:
    """How far a backend is from the native one, or why it cannot be asked."""

    quantity: str
    backend: str
    """Backend that is held against the native one."""
    tolerance: float
    """Largest difference that counts as agreement, in the quantity's unit."""
    unit: str
    reason: str
    """Reason for the tolerance."""
    difference: float | None = None
    """None where the backend is absent."""
    interval: tuple[float, float] | None = None
    """95 % confidence of a mean difference over seeds; all of it must lie within the tolerance."""
    cases: int | None = None
    """Seeds that both backends ran."""
    absent: str = ""
    """Why the backend was not asked."""

    @property
    def agrees(self) -> bool | None:
        """Whether the difference is within the tolerance; None where the backend is absent."""
        if self.difference is None:
            return None
        return all(abs(value) <= self.tolerance for value in (self.difference, *(self.interval or ())))

    def without(self, backend: str, why: str) -> "Agreement":
        """Return the answer of a backend that is not there to this question."""
        return Agreement(self.quantity, backend, self.tolerance, self.unit, self.reason, absent=why)

    def to_json(self) -> dict[str, Any]:
        """Plain values; an interval without bounds is null."""
        bounded = self.interval is not None and all(map(math.isfinite, self.interval))
        half = (self.interval[1] - self.interval[0]) / 2 if self.interval and bounded else None
        return {
            **asdict(self),
            "interval": self.interval if bounded else None,
            "half_width": half,
            "agrees": self.agrees,
        }


Part = Callable[[], Iterable[Agreement]]
"""Some rows of the table."""


def table(rows: Iterable[Agreement]) -> dict[str, str]:
    """The rows as a terminal shows them."""
    return {f"{row.quantity}, {row.backend}": _said(row) for row in rows}


def _said(row: Agreement) -> str:
    if row.difference is None:
        return f"not asked: {row.absent}"
    within = "" if row.interval is None else f" ({row.interval[0]:+.2g} to {row.interval[1]:+.2g})"
    uncertain = row.interval is not None and row.interval[0] <= row.tolerance and row.interval[1] >= -row.tolerance
    verdict = "agrees" if row.agrees else "not shown, take more seeds" if uncertain else "DIFFERS"
    return f"{verdict}: {row.difference:.2g}{within} {row.unit}, at most {row.tolerance:g}: {row.reason}"
