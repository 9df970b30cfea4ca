"""How wide the way through a colon is, and where it is too narrow for a device."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.centring import LONGEST_LEAD
from haustra.models.anatomy.colon import Centreline, Colon
from haustra.models.anatomy.landmarks import segment_names
from haustra.models.anatomy.properties import Clearance

DIRECTIONS = 6
"""Directions in which a wider place is looked for at each station."""
SHRINKING = (0.4, 0.2, 0.1, 0.05)
"""Steps of the search, as shares of the clearance."""
FARTHEST = 1.0
"""The ball's centre leaves the centreline by at most this share of the clearance there: it stays in sight of it."""
JOINED = 0.01
"""Narrow places nearer than this [m] to each other are one."""


@dataclass(frozen=True)
class Narrow:
    """A stretch that a ball cannot pass."""

    start: float
    """Arc length at which it begins [m]."""
    end: float
    """Arc length at which it ends [m]."""
    narrowest: float
    """Arc length of its narrowest place [m]."""
    diameter: float
    """Diameter of the largest ball there [m]."""
    segment: str
    """Segment of the colon in which the narrowest place lies."""


@dataclass(frozen=True)
class Passage:
    """The largest ball at each station of a colon."""

    centres: Float[np.ndarray, "stations 3"]
    """Its centre [m]."""
    diameter: Float[np.ndarray, " stations"]
    """Its diameter [m]; too large by at most 0.1 mm, since distances are taken to samples of the surface."""


def passage_of(colon: Colon) -> Passage:
    """Find the largest ball near each station, by a pattern search across the centreline.

    Within `LONGEST_LEAD` of either end, where a lid or a blind end keeps balls away and not the width of the lumen, it
    is the largest ball that reaches over the station.
    A ball is a short rigid device: a longer one needs more room in bends.
    """
    line, clearance = colon.centreline, Clearance(colon.lumen)
    centres, best = line.points.copy(), clearance(line.points)
    reach = FARTHEST * best
    turn = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    across = np.einsum("dk,sjk->dsj", np.stack([np.cos(turn), np.sin(turn)], axis=1), line.frames[:, :, :2])
    for share in SHRINKING:
        for _ in range(2):
            trial = centres + share * best[:, None] * across
            room = clearance(trial.reshape(-1, 3)).reshape(DIRECTIONS, -1)
            room[np.linalg.norm(trial - line.points, axis=2) > reach] = 0.0
            choice = room.argmax(0)
            better = room[choice, np.arange(len(best))] > best
            if not better.any():
                break
            centres[better] = trial[choice[better], np.flatnonzero(better)]
            best = np.where(better, room.max(0), best)
    return Passage(centres, 2 * _covered(line, best))


def _covered(line: Centreline, best: Float[np.ndarray, " stations"]) -> Float[np.ndarray, " stations"]:
    """Radius of the largest ball; near an end of the lumen, of the largest one that reaches over the station."""
    radius = best.copy()
    for station in np.flatnonzero(np.minimum(line.arc, line.length - line.arc) < LONGEST_LEAD):
        over = np.abs(line.arc - line.arc[station]) <= best
        radius[station] = max(best[over].max(initial=0.0), best[station])
    return radius


def narrow_places(colon: Colon, passage: Passage, diameter: float) -> tuple[Narrow, ...]:
    """Stretches in which no ball of `diameter` [m] fits, from the anus on."""
    arc = colon.centreline.arc
    tight = np.flatnonzero(passage.diameter < diameter)
    if len(tight) == 0:
        return ()
    places = []
    for stretch in np.split(tight, np.flatnonzero(np.diff(arc[tight]) > JOINED) + 1):
        worst = int(stretch[passage.diameter[stretch].argmin()])
        places.append(
            Narrow(
                start=float(arc[stretch[0]]),
                end=float(arc[stretch[-1]]),
                narrowest=float(arc[worst]),
                diameter=float(passage.diameter[worst]),
                segment=segment_names(colon.segments, arc[worst : worst + 1])[0],
            )
        )
    return tuple(places)
