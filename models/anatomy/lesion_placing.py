"""Where a grown colon's lesions go."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Centreline, ColonSegment, Lesion
from haustra.models.anatomy.lesion import LesionOrder, size_class, sizes

WITHIN = (0.06, 0.94)
"""Lesions are placed in this part of their segment, away from its borders."""
ANAL_CANAL = 0.04
"""No lesion lies nearer to the anus [m]: the canal is held open by whatever passes it."""
CAECAL_END = 0.012
"""No lesion lies nearer to the caecum's end [m], where the surface is a dome."""
TRIES = 60
"""Places that are tried for one lesion before its order is refused."""
APART = 3e-3
"""Wall that is left between two lesions [m]."""


@dataclass(frozen=True)
class Spot:
    """A place and a size that may suit a lesion."""

    order: LesionOrder
    size: float
    """[m]."""
    arc: float
    """Arc length from the anus [m]."""
    angle: float
    """Direction from the centreline's first normal towards the second [rad]."""
    chance: float
    """One more number from 0 to 1, for what else varies."""


class Placer:
    """Draws places for the lesions that were ordered, and remembers those taken."""

    def __init__(
        self,
        rng: np.random.Generator,
        line: Centreline,
        segments: Sequence[ColonSegment],
        orders: Sequence[LesionOrder],
    ):
        """Take the colon's axis and what was ordered."""
        self.line = line
        self._rng = rng
        self._segments = {segment.name: segment for segment in segments}
        self._orders = orders
        self._taken: list[Lesion] = []

    def wanted(self, *kinds: str) -> list[LesionOrder]:
        """The orders of these kinds, one entry a lesion."""
        return [order for order in self._orders if order.kind in kinds for _ in range(order.count)]

    def spots(self, order: LesionOrder) -> Iterator[Spot]:
        """Places to try, `TRIES` of them.

        Raises:
            InvalidOptionError: when all were refused.
        """
        segment = self._segments[order.segment]
        for _ in range(TRIES):
            where, size, angle, chance = self._rng.random(4)
            share = WITHIN[0] + (WITHIN[1] - WITHIN[0]) * where if order.share is None else order.share
            arc = segment.start + share * (segment.end - segment.start)
            yield Spot(
                order=order,
                size=self._size(order, size),
                arc=float(np.clip(arc, ANAL_CANAL, self.line.length - CAECAL_END)),
                angle=float(2 * np.pi * angle),
                chance=float(chance),
            )
        place = f"the {order.segment}" if order.share is None else f"the {order.segment} at {order.share:g}"
        named = order.size if isinstance(order.size, str) else f"{1e3 * order.size:g} mm"
        raise InvalidOptionError(
            f"No room was found for a {order.kind} ({named}, {order.type}) in {place}: "
            "ask for a smaller one, fewer, another place or another seed."
        )

    def take(self, spot: Spot, *, extent: float, angle: float | None, position: np.ndarray) -> Lesion:
        """Note a lesion at a spot and return it."""
        x, y, z = (round(float(value), 6) for value in position)
        lesion = Lesion(
            kind=spot.order.kind,
            type=spot.order.type,
            size_class=spot.order.size if isinstance(spot.order.size, str) else size_class(spot.order.kind, spot.size),
            size=round(spot.size, 6),
            extent=round(float(extent), 6),
            segment=spot.order.segment,
            arc=round(spot.arc, 6),
            angle=None if angle is None else round(angle, 6),
            position=(x, y, z),
        )
        self._taken.append(lesion)
        return lesion

    def free(self, position: np.ndarray, reach: float) -> bool:
        """Whether a lesion with this half-width [m] at this place leaves wall to all others."""
        return all(
            np.linalg.norm(position - lesion.position) > reach + _reach(lesion) + APART for lesion in self._taken
        )

    def _size(self, order: LesionOrder, chance: float) -> float:
        if not isinstance(order.size, str):
            return float(order.size)
        known = sizes(order.kind)[order.size]
        return float(known.low + chance * (known.high - known.low))


def _reach(lesion: Lesion) -> float:
    return (lesion.extent + 0.03) / 2 + 0.02 if lesion.kind == "stricture" else lesion.size / 2
