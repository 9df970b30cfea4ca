"""Strictures, diverticula and polyps that are asked for."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

from haustra.assets import asset
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.quantity import Quantity, load_quantities

Kind = Literal["stricture", "diverticulum", "polyp"]
TYPES = {
    "stricture": ("concentric",),
    "diverticulum": ("sac",),
    "polyp": ("sessile", "pedunculated", "flat"),
}
"""Shapes of each kind, the usual one first; polyps as in the Paris classification: 0-Is, 0-Ip, 0-IIa."""
LARGEST = {"stricture": 0.03, "diverticulum": 0.015, "polyp": 0.03}
"""Largest size that may be asked for in mm [m]."""
SMALLEST = {"stricture": 5e-3, "diverticulum": 2e-3, "polyp": 2e-3}
"""Smallest size that may be asked for in mm [m]: below it the surface's triangles no longer show it."""
MOST = 50
"""Most lesions of one order."""
_ORDER = re.compile(
    r"(?P<segment>[a-z]+)(?:@(?P<share>[0-9.]+))?:(?P<size>[a-z]+|[0-9.]+mm)(?::(?P<type>[a-z]+))?(?:\*(?P<count>\d+))?"
)
_FORM = "SEGMENT[@SHARE]:SIZE[:TYPE][*COUNT]"


@dataclass(frozen=True)
class LesionOrder:
    """Lesions of one kind and size in one segment."""

    kind: str
    """stricture, diverticulum or polyp."""
    segment: str
    """Segment of the colon."""
    size: str | float
    """Name of a size class, or a size [m]: throat of a stricture, sac of a diverticulum, width of a polyp."""
    type: str
    """Shape."""
    share: float | None = None
    """Place along the segment from its anal end [1]; None draws it."""
    count: int = 1
    """How many."""

    def __post_init__(self) -> None:
        if self.kind not in TYPES:
            raise InvalidOptionError(f"Lesion '{self.kind}' is not known. Known: {', '.join(TYPES)}.")
        if self.segment not in SEGMENTS:
            raise InvalidOptionError(f"Segment '{self.segment}' is not known. Known: {', '.join(SEGMENTS)}.")
        if self.type not in TYPES[self.kind]:
            raise InvalidOptionError(
                f"A {self.kind} of type '{self.type}' is not known. Known: {', '.join(TYPES[self.kind])}."
            )
        if isinstance(self.size, str):
            if self.size not in sizes(self.kind):
                known = ", ".join(sizes(self.kind))
                raise InvalidOptionError(
                    f"A {self.kind} of size '{self.size}' is not known. Known: {known}, or like 8mm."
                )
        elif not SMALLEST[self.kind] <= self.size <= LARGEST[self.kind]:
            low, high = 1e3 * SMALLEST[self.kind], 1e3 * LARGEST[self.kind]
            raise InvalidOptionError(
                f"A {self.kind} of {1e3 * self.size:g} mm cannot be made: give {low:g} to {high:g} mm."
            )
        if self.share is not None and not 0 <= self.share <= 1:
            raise InvalidOptionError(f"Place @{self.share:g} in the {self.segment} must be from 0 (anal end) to 1.")
        if not 1 <= self.count <= MOST:
            raise InvalidOptionError(f"{self.count} lesions cannot be ordered at once: give 1 to {MOST}.")


@cache
def sizes(kind: str) -> dict[str, Quantity]:
    """Size classes of a kind of lesion."""
    prefix = f"lesion.{kind}."
    known = load_quantities(asset("numbers/lesions.toml"))
    return {name.removeprefix(prefix): size for name, size in known.items() if name.startswith(prefix)}


@cache
def stricture_length() -> Quantity:
    """Length of a stricture's throat [m]."""
    return load_quantities(asset("numbers/lesions.toml"))["lesion.stricture_length"]


def size_class(kind: str, size: float) -> str:
    """The class whose usual size is nearest in proportion."""
    return min(sizes(kind), key=lambda name: abs(math.log(size / sizes(kind)[name].value)))


def read_orders(kind: Kind, texts: Sequence[str]) -> tuple[LesionOrder, ...]:
    """Read orders like 'sigmoid:small', 'transverse@0.3:12mm:pedunculated' or 'sigmoid:medium*8'.

    Raises:
        InvalidOptionError: when one cannot be read or names what is not known.
    """
    return tuple(_read_order(kind, text) for text in texts)


def _read_order(kind: Kind, text: str) -> LesionOrder:
    match = _ORDER.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        size = match["size"]
        return LesionOrder(
            kind=kind,
            segment=match["segment"],
            size=float(size[:-2]) * 1e-3 if size[0].isdigit() or size[0] == "." else size,
            type=match["type"] or TYPES[kind][0],
            share=float(match["share"]) if match["share"] else None,
            count=int(match["count"] or 1),
        )
    except ValueError:
        raise InvalidOptionError(f"The {kind} '{text}' cannot be read: write {_FORM}, like sigmoid:8mm.") from None
