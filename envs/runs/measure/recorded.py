"""A run as it was recorded: where scope and colon lay at each record."""

from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.runs.insertion import Trajectory
from haustra.envs.sim.gas import GasRecord, segment_weights, station_widths, widened
from haustra.envs.sim.moved_colon import CurrentColon, current_colon
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import Scene, entry_of
from haustra.models.wall.around_device import around_device
from haustra.models.wall.lumen_table import Tables, lumen_table, stack
from haustra.models.wall.signed_distance import surface_arcs


class RecordedRun:
    """Scope and colon at the records of one run."""

    def __init__(self, scene: Scene, trajectory: Trajectory, gas: GasRecord | None = None) -> None:
        """Take what was run and recorded; without the record of its gas, colons are as wide as they were given."""
        self.scene, self.trajectory, self._gas = scene, trajectory, gas
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)
        self._links = [self.model.body(name).id for name in scene.cable.links]
        self._tip = self.model.site("scope/tip").id

    @cached_property
    def arcs(self) -> Float[np.ndarray, " vertices"]:
        """Arc length of each vertex of the colon's surface [m]."""
        return surface_arcs(self.scene.colon)

    def place(self, record: int) -> None:
        """Bring `data` to where the scope was at a record, as far as kinematics go."""
        self.data.qpos[:] = self.trajectory.qpos[record]
        mujoco.mj_kinematics(self.model, self.data)

    def shape(self, record: int) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis, from the handle end of the modelled part to the tip [m]."""
        self.place(record)
        return np.vstack([self.data.xpos[self._links], self.data.site_xpos[self._tip]])

    def tip_frame(self) -> Float[np.ndarray, "3 3"]:
        """Columns: wire 'up', wire 'left' and the viewing direction, at the record that was placed last."""
        return self.data.site_xmat[self._tip].reshape(3, 3).copy()

    def path(self, record: int) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis past the anus, from there to the tip [m]."""
        shape = self.shape(record)
        return shape[self.scene.cable.node_distances < self.trajectory.insertion[record]]

    def colon(self, record: int) -> Colon:
        """The colon as it lay on its mesentery, as gas held it, where that is known, and as the scope indented it."""
        colon = self.scene.colon
        if self.moved is not None:
            colon = self.moved.colon(self.moved.from_scene(self.trajectory.displacement[record]))
        if (widths := self.widths(record)) is not None:
            colon = widened(colon, self.arcs, widths)
        return self.indented(colon, self.path(record))

    def widths(self, record: int) -> Float[np.ndarray, " stations"] | None:
        """How wide gas held the lumen at stations of the table, over that as given [1]; None where nothing is known."""
        return None if self._gas is None else station_widths(self._weights, self._gas.share[record])

    @cached_property
    def _weights(self) -> Float[np.ndarray, "stations segments"]:
        return segment_weights(self.scene.colon, int(self.tables.count[0]))

    @cached_property
    def tables(self) -> Tables:
        """The colon's own, for the scope, stacked and seen from the entry."""
        if self.moved is not None:
            return self.moved.tables
        table = lumen_table(self.scene.colon, device_radius=self.scene.cable.radius)
        return stack([table.seen_from(*entry_of(self.scene.colon))])

    def indented(self, colon: Colon, path: Float[np.ndarray, "nodes 3"]) -> Colon:
        """The colon, where it was, with its wall out of the scope's way and no triangle of it turned over.

        Args:
            colon: as it lay on its mesentery.
            path: the scope's axis past the anus [m].
        """
        return around_device(self.scene.colon, colon, self.arcs, path, radius=self.scene.cable.radius)

    @cached_property
    def moved(self) -> CurrentColon | None:
        """What takes the colon along with its axis; None where it is fixed."""
        return current_colon(self.scene)
