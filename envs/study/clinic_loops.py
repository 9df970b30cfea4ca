"""Loops of patients' scopes, named at every look, on every core."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.children import children, cores
from haustra.envs.runs.measure.looping import DOWN, FRONT_TO_BACK
from haustra.envs.runs.measure.loops import LoopKind, Rest, find_loops
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import entry_of

_WORTH = 10_000
"""Looks from which on more processes are started: naming takes 2 ms a look, and starting them 3 s."""


@dataclass(frozen=True)
class Seen:
    """What an imager has shown of one patient, look after look."""

    shapes: Float[np.ndarray, "looks points 3"]
    """The scope's axis in the world, from behind the handle to the tip [m]."""
    beside: Float[np.ndarray, "looks points"]
    """Arc length of the colon beside each point [m]."""
    inserted: Float[np.ndarray, " looks"]
    """Shaft inside [m]."""


def loops_of(seen: Seen, colon: Colon, behind: Float[np.ndarray, " points"]) -> list[frozenset[LoopKind]]:
    """Loops that the push has made, at each look.

    Args:
        seen: the looks.
        colon: the patient's, at rest.
        behind: how far each point lies behind the tip, along the scope [m].
    """
    place, axes = entry_of(colon)
    line = colon.centreline
    found = []
    for points, beside, inserted in zip(seen.shapes, seen.beside, seen.inserted, strict=True):
        inside = behind < inserted
        if inside.sum() < 4:
            found.append(frozenset[LoopKind]())
            continue
        shape = points[inside].astype(float) @ axes.T + place
        arcs = np.maximum.accumulate(np.clip(beside[inside].astype(float), 0.0, line.length))
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(shape, axis=0), axis=1))])
        regions = {
            part.name: (float(np.interp(part.start, arcs, along)), float(np.interp(part.end, arcs, along)))
            for part in colon.segments
            if part.start < arcs[-1]
        }
        rest = Rest(line.points, line.arc, arcs)
        named = find_loops(shape, view=FRONT_TO_BACK, regions=regions, down=DOWN, rest=rest)
        found.append(frozenset(loop.kind for loop in named))
    return found


def all_loops(
    seen: list[Seen], colons: list[Colon], behind: Float[np.ndarray, " points"]
) -> list[list[frozenset[LoopKind]]]:
    """Loops of all patients, one after the other or side by side, whichever is faster.

    Args:
        seen: each patient's looks.
        colons: each patient's colon.
        behind: as `loops_of`.
    """
    with _executor(sum(len(each.inserted) for each in seen)) as pool:
        mapped = pool.map if pool else map
        return list(mapped(loops_of, seen, colons, [behind] * len(seen)))


@contextmanager
def _executor(looks: int) -> Iterator[Executor | None]:
    if looks < _WORTH or cores() < 2:
        yield None
        return
    with children(cores()) as pool:
        yield pool
