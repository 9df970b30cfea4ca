"""A colon that has moved on its mesentery, as the rest of haustra knows colons: surface and centreline in place."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from haustra.envs.sim import moving_colon
from haustra.models.anatomy.colon import Centreline, Colon, Surface
from haustra.models.scene import entry_of
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.signed_distance import surface_arcs


class CurrentColon:
    """Takes one colon along with its axis."""

    def __init__(self, colon: Colon, tables: Tables) -> None:
        """For the colon's own tables, stacked and seen from its entry."""
        self._colon, self._tables = colon, tables
        self._origin, self._axes = entry_of(colon)
        assert tables.mesentery is not None
        self._mesentery = tables.mesentery
        self._spacing = float(np.asarray(tables.mesentery.spacing)[0])
        self._surface_arcs: np.ndarray | None = None

    def way(self, shift: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "stations 3"]:
        """Where the stations of the centreline are [m], given the nodes' displacements from the entry's axes [m]."""
        line = self._colon.centreline
        nodes = self._spacing * np.arange(len(shift))
        moved = np.column_stack([np.interp(line.arc, nodes, shift[:, axis]) for axis in range(3)])
        return line.points + moved @ self._axes.T

    def colon(self, shift: Float[np.ndarray, "nodes 3"]) -> Colon:
        """The colon with its surface and centreline where they are; frames and radii turn with it."""
        colon, line = self._colon, self._colon.centreline
        if self._surface_arcs is None:
            self._surface_arcs = surface_arcs(colon)
        vertices = self._carried(shift, colon.lumen.vertices, self._surface_arcs)
        frames = np.stack([self._turned(shift, line.frames[:, :, axis], line.arc) for axis in range(3)], axis=-1)
        return replace(
            colon,
            lumen=Surface(vertices, colon.lumen.faces),
            centreline=Centreline(self.way(shift), line.arc, frames),
        )

    def to_current(self, shift: Float[np.ndarray, "nodes 3"], place: Float[np.ndarray, "3"], arc: float) -> np.ndarray:
        """Where a place of the colon at rest, at that arc length, is now [m]."""
        return self._carried(shift, place[None], np.array([arc]))[0]

    def to_reference(
        self, shift: Float[np.ndarray, "nodes 3"], place: Float[np.ndarray, "3"], arc: float
    ) -> np.ndarray:
        """Where a place at that arc length would be, had the colon not moved [m]."""
        seen, moved = jnp.asarray((place - self._origin) @ self._axes)[None, None], jnp.asarray(shift)[None]
        turns = moving_colon.turns_of(self._mesentery, moved)
        rest = moving_colon.to_reference(self._tables, moved, turns, seen, jnp.asarray([[arc]]))
        return np.asarray(rest, float)[0, 0] @ self._axes.T + self._origin

    def _carried(self, shift: np.ndarray, points: np.ndarray, arcs: np.ndarray) -> np.ndarray:
        seen = (points - self._origin) @ self._axes
        moved = moving_colon.to_current(self._tables, jnp.asarray(shift)[None], jnp.asarray(seen)[None], arcs[None])
        return np.asarray(moved, float)[0] @ self._axes.T + self._origin

    def _turned(self, shift: np.ndarray, vectors: np.ndarray, arcs: np.ndarray) -> np.ndarray:
        seen = jnp.asarray(vectors @ self._axes)[None]
        turned = moving_colon.turned(self._mesentery, jnp.asarray(shift)[None], arcs[None], seen)
        return np.asarray(turned, float)[0] @ self._axes.T
