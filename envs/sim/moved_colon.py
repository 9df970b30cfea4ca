"""A colon that has moved on its mesentery, as the rest of haustra knows colons: surface and centreline in place."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from haustra.models.anatomy.colon import Centreline, Colon, Surface
from haustra.models.scene import Scene, entry_of
from haustra.models.wall import moving_colon
from haustra.models.wall.compiled import loops
from haustra.models.wall.lumen_table import Tables, lumen_table, pick, stack
from haustra.models.wall.piece_wall import Blocks
from haustra.models.wall.signed_distance import surface_arcs
from haustra.models.wall.unfolding import unfolded


def current_colon(scene: Scene) -> "CurrentColon | None":
    """What takes a scene's colon along with its axis; None where the colon is fixed."""
    if not scene.options.mesentery:
        return None
    origin, axes = entry_of(scene.colon)
    own = {"device_radius": scene.cable.radius, "with_mesentery": True, "abdomen": scene.options.abdomen}
    return CurrentColon(scene.colon, stack([lumen_table(scene.colon, **own).seen_from(origin, axes)]), origin, axes)


class CurrentColon:
    """Takes one colon along with its axis."""

    def __init__(
        self, colon: Colon, tables: Tables, origin: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]
    ) -> None:
        """For the colon's own tables, stacked and in coordinates that begin at `origin` [m] with columns `axes`."""
        self._colon = colon
        self.tables = tables
        """Tables of the colon, stacked."""
        self.origin, self.axes = origin, axes
        """Where the tables' coordinates lie in the colon's own: where they begin [m], and columns."""
        assert tables.mesentery is not None
        self._mesentery = tables.mesentery
        spacing, nodes = float(np.asarray(tables.mesentery.spacing)[0]), tables.mesentery.nodes.shape[1]
        self._stations = moving_colon.node_cell(np, spacing, nodes, colon.centreline.arc)
        self._surface_arcs: np.ndarray | None = None

    def way(self, displacement: Float[np.ndarray, "nodes 7"]) -> Float[np.ndarray, "stations 3"]:
        """Where the stations of the centreline are [m], given poses of the nodes in the tables' coordinates."""
        points = self._colon.centreline.points
        way = np.empty_like(points)
        loops().way(np.array(displacement[None], float, order="C"), *self._stations, points, self.axes, way)
        return way

    def colon(self, displacement: Float[np.ndarray, "nodes 7"]) -> Colon:
        """The colon with its surface and centreline where they are; frames and radii turn with it."""
        colon, line = self._colon, self._colon.centreline
        if self._surface_arcs is None:
            self._surface_arcs = surface_arcs(colon)
        arcs = self._surface_arcs
        vertices = self.to_current_all(displacement, colon.lumen.vertices, arcs)
        frames = np.einsum("sij,sjk->sik", self._turns(displacement, line.arc), line.frames)
        line = Centreline(self.way(displacement), line.arc, frames)
        return unfolded(colon, replace(colon, lumen=Surface(vertices, colon.lumen.faces), centreline=line), arcs)

    def to_current(
        self, displacement: Float[np.ndarray, "nodes 7"], place: Float[np.ndarray, "3"], arc: float
    ) -> np.ndarray:
        """Where a place of the colon at rest, at that arc length, is now [m]."""
        return self.to_current_all(displacement, place[None], np.array([arc]))[0]

    def to_reference(
        self, displacement: Float[np.ndarray, "nodes 7"], place: Float[np.ndarray, "3"], arc: float
    ) -> np.ndarray:
        """Where a place at that arc length would be, had the colon not moved [m]."""
        seen, moved = ((place - self.origin) @ self.axes)[None, None], np.asarray(displacement, float)[None]
        shape = moving_colon.shape_of(np, self._mesentery, moved)
        rest = moving_colon.to_reference(np, self.tables, moved, shape, seen, np.array([[arc]]))
        return rest[0, 0] @ self.axes.T + self.origin

    def moved_at_rest(
        self,
        displacement: Float[np.ndarray, "nodes 7"],
        place: Float[np.ndarray, "3"],
        arc: float,
        move: Callable[[np.ndarray], np.ndarray],
    ) -> np.ndarray:
        """Where a place at that arc length would be now, had it been moved so in the colon at rest [m]."""
        return self.to_current(displacement, move(self.to_reference(displacement, place, arc)), arc)

    def from_scene(self, displacement: Float[np.ndarray, "nodes 7"]) -> Float[np.ndarray, "nodes 7"]:
        """Poses of the nodes in the tables' coordinates, given those in the scene's, as readings have them."""
        return moving_colon.poses_seen_from(displacement, self.axes)

    def poses(
        self, displacement: Float[np.ndarray, "nodes 7"], blocks: Blocks
    ) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where blocks of the wall are [m], and how they are turned, as quaternions."""
        places, turns = self.many_poses(np.asarray(displacement, float)[None], blocks)
        return places[0], turns[0]

    def many_poses(
        self, displacements: Float[np.ndarray, "records nodes 7"], blocks: Blocks
    ) -> tuple[Float[np.ndarray, "records blocks 3"], Float[np.ndarray, "records blocks 4"]]:
        """`poses` for several instants."""
        count = len(displacements)
        if not len(blocks.arcs):
            return np.zeros((count, 0, 3)), np.zeros((count, 0, 4))
        tables = pick(self.tables, np.zeros(count, int))
        places = np.broadcast_to((blocks.places - self.origin) @ self.axes, (count, len(blocks.arcs), 3))
        arcs = np.broadcast_to(blocks.arcs, places.shape[:2])
        assert tables.mesentery is not None
        shape = moving_colon.shape_of(np, tables.mesentery, displacements)
        moved, turns = moving_colon.section_poses(np, tables, displacements, shape, places, arcs)
        turn = np.concatenate([turns[..., :1], turns[..., 1:] @ self.axes.T], axis=-1)
        return moved @ self.axes.T + self.origin, turn

    def to_current_all(
        self,
        displacement: Float[np.ndarray, "nodes 7"],
        points: Float[np.ndarray, "points 3"],
        arcs: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, "points 3"]:
        """Where places of the colon at rest, at those arc lengths, are now [m]."""
        seen = (points - self.origin) @ self.axes
        moved = moving_colon.to_current(np, self.tables, np.asarray(displacement, float)[None], seen[None], arcs[None])
        return moved[0] @ self.axes.T + self.origin

    def _turns(self, displacement: np.ndarray, arcs: np.ndarray) -> Float[np.ndarray, "stations 3 3"]:
        """How cross-sections are turned at arc lengths, as matrices."""
        pose, still = np.asarray(displacement, float)[None], np.zeros((1, len(arcs), 3))
        shape = moving_colon.shape_of(np, self._mesentery, pose)
        _, turns = moving_colon.section_poses(np, self.tables, pose, shape, still, arcs[None])
        return self.axes @ Rotation.from_quat(turns[0], scalar_first=True).as_matrix() @ self.axes.T
