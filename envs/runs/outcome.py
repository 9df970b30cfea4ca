"""How a run ended."""

from enum import Enum
from typing import Any

CAECUM_MARGIN = 0.03
"""The caecum counts as reached this far before the end of the centreline [m]; engineering choice."""
ESCAPE_DEPTH = 0.03
"""A scope that stands this far outside the lumen has left the colon [m]: the default wall is no thicker."""
EMPTY_LOOP = 0.2
"""A scope that leaves so much colon between two neighbouring places [m], beyond what may be gathered there, has gone
through its wall on the inside of a bend and is in it again behind; engineering choice: of loops that are drawn to a
shaft (`haustra.models.wall.threads`) 0.16 m at most lay folded beside it, and no shaft stood outside the surface."""
LEFT_OUTSIDE = 0.005
"""A scope is fully inserted when less than this is left outside [m]: a hand has nothing to push by any more."""
MANY_ATTEMPTS = 3
"""A run that ends after this many attempts without progress was stuck."""


class Outcome(Enum):
    """The one reason why a run stopped; `advice` says what a user can do about it."""

    TIME_UP = "time_up"
    COMPLETED = "completed"
    STUCK = "stuck"
    FULLY_INSERTED = "fully_inserted"
    WITHDRAWN = "withdrawn"
    ESCAPED = "escaped"
    DIVERGED = "diverged"

    @property
    def advice(self) -> str:
        """One sentence for the report."""
        return _ADVICE[self]


_ADVICE = {
    Outcome.TIME_UP: "The time asked for is over; ask for more with --seconds.",
    Outcome.COMPLETED: "The tip is in the caecum.",
    Outcome.STUCK: "The tip made no progress in spite of repeated attempts; see where the wall force acts.",
    Outcome.FULLY_INSERTED: "The whole working length is inside; a longer scope would go further.",
    Outcome.WITHDRAWN: "The tip is back at the anus.",
    Outcome.ESCAPED: "The scope broke through the wall: push less, or stiffen the wall.",
    Outcome.DIVERGED: "The simulation became unstable: halve the timestep, or soften what was made stiffer.",
}


ENDINGS = (None, Outcome.ESCAPED, Outcome.COMPLETED, Outcome.FULLY_INSERTED, Outcome.WITHDRAWN, Outcome.STUCK)
"""What the numbers of `ending`, `withdrawn` and `given_up` mean; None: the run goes on."""


def ending(xp: Any, *, outside: Any, skipped: Any, arc: Any, length: Any, insertion: Any, modelled: Any) -> Any:
    """Why runs end now, as rows of `ENDINGS`: one number, or one a world.

    Args:
        xp: numpy or jax.numpy.
        outside: how far the scope stands outside the lumen [m].
        skipped: most colon between two neighbouring places of the scope beyond what may be gathered there [m].
        arc: arc length of the tip [m].
        length: of the colon's centreline [m].
        insertion: length of scope past the anus [m].
        modelled: length of the modelled scope [m].
    """
    inserted = xp.where(insertion >= modelled - LEFT_OUTSIDE, 3, 0)
    reached = xp.where(arc >= length - CAECUM_MARGIN, 2, inserted)
    return xp.where((outside > ESCAPE_DEPTH) | (skipped > EMPTY_LOOP), 1, reached)


def given_up(xp: Any, ended: Any, gives_up: Any) -> Any:
    """Why runs end now whose drivers may have given up, as rows of `ENDINGS`: what ended otherwise ended so.

    Args:
        xp: numpy or jax.numpy.
        ended: why they end but for that, as rows of `ENDINGS`.
        gives_up: whether their drivers give up (`haustra.envs.control.follower.Law.gives_up`).
    """
    return xp.where(gives_up & (ended == 0), ENDINGS.index(Outcome.STUCK), ended)


def withdrawn(start: float, *, arc: float, insertion: float) -> int:
    """Whether a scope is out again as far as it began, as a row of `ENDINGS`.

    Args:
        start: distance of the tip past the anus at the start of its insertion [m].
        arc: arc length of the tip [m].
        insertion: length of scope past the anus [m].
    """
    return ENDINGS.index(Outcome.WITHDRAWN) if min(arc, insertion) <= start else 0


def outcome_of(ended: int, *, healthy: bool, attempts: int) -> Outcome:
    """How a run went that diverged, ended for that row of `ENDINGS`, or ran out of time after so many attempts."""
    if not healthy:
        return Outcome.DIVERGED
    return ENDINGS[ended] or (Outcome.STUCK if attempts >= MANY_ATTEMPTS else Outcome.TIME_UP)
