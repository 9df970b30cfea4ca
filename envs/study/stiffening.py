"""A stiffening ring that is turned on command: from then on sections of the shaft are as stiff as the ring makes them.

Endoscopists stiffen a shaft that they have straightened, so that it does not loop again (Shah 2002, Gastrointest Endosc
56:195): a looped one would be stiffened as it lies. Who remembers what it does turns the ring at the end of the first
pull-back after the tip has come to the segment; who does not, once the tip has come there.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from haustra.envs.control.endoscopist import pulls_back
from haustra.models.anatomy.colon import Colon

if TYPE_CHECKING:
    from haustra.envs.runs.linear_insertions import LinearInsertions

NEVER = "never"


class StiffeningRing:
    """Turns the ring of each patient's scope to its stiffest setting once straightened in a segment or beyond."""

    def __init__(self, batch: "LinearInsertions", colons: Sequence[Colon], *, segment: str) -> None:
        """Get to know where the segment begins.

        Args:
            batch: the patients' worlds.
            colons: of each world.
            segment: from whose beginning on the ring is turned; 'never' leaves it.
        """
        self._batch = batch
        self._turned, self._pulled = np.zeros((2, len(colons)), dtype=bool)
        self._starts = np.full(len(colons), np.inf)
        if segment != NEVER:
            self._starts = np.array(
                [next(part.start for part in colon.segments if part.name == segment) for colon in colons]
            )

    def __call__(self) -> None:
        """Turn the rings of those who have come there, and were straightened there, since."""
        program, backend = self._batch.program, self._batch.backend
        numbers = self._batch.driver_numbers()
        come = program.tally_of(numbers).tip_arc_max >= self._starts
        pulls = pulls_back(program.memory_of(numbers))
        ready = come if pulls is None else come & self._pulled & ~pulls
        self._pulled = self._pulled if pulls is None else come & pulls
        turned = self._turned | ready
        if (turned != self._turned).any():
            self._turned = turned
            backend.give("ring", turned.astype(float))
