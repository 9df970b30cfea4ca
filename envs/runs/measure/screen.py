"""At which records of a run it has to be looked closely whether the scope is within the colon's surface.

To move a whole surface, draw it off the scope and count how often it winds around the scope's axis takes half a second,
and a run has fifty records a second. Most of them are seen to be sound by less:

1. Every place of the axis is looked up in the colon's own table, where the colon is now. One that has more than `CLOSE`
   before it to the wall as if nobody touched it is within: a wall that is drawn off the scope only moves away from it.
2. Beside the others, triangles are brought to where they are, drawn off the scope as those of the surface that is
   saved (`haustra.envs.runs.measure.local_wall`), and looked for between the place and the centreline beside it. Where
   none stands there, it is within.

What is left is doubtful. Arc lengths beside the scope are followed from record to record, as spheres are in steps,
where the saved surface looks for them anew.
"""

import numpy as np
from jaxtyping import Float

from haustra.envs.runs.measure.local_wall import LocalWall
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.models.scene import entry_of
from haustra.models.wall.indentation import APART as FINE
from haustra.models.wall.lumen_table import WINDOW, put_distended
from haustra.models.wall.signed_distance import ANUS
from haustra.models.wall.table_wall import TableWalls

CLOSE = 0.0005
"""Places of the axis that are within this of the wall as if nobody touched it, or beyond it, are looked at closely [m];
engineering choice: as much as a scope may be found outside."""
APART = 0.005
"""Distance between the places of the axis that are looked up [m], as in `haustra.models.wall.around_device`;
engineering choice."""
_AROUND = 0.015
"""Triangles within this of a place along the colon are looked at [m]; engineering choice."""
_PAST = 0.02
"""A scope may be this far past the anus and still beside its lid [m]; engineering choice."""
_LOOKS, _FAR = 20, 0.9 * WINDOW
"""How often places are looked up at a record at most, and how much further along the colon than at the last look they
have to be for another [m]; engineering choice: devices in steps never are."""
_ONE = np.zeros(1, np.int64)


class WallScreen:
    """Tells of the records of one run, one after the other, whether the scope may be outside the surface there."""

    def __init__(self, recorded: RecordedRun) -> None:
        """Get to know the colon, which is tabulated where it was not."""
        self._run, scene = recorded, recorded.scene
        self._radius, self._behind = scene.cable.radius, scene.cable.node_distances
        self._own = np.arange(0.0, self._behind[0], APART)
        self._origin, self._axes = entry_of(scene.colon)
        tables = recorded.tables._replace(wall=recorded.tables.wall.copy())  # gas makes it wider
        self._wall = recorded.tables.wall
        self._walls = TableWalls(tables, 1, len(self._own), radius=self._radius)
        self._near = LocalWall(recorded)
        self._begun = False

    def doubtful(self, record: int) -> bool:
        """Whether the scope may be outside at a record; call for each in turn."""
        inserted, shape = float(self._run.trajectory.insertion[record]), self._run.shape(record)
        self._look(record, self._places(shape, self._own), inserted)
        inside, arcs = self._own < inserted, self._walls.arcs[0]
        beside_lid = (arcs <= ANUS) & (self._own < inserted - _PAST)
        close = inside & ((self._walls.depth[0] > self._radius - CLOSE) | beside_lid)
        if not close.any():
            return False
        self._near.move(self._walls.displacement and self._walls.displacement.pose[0], self._run.widths(record))
        fine = np.arange(0.0, min(inserted, self._behind[0]), FINE)
        places, at = self._places(shape, fine), np.interp(fine, self._own, arcs)
        judged = np.interp(fine, self._own, close) > 0.5
        return any(
            self._near.stands_between(stretch, places, at, judged & (at >= stretch[0]) & (at <= stretch[1]))
            for stretch in _stretches(np.sort(at[judged]))
        )

    def _places(self, shape: Float[np.ndarray, "nodes 3"], own: np.ndarray) -> Float[np.ndarray, "places 3"]:
        """Places of the axis so far behind the tip [m]."""
        return np.column_stack([np.interp(own, self._behind[::-1], shape[::-1, axis]) for axis in range(3)])

    def _look(self, record: int, places: Float[np.ndarray, "places 3"], inserted: float) -> None:
        """Look the places up, near where they were at the record before."""
        ahead = np.maximum(inserted - self._own, 0.0)
        self._walls.arcs[0] = np.where(ahead > 0, self._walls.arcs[0], 0.0) if self._begun else ahead
        self._begun = True
        if self._walls.displacement is not None and self._run.moved is not None:
            pose = self._run.moved.from_scene(self._run.trajectory.displacement[record])
            self._walls.displacement.pose[0] = pose
        if (widths := self._run.widths(record)) is not None:
            put_distended(self._walls.table, self._wall, widths, device_radius=self._radius)
        points = ((places - self._origin) @ self._axes)[None]
        for _ in range(_LOOKS):
            known = self._walls.arcs[0, ahead > 0]
            self._walls.look(_ONE, points)
            if not (np.abs(self._walls.arcs[0, ahead > 0] - known) > _FAR).any():
                break


def _stretches(arcs: Float[np.ndarray, " places"]) -> list[tuple[float, float]]:
    """Stretches of colon around arc lengths [m] in rising order; those that overlap are one."""
    first = np.flatnonzero(np.diff(arcs, prepend=-np.inf) > 2 * _AROUND)
    last = np.append(first[1:], len(arcs)) - 1
    return [(float(arcs[a]) - _AROUND, float(arcs[b]) + _AROUND) for a, b in zip(first, last, strict=True)]
