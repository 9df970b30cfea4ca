"""How much a run looped: measures that need no axes, loops by name, and what pulling back shortened.

Loops are those that the push made: forms that the colon had at rest already do not count
(`haustra.envs.runs.measure.loops.Rest`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.loops import Loop, LoopKind, Rest, find_loops, writhe
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.models.scene import Scene

FRONT_TO_BACK = np.array([0.0, 1.0, 0.0])
"""Loops are named as seen from the front, along y: an assumption, the one that landmarks are found by (z up, x across,
as in RAS and LPS). Which way along it does not matter."""
DOWN = np.array([0.0, 0.0, -1.0])
"""The patient's feet."""

_EVERY = 0.5
"""Time between two shapes that are looked at [s]; engineering choice."""

_STAYS = 0.005
"""A tip stays while it loses no more than this of its way [m]; engineering choice, above the centreline's spacing."""


@dataclass(frozen=True)
class Looping:
    """Looping over a run."""

    excess: float
    """Scope inside less colon passed, at the end [m]: what lies in loops; negative where the scope cuts corners."""
    excess_peak: float
    """The largest on the way [m]."""
    writhe_peak: float
    """Largest size of the writhe of the scope inside [turns]: how much it coils, whichever way it is looked at."""
    seconds: dict[str, float]
    """How long a loop of each kind was there [s], by its name."""
    at_end: tuple[Loop, ...]
    """Loops at the end."""
    shortening: float
    """Most scope that was pulled back while the tip stayed [m]."""


def looping(scene: Scene, run: Insertion) -> Looping:
    """Look at the shapes of a run every half second."""
    seen = run.trajectory
    if not len(seen.time):
        return Looping(0.0, 0.0, 0.0, {kind.value: 0.0 for kind in LoopKind}, (), 0.0)
    interval = float(seen.time[1] - seen.time[0]) if len(seen.time) > 1 else _EVERY
    stride = max(1, round(_EVERY / interval))
    records = range(len(seen.time) - 1, -1, -stride)[::-1]
    recorded = RecordedRun(scene, seen)
    turns, lasting, loops = 0.0, dict.fromkeys((kind.value for kind in LoopKind), 0.0), ()
    for record in records:
        inside = recorded.path(record)
        if len(inside) < 4:
            continue
        regions, rest = _beside(scene, inside, float(seen.insertion[record]), float(seen.tip_arc[record]))
        turns = max(turns, abs(writhe(inside)))
        loops = find_loops(inside, view=FRONT_TO_BACK, regions=regions, down=DOWN, rest=rest)
        for kind in {loop.kind for loop in loops}:
            lasting[kind.value] += stride * interval
    excess = seen.insertion - seen.tip_arc
    return Looping(
        excess=float(excess[-1]),
        excess_peak=float(excess.max()),
        writhe_peak=turns,
        seconds=lasting,
        at_end=loops,
        shortening=shortening(seen.insertion, seen.tip_arc),
    )


def shortening(
    insertion: Float[np.ndarray, " records"], tip_arc: Float[np.ndarray, " records"], *, stays: float = _STAYS
) -> float:
    """Most length of scope [m] that was pulled back while the tip stayed within `stays` of where it was [m]."""
    most = 0.0
    for start in range(len(insertion)):
        lost = np.flatnonzero(tip_arc[start:] < tip_arc[start] - stays)
        end = start + (int(lost[0]) if len(lost) else len(insertion) - start)
        most = max(most, float(insertion[start] - insertion[start:end].min()))
    return most


def _beside(
    scene: Scene, inside: Float[np.ndarray, "nodes 3"], insertion: float, tip_arc: float
) -> tuple[dict[str, tuple[float, float]], Rest]:
    """Where segments lie along a scope inside, and the colon at rest beside it; excess spread evenly."""
    line, behind = scene.colon.centreline, scene.cable.node_distances[-len(inside) :]
    stretch, skipped = insertion / max(tip_arc, 1e-6), insertion - behind[0]
    regions = {
        segment.name: (segment.start * stretch - skipped, segment.end * stretch - skipped)
        for segment in scene.colon.segments
    }
    return regions, Rest(line.points, line.arc, (insertion - behind) / stretch)
