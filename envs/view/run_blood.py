"""Where a run left blood on the colon's wall: where mucosa was sheared by more than the assumed threshold, and when."""

import numpy as np
from jaxtyping import Float

from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.models.injury.bleeding import PATCH, bleeds

REACH = PATCH / 2
"""How far blood lies around a place that bleeds [m]; engineering choice: over the length of colon that bleeds once."""


def run_blood(run: RecordedRun) -> Float[np.ndarray, "places 5"]:
    """Places of the wall at rest [m], how far blood lies around each [m], and since when [s].

    A station bleeds from the first record on that shears it too much, where its wall was then next to the scope.
    """
    seen, stations = run.trajectory, stations_of(run.scene.colon)
    found, rest = [], run.scene.colon.lumen.vertices
    bleeding = np.asarray(bleeds(seen.shear), bool)
    for station in np.flatnonzero(bleeding.any(axis=0)):
        record = int(bleeding[:, station].argmax())
        beside = np.flatnonzero(np.abs(run.arcs - stations[station]) <= REACH)
        path = run.path(record)
        if not len(beside) or not len(path):
            continue
        nearest = beside[nearest_to(path, run.colon(record).lumen.vertices[beside])]
        found.append([*rest[nearest], REACH, seen.time[record]])
    return np.array(found, float).reshape(-1, 5)


def nearest_to(path: Float[np.ndarray, "nodes 3"], wall: Float[np.ndarray, "vertices 3"]) -> int:
    """Which vertex of a wall is nearest to any node of a path [m]."""
    return int(np.linalg.norm(wall[:, None] - path, axis=2).min(axis=1).argmin())
