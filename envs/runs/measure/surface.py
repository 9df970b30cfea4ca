"""Whether the surface that is saved with a run is sound: the scope inside it, and no triangle of it turned over.

Triangles are looked at at some records of a run, the scope at every one (`haustra.envs.runs.measure.screen`).
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.measure.screen import WallScreen
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.scene import Scene
from haustra.models.wall.around_device import places_outside
from haustra.models.wall.unfolding import facing_out

_RECORDS = 7
"""How many surfaces of a run are judged by default; engineering choice, for seconds of work."""


@dataclass(frozen=True)
class SurfaceFigures:
    """What is wrong with a surface, or with the worst of several."""

    outside: float
    """How far the place of the scope's axis that is furthest outside is from the surface [m]; 0 when all are within."""
    turned_over: float
    """Share of triangles that face their own axis and did not at rest [1]."""
    records: int = 1
    """At how many records triangles were looked at."""
    looked: int = 1
    """At how many it was seen whether the scope is outside."""


@dataclass(frozen=True)
class LeftBehind:
    """A colon as a scope has left it."""

    colon: Colon
    """The colon as it lay, and as the scope indented it."""
    figures: SurfaceFigures
    """What was wrong with its surface over the run, at worst."""
    seconds: float = 0.0
    """What it took to find out [s]."""


@dataclass(frozen=True)
class Judged:
    """A colon at one record of a run, as its scope indented it, and what is wrong with its surface."""

    colon: Colon
    """The colon there."""
    tip: Float[np.ndarray, "3"]
    """Where the tip was [m]."""
    tip_frame: Float[np.ndarray, "3 3"]
    """Columns: wire 'up', wire 'left' and the viewing direction."""
    figures: SurfaceFigures
    """What was wrong with the surface."""


def judged(
    scene: Scene, run: Insertion, *, records: int = _RECORDS, before: RecordedRun | None = None
) -> Iterator[Judged]:
    """Lay the colon at records of a run, its end first, and judge it there.

    Each takes some 0.2 s.

    Args:
        scene: what was run.
        run: how it ended.
        records: how many surfaces are judged, evenly over the run, its end among them.
        before: the run at its records, where that is known already.
    """
    recorded, before = run.trajectory, before or RecordedRun(scene, run.trajectory, run.gas)
    arcs = before.arcs
    inside = recorded.insertion[-1] if len(recorded.time) else scene.options.start_depth
    path = run.shape[scene.cable.node_distances < inside]
    now = before.indented(run.colon, path)
    yield Judged(now, run.shape[-1], run.tip_frame, surface_figures(scene.colon, now, arcs, path))
    if len(recorded.time) < 2:
        return
    for record in np.unique(np.linspace(0, len(recorded.time) - 1, records).astype(int))[:-1].tolist():
        now, path, shape = before.colon(record), before.path(record), before.shape(record)
        figures = surface_figures(scene.colon, now, arcs, path)
        yield Judged(now, shape[-1], before.tip_frame(), figures)


def left_behind(scene: Scene, run: Insertion, *, records: int = _RECORDS) -> LeftBehind:
    """Lay the colon as a run has left it, indented by its scope, and judge its surface over the run.

    Triangles at some records (`judged`), and whether the scope is outside at every one (`outside_at_records`).

    Args:
        scene: what was run.
        run: how it ended.
        records: how many surfaces are judged, evenly over the run, its end among them.
    """
    begun, before = time.perf_counter(), RecordedRun(scene, run.trajectory, run.gas)
    at = judged(scene, run, records=records, before=before)
    last = next(at)
    figures = [last.figures, *(each.figures for each in at)]
    found = worst(figures, outside_at_records(run, before))
    return LeftBehind(last.colon, found, time.perf_counter() - begun)


def worst(figures: Sequence[SurfaceFigures], outside: Float[np.ndarray, " records"]) -> SurfaceFigures:
    """What was wrong at worst with several surfaces of one run.

    Args:
        figures: of surfaces that were judged.
        outside: how far the scope was outside at each record (`outside_at_records`) [m].
    """
    furthest = max(*(each.outside for each in figures), outside.max(initial=0.0))
    over = max(each.turned_over for each in figures)
    return SurfaceFigures(float(furthest), over, len(figures), max(len(outside), len(figures)))


def outside_at_records(run: Insertion, before: RecordedRun) -> Float[np.ndarray, " records"]:
    """How far the scope's axis was outside the surface at every record, as `SurfaceFigures` [m].

    Surfaces are laid and judged where a look at what is beside the scope leaves it open (`WallScreen`): one
    to five milliseconds a record, and half a second where it does.
    """
    count = len(run.trajectory.time)
    found = np.zeros(count)
    screen = WallScreen(before) if count else None
    for record in range(count):
        if screen is not None and screen.doubtful(record):
            found[record] = _outside(before.colon(record).lumen, before.path(record))
    return found


def surface_figures(
    rest: Colon, now: Colon, arcs: Float[np.ndarray, " vertices"], path: Float[np.ndarray, "nodes 3"]
) -> SurfaceFigures:
    """Judge the surface of a colon that was moved and indented.

    Args:
        rest: the colon at rest.
        now: the same colon now.
        arcs: arc length of each vertex [m].
        path: the scope's axis past the anus [m].
    """
    over = facing_out(rest, arcs) & ~facing_out(now, arcs)
    return SurfaceFigures(_outside(now.lumen, path), float(over.mean()))


def _outside(lumen: Surface, path: np.ndarray) -> float:
    out = places_outside(lumen, path)
    return float(KDTree(lumen.vertices).query(out)[0].max()) if len(out) else 0.0
