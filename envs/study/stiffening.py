"""A stiffening ring that is turned on command: the shaft is stiffer from then on, the bending section is not.

Endoscopists stiffen a shaft that they have straightened, so that it does not loop again (Shah 2002, Gastrointest Endosc
56:195): a looped one would be stiffened as it lies. Who remembers what it does turns the ring at the end of the first
pull-back after the tip has come to the segment; who does not, once the tip has come there.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from haustra.envs.control.endoscopist import pulls_back
from haustra.errors import InvalidDesignError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign

if TYPE_CHECKING:
    from haustra.envs.runs.linear_insertions import LinearInsertions

NEVER = "never"


class StiffeningRing:
    """Turns the ring of each patient's scope to its stiffest setting once straightened in a segment or beyond."""

    def __init__(
        self,
        batch: "LinearInsertions",
        design: ScopeDesign,
        colons: Sequence[Colon],
        shaft_stiffness: Float[np.ndarray, " worlds"],
        *,
        segment: str,
    ) -> None:
        """Get to know the scope and where the segment begins.

        Args:
            batch: the patients' worlds.
            design: of the scope, whose `stiffening` is the shaft's EI at the stiffest setting over that at the softest.
            colons: of each world.
            shaft_stiffness: EI of each world's shaft over its design's [1].
            segment: from whose beginning on the ring is turned; 'never' leaves it.

        Raises:
            InvalidDesignError: when sections of the shaft stiffen unlike each other.
        """
        self._batch, self._soft = batch, shaft_stiffness
        self._turned, self._pulled = np.zeros((2, len(colons)), dtype=bool)
        self._starts = np.full(len(colons), np.inf)
        if segment != NEVER:
            self._starts = np.array(
                [next(part.start for part in colon.segments if part.name == segment) for colon in colons]
            )
        ratios = {each.stiffening / (1 + design.variable_stiffness * (each.stiffening - 1)) for each in design.shaft}
        if segment != NEVER and len(ratios) > 1:
            raise InvalidDesignError(
                f"Scope '{design.name}': sections of its shaft stiffen by different factors, which a ring that is "
                "turned on command cannot: give all the same stiffening."
            )
        self._factor = max(ratios)

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
            backend.give("bending", self._soft * np.where(turned, self._factor, 1.0))
