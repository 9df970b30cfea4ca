"""The lumen's surface as a renderer takes it: in short stretches, each brought to where it is when it is looked at.

A colon that moves is taken along with its axis (`haustra.models.wall.moving_colon`), and out of the way of the device
in it (`haustra.models.wall.indentation`). Only stretches that a camera may see are worked out, so that a picture costs
the same however long and finely meshed the colon is.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.wall.compiled import loops
from haustra.models.wall.indentation import FALL, GAP, along_device, tops
from haustra.models.wall.lumen_table import Tables, axis_at
from haustra.models.wall.moving_colon import AT_REST, AxisShape, node_cell
from haustra.models.wall.signed_distance import surface_arcs


class Skin(NamedTuple):
    """What each vertex is taken along with (`haustra.models.wall.moving_colon`), for renderers that do so."""

    node: Int[np.ndarray, " vertices"]
    """Node of the axis before it."""
    share: Float[np.ndarray, " vertices"]
    """Share of the way from there to the next node [1]."""
    axis: Float[np.ndarray, "vertices 3"]
    """Place of the axis at rest beside it, in the colon's own coordinates [m]."""
    lever: Float[np.ndarray, "vertices 3"]
    """From there to the vertex at rest [m]."""


class Posture(NamedTuple):
    """How a colon lies now."""

    nodes: Float[np.ndarray, "nodes 12"]
    """How far each node of its axis has moved [m], and by which share its section is flattened; the section's turn, a
    unit quaternion; the direction in which it is flattened, and nought."""
    axes: Float[np.ndarray, "3 4"]
    """Columns: axes of the colon's own coordinates in the world, and where they begin [m]."""


class Device(NamedTuple):
    """What the wall is kept off."""

    places: Float[np.ndarray, "places 3"]
    """Where the device's axis is [m]."""
    arcs: Float[np.ndarray, " places"]
    """Arc lengths beside them [m]."""
    tops: Float[np.ndarray, " places"]
    """How far from the centreline the wall over them stands at most [m] (`haustra.models.wall.indentation.tops`)."""
    radius: float
    """How far the wall is kept off that axis [m]."""


STRETCH = 0.015
"""Length of colon in one stretch [m]."""
_APART = 0.002
"""Distance between the places of a device's axis that indent the wall in a picture [m]."""
_ONE = np.zeros(1, np.int64)
"""The only world."""
_ROOM = 0.03
"""Stretches are taken to be wider than at rest by this, for what a device may indent [m]."""


class LumenSurface:
    """A surface, its vertices ordered by arc length; where they are now is worked out stretch by stretch."""

    def __init__(self, surface: Surface, arcs: Float[np.ndarray, " vertices"] | None = None) -> None:
        """Take a surface and the arc length beside each vertex [m]; one stretch of all when None."""
        arcs = np.zeros(len(surface.vertices)) if arcs is None else arcs
        stretch = np.unique(np.floor(arcs / STRETCH), return_inverse=True)[1]
        self.given = surface
        """The surface as it was given."""
        self.given_vertices: Float[np.ndarray, "vertices 3"] = surface.vertices
        """Where its vertices were put last; of colons that move or are indented, where they would be at rest [m]."""
        self.order: Int[np.ndarray, " vertices"] = np.argsort(stretch, kind="stable")
        """Which vertex of the given surface each is."""
        placed = np.empty(len(arcs), np.int64)
        placed[self.order] = np.arange(len(arcs))
        first, last = stretch[surface.faces].min(axis=1), stretch[surface.faces].max(axis=1)
        self.face_order: Int[np.ndarray, " triangles"] = np.argsort(first, kind="stable")
        """Which triangle of the given surface each is."""
        self.faces = np.ascontiguousarray(placed[surface.faces[self.face_order]], np.int32)
        self.rest = np.ascontiguousarray(surface.vertices[self.order], float)
        """Where the vertices are at rest [m]."""
        self.vertices = self.rest.copy()
        """Where they are now, of the stretches that were brought there [m]."""
        self.arcs = arcs[self.order]
        self.count = int(stretch.max()) + 1
        """Number of stretches."""
        self.ends = np.searchsorted(stretch[self.order], np.arange(self.count + 1))
        """First vertex of each stretch, and the end."""
        self.face_ends = np.searchsorted(first[self.face_order], np.arange(self.count + 1))
        """First triangle of each stretch, and the end."""
        self._last = np.arange(self.count)
        np.maximum.at(self._last, first, last)
        self._extents()

    def place(self, vertices: Float[np.ndarray, "vertices 3"]) -> None:
        """Put the vertices of the given surface there [m]."""
        self.given_vertices = vertices
        np.take(vertices, self.order, axis=0, out=self.vertices)
        self._extents()

    def balls(self) -> tuple[Float[np.ndarray, "stretches 3"], Float[np.ndarray, " stretches"]]:
        """Middles and radii of balls that hold each stretch's triangles now [m]."""
        from haustra.envs.view.picture import kernels

        return self._middles, kernels.widest_balls(self._middles, self._reaches, self._last)

    def needed(self, stretches: Int[np.ndarray, " some"]) -> Int[np.ndarray, " more"]:
        """Stretches that hold the corners of these stretches' triangles, and of the triangles beside them."""
        from haustra.envs.view.picture import kernels

        return kernels.holding(stretches, self._last)

    def bring(self, stretch: int) -> None:
        """Bring the vertices of a stretch to where they are now."""

    def _extents(self) -> None:
        low, high = (fold.reduceat(self.vertices, self.ends[:-1]) for fold in (np.minimum, np.maximum))
        self._middles, self._reaches = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2


class ColonSurface(LumenSurface):
    """The surface of a colon, kept off a device that is in it."""

    def __init__(self, colon: Colon) -> None:
        """Take a colon, where it is."""
        self.colon, self.line = colon, colon.centreline.points
        """The colon as it was given, and where the stations of its centreline are now [m]."""
        self.device: Device | None = None
        """What the wall is kept off now."""
        self.placings = 0
        """How often vertices were put elsewhere, but for how the axis has moved: as often `skin` is another."""
        super().__init__(colon.lumen, surface_arcs(colon))
        self._placed, self._fresh = self.vertices.copy(), np.zeros(self.count, bool)
        wide = np.linalg.norm(self.vertices - self._line_at(self.arcs), axis=1)
        self._narrow = np.minimum.reduceat(wide, self.ends[:-1]) / 2  # sections may flatten, and be placed anew

    def place(self, vertices: Float[np.ndarray, "vertices 3"]) -> None:
        """As `LumenSurface.place`; the centreline stays."""
        super().place(vertices)
        self._placed = self.vertices.copy()
        self.placings += 1
        self._fresh[:] = False

    def skin(self) -> Skin:
        """What each vertex is taken along with."""
        axis, still = self._line_at(self.arcs), np.zeros(len(self.arcs))
        return Skin(still.astype(np.int64), still, axis, self._placed - axis)

    def posture(self) -> Posture:
        """How the colon lies now: where it was placed."""
        nodes = np.tile([0.0] * 4 + [1.0] + [0.0] * 7, (2, 1))
        return Posture(nodes, np.eye(3, 4))

    def indent(self, path: Float[np.ndarray, "nodes 3"], radius: float) -> None:
        """Keep the wall off a device of that radius [m] along `path`, from the anus on [m]; off none if it is empty."""
        self.device = None
        self._fresh[:] = False
        if len(path) > 1:
            arcs = self.colon.centreline.arc
            places, beside, high = along_device(path, self.line, arcs, _APART, radius + GAP)
            self.device = Device(places, arcs[beside], high, radius + GAP)

    def widen(self, widths: Float[np.ndarray, " places"]) -> None:
        """Let the lumen be so wide at even arc lengths, over that at rest [1], as gas holds it."""
        self._stretch(
            np.interp(self.arcs, np.linspace(0.0, self.colon.centreline.length, len(widths)), widths)[:, None]
        )
        self.placings += 1
        self._fresh[:] = False

    def make_room(self, tip: Float[np.ndarray, "3"], ahead: Float[np.ndarray, "3"], arc: float, radius: float) -> None:
        """Keep the wall off a tip of that radius [m] that ends there and points ahead, at that arc length [m]."""
        behind = radius + np.linspace(0.0, 2 * radius, 5)
        places, arcs = tip - behind[:, None] * ahead, arc - behind
        self.device = Device(places, arcs, tops(places, self._line_at(arcs), radius + GAP), radius + GAP)
        self._fresh[:] = False

    def bring(self, stretch: int) -> None:
        """As `LumenSurface.bring`."""
        if self._fresh[stretch]:
            return
        first, last = int(self.ends[stretch]), int(self.ends[stretch + 1])
        self._carry(first, last)
        if self.device is not None:
            places, at, top, radius = self.device
            near = top - FALL * (np.abs(at - self.arcs[first]) - 2 * STRETCH) > self._narrow[stretch]
            if near.any():
                middles = self._axis_beside(first, last)[None]
                now = self.arcs[first:last], middles, radius, 0, last - first, self.vertices[None, first:last]
                loops().indent(places[None, near], at[near], top[near], *now)
        self._fresh[stretch] = True

    def _stretch(self, share: np.ndarray) -> None:
        """Let vertices stand off the centreline by a share of what they do at rest."""
        middle = self._line_at(self.arcs)
        self._placed = middle + (self.rest - middle) * share

    def _carry(self, first: int, last: int) -> None:
        """Take some vertices to where they would be without a device."""
        self.vertices[first:last] = self._placed[first:last]

    def _axis_beside(self, first: int, last: int) -> np.ndarray:
        """Places of the axis beside some vertices, from which these are pushed away."""
        return self._line_at(self.arcs[first:last])

    def _line_at(self, arcs: np.ndarray) -> np.ndarray:
        """Places of the centreline at arc lengths, where it is now."""
        along = self.colon.centreline.arc
        return np.column_stack([np.interp(arcs, along, self.line[:, axis]) for axis in range(3)])


class MovingSurface(ColonSurface):
    """The surface of a colon on its mesentery."""

    def __init__(
        self, colon: Colon, tables: Tables, origin: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]
    ) -> None:
        """For the colon's own tables, stacked and in coordinates that begin at `origin` [m] with columns `axes`."""
        super().__init__(colon)
        assert tables.mesentery is not None
        self._own, self._line = tables.mesentery, colon.centreline
        nodes, spacing = self._own.nodes.shape[1], float(np.asarray(self._own.spacing)[0])
        self._cells = node_cell(np, spacing, nodes, self.arcs)
        self._way = node_cell(np, spacing, nodes, self._line.arc)
        self._still = np.asarray(axis_at(np, tables, self.arcs[None]))
        self._lever = self._slim = np.ascontiguousarray(((self.rest - origin) @ axes)[None] - self._still)
        self._axes = np.column_stack([axes, origin])
        one, each, edge = np.zeros((1, nodes)), np.zeros((1, nodes, 3)), np.zeros((1, nodes - 1, 3))
        turns = np.zeros((1, nodes, 4))
        self._shape = AxisShape(edge, one[:, 1:].copy(), each, one.copy(), turns, edge.copy(), one.copy(), each.copy())
        self._posture = Posture(np.zeros((nodes, 12)), self._axes)
        begin, end = self.arcs[self.ends[:-1]], self.arcs[self.ends[1:] - 1]
        self._beside = np.clip(np.searchsorted(self._line.arc, (begin + end) / 2), 0, len(self.line) - 1)
        wide = np.maximum.reduceat(np.linalg.norm(self._lever[0], axis=1), self.ends[:-1])
        self._reaches = wide + STRETCH + _ROOM
        self._pose = np.zeros((1, nodes, 7))
        self.move(np.tile(np.asarray(AT_REST), (nodes, 1)))

    def move(self, pose: Float[np.ndarray, "nodes 7"]) -> None:
        """Take the colon to where its nodes have such poses (`haustra.models.wall.moving_colon.AxisDisplacement`)."""
        self._pose[0] = pose[: self._pose.shape[1]]
        loops().shape(self._own, _ONE, self._pose, self._shape)
        self.line = np.empty_like(self._line.points)
        loops().way(self._pose, *self._way, self._line.points, self._axes, self.line)
        self._middles = self.line[self._beside]
        self._fresh[:] = False

    def skin(self) -> Skin:
        """As `ColonSurface.skin`."""
        return Skin(*self._cells, self._still[0], self._lever[0])

    def posture(self) -> Posture:
        """As `ColonSurface.posture`, and where the axis was moved to."""
        nodes, shape = self._posture.nodes, self._shape
        nodes[:, :3], nodes[:, 3] = self._pose[0, :, :3], shape.flats[0]
        nodes[:, 4:8], nodes[:, 8:11] = shape.turns[0], shape.acrosses[0]
        return self._posture

    def _stretch(self, share: np.ndarray) -> None:
        self._lever = np.ascontiguousarray(self._slim * share)

    def _carry(self, first: int, last: int) -> None:
        about = self._pose, self._shape, *self._cells, self._still, self._lever, self._axes
        loops().carry(*about, first, last, self.vertices)

    def _axis_beside(self, first: int, last: int) -> np.ndarray:
        at, share = (each[first:last] for each in self._cells)
        moved = (1 - share[:, None]) * self._pose[0, at, :3] + share[:, None] * self._pose[0, at + 1, :3]
        return self._axes[:, 3] + (self._still[0, first:last] + moved) @ self._axes[:, :3].T
