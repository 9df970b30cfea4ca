"""A few triangles of a colon's surface at a record of a run, drawn off the scope as those that are saved.

As `haustra.models.wall.around_device` does with all of them, in the same loops: they buckle where they turn over, and
are drawn further off where they then stand across the scope.
"""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.models.wall.around_device import FURTHER, TURNS
from haustra.models.wall.compiled import loops
from haustra.models.wall.indentation import GAP, tops
from haustra.models.wall.lumen_table import axis_at
from haustra.models.wall.moving_colon import AxisShape, node_cell
from haustra.models.wall.unfolding import LOOKS, OPEN, ROUNDS, spans

REACH = 0.1
"""Triangles are drawn off the scope that is so far from them along the colon [m]: tents stand on less;
engineering choice."""
_ONE = np.zeros(1, np.int64)


class LocalWall:
    """The triangles along any stretch of one colon."""

    def __init__(self, recorded: RecordedRun) -> None:
        """Get to know the colon at rest."""
        self._colon, self._arcs, self._moved = recorded.scene.colon, recorded.arcs, recorded.moved
        self._radius = recorded.scene.cable.radius
        self._line = self._colon.centreline.points
        self._widths: Float[np.ndarray, " stations"] | None = None
        faces = self._colon.lumen.faces
        corners = self._arcs[faces]
        self._low, self._high, self._middle = corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)
        at_rest = self._colon.lumen.vertices[faces] - self._beside(self._middle)[:, None]
        self._least = OPEN * spans(at_rest)
        if self._moved is None:
            return
        own = self._moved.tables.mesentery
        assert own is not None
        nodes, spacing = own.nodes.shape[1], float(np.asarray(own.spacing)[0])
        self._own, self._cells = own, node_cell(np, spacing, nodes, self._arcs)
        self._still = np.asarray(axis_at(np, self._moved.tables, self._arcs[None]))
        origin, axes = self._moved.origin, self._moved.axes
        self._lever = ((self._colon.lumen.vertices - origin) @ axes)[None] - self._still
        self._to_colon = np.column_stack([axes, origin])
        one, each, edge = np.zeros((1, nodes)), np.zeros((1, nodes, 3)), np.zeros((1, nodes - 1, 3))
        turns = np.zeros((1, nodes, 4))
        self._shape = AxisShape(edge, one[:, 1:].copy(), each, one.copy(), turns, edge.copy(), one.copy(), each.copy())
        self._pose = np.zeros((1, nodes, 7))

    def move(self, pose: Float[np.ndarray, "nodes 7"] | None, widths: Float[np.ndarray, " stations"] | None) -> None:
        """Take the colon to where it is.

        Args:
            pose: of its nodes, in the tables' coordinates; None of one that is fixed.
            widths: of the lumen at even arc lengths, over that as given [1]; None: it is as it was given.
        """
        self._widths = widths
        if self._moved is None or pose is None:
            return
        self._pose[0], self._line = pose, self._moved.way(pose)
        loops().shape(self._own, _ONE, self._pose, self._shape)

    def stands_between(
        self,
        stretch: tuple[float, float],
        places: Float[np.ndarray, "places 3"],
        arcs: Float[np.ndarray, " places"],
        judged: Bool[np.ndarray, " places"],
    ) -> bool:
        """Whether a triangle stands between the scope's axis and the centreline, or none is there.

        Args:
            stretch: arc lengths between which triangles are looked at [m].
            places: of the axis, close to each other [m].
            arcs: arc lengths beside them [m].
            judged: which of them are looked at; the others draw the wall off as well.
        """
        chosen = np.flatnonzero((self._low <= stretch[1]) & (self._high >= stretch[0]))
        if not len(chosen):  # a surface too coarse to have a triangle there
            return True
        corners, faces = np.unique(self._colon.lumen.faces[chosen], return_inverse=True)
        faces = np.ascontiguousarray(faces.reshape(-1, 3))
        near = (arcs > stretch[0] - REACH) & (arcs < stretch[1] + REACH)
        places, arcs, judged = (np.ascontiguousarray(part[near]) for part in (places, arcs, judged))
        vertices, own, beside = self._carried(corners), self._arcs[corners], self._beside(arcs)
        axes, middles, least = self._beside(self._middle[chosen])[None], self._beside(own)[None], self._least[chosen]
        by = (arcs > stretch[0]) & (arcs < stretch[1])
        loops().unfold(faces, axes, least, LOOKS, ROUNDS, vertices[None])
        for turn in range(TURNS):
            radius = (1 + FURTHER * turn) * self._radius + GAP
            high = tops(places, beside, radius)
            loops().indent(places[None], arcs, high, own, middles, radius, 0, len(vertices), vertices[None])
            loops().lift(faces, own, places[by][None], arcs[by], beside[by][None], radius, vertices[None])
            loops().unfold(faces, axes, least, LOOKS, ROUNDS, vertices[None])
            if not loops().stands_between(vertices[None], faces, beside[judged][None], places[judged][None]):
                return False
        return True

    def _carried(self, corners: np.ndarray) -> Float[np.ndarray, "corners 3"]:
        share = self._share(self._arcs[corners])
        if self._moved is None:
            middle = self._beside(self._arcs[corners])
            return middle + share * (self._colon.lumen.vertices[corners] - middle)
        vertices = np.empty((len(corners), 3))
        about = *(part[corners] for part in self._cells), self._still[:, corners], self._lever[:, corners] * share
        loops().carry(self._pose, self._shape, *about, self._to_colon, 0, len(corners), vertices)
        return vertices

    def _share(self, arcs: np.ndarray) -> np.ndarray | float:
        """How wide the lumen is at arc lengths [m], over that as given [1]."""
        if self._widths is None:
            return 1.0
        return np.interp(arcs, np.linspace(0.0, self._colon.centreline.length, len(self._widths)), self._widths)[
            :, None
        ]

    def _beside(self, arcs: np.ndarray) -> Float[np.ndarray, "places 3"]:
        along = self._colon.centreline.arc
        return np.column_stack([np.interp(arcs, along, self._line[:, axis]) for axis in range(3)])
