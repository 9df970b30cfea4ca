"""Whether the surface that is saved with a run is sound: the scope inside it, and no triangle of it turned over."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.winding import winding_numbers
from haustra.models.scene import Scene
from haustra.models.wall.unfolding import facing_out

_WITHIN = 0.5
"""Points that a surface winds around at least so often are within it [1]."""
_APART = 0.005
"""Distance between places of the scope that are looked at [m]."""
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
    """How many surfaces were judged."""


@dataclass(frozen=True)
class LeftBehind:
    """A colon as a scope has left it."""

    colon: Colon
    """The colon as it lay, and as the scope indented it."""
    figures: SurfaceFigures
    """What was wrong with its surface over the run, at worst."""


def left_behind(scene: Scene, run: Insertion, *, records: int = _RECORDS) -> LeftBehind:
    """Lay the colon as a run has left it, indented by its scope, and judge its surface over the run.

    Each surface that is judged takes some half a second.

    Args:
        scene: what was run.
        run: how it ended.
        records: how many surfaces are judged, evenly over the run, its end among them.
    """
    recorded, before = run.trajectory, RecordedRun(scene, run.trajectory)
    arcs = before.arcs
    inside = recorded.insertion[-1] if len(recorded.time) else scene.options.start_depth
    path = run.shape[scene.cable.node_distances < inside]
    now = before.indented(run.colon, path)
    judged = [surface_figures(scene.colon, now, arcs, path)]
    if run.gas is None and len(recorded.time) > 1:  # widths under gas are not recorded
        for record in np.unique(np.linspace(0, len(recorded.time) - 1, records).astype(int))[:-1].tolist():
            judged.append(surface_figures(scene.colon, before.colon(record), arcs, before.path(record)))
    worst = SurfaceFigures(max(each.outside for each in judged), max(each.turned_over for each in judged), len(judged))
    return LeftBehind(now, worst)


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
    if len(path) < 2:
        return 0.0
    behind = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    own = np.linspace(0.0, behind[-1], int(np.ceil(behind[-1] / _APART)) + 1)
    places = np.column_stack([np.interp(own, behind, path[:, axis]) for axis in range(3)])
    out = places[winding_numbers(lumen, places) < _WITHIN]
    return float(KDTree(lumen.vertices).query(out)[0].max()) if len(out) else 0.0
