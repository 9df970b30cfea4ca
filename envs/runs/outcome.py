"""How a run ended."""

from enum import Enum

LEFT_OUTSIDE = 0.005
"""A scope is fully inserted when less than this is left outside [m]: a hand has nothing to push by any more."""


class Outcome(Enum):
    """The one reason why a run stopped; `advice` says what a user can do about it."""

    TIME_UP = "time_up"
    REACHED_CAECUM = "reached_caecum"
    STUCK = "stuck"
    FULLY_INSERTED = "fully_inserted"
    ESCAPED = "escaped"
    DIVERGED = "diverged"

    @property
    def advice(self) -> str:
        """One sentence for the report."""
        return _ADVICE[self]


_ADVICE = {
    Outcome.TIME_UP: "The time asked for is over; ask for more with --seconds.",
    Outcome.REACHED_CAECUM: "The tip is in the caecum.",
    Outcome.STUCK: "The tip made no progress in spite of repeated attempts; see where the wall force acts.",
    Outcome.FULLY_INSERTED: "The whole working length is inside; a longer scope would go further.",
    Outcome.ESCAPED: "The scope broke through the wall: push less, or stiffen the wall.",
    Outcome.DIVERGED: "The simulation became unstable: halve the timestep, or soften what was made stiffer.",
}
