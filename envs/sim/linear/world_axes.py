"""Axes of colons that move, of each world its own: water weighs on each differently."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.linear.layout import AXIS
from haustra.envs.sim.linear.pack import pack_axis
from haustra.envs.sim.water_weight import WaterWeight
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.mesentery import Mesentery

_LOAD = slice(AXIS.index("load"), AXIS.index("load") + 3)


class WorldAxes:
    """Rows of nodes as `pack_axis` makes them: for each way that colons hang, those of all worlds."""

    def __init__(self, hung: Mesentery, columns: tuple[str, ...], colons: Sequence[Colon], worlds: int) -> None:
        """Give all worlds the first colon.

        Args:
            hung: mesenteries of all colons, once for each way that they hang.
            columns: of the program (`haustra.envs.sim.linear.layout.Layout.columns`).
            colons: as they were given.
            worlds: how many.
        """
        self._columns, self._colons, self._worlds = columns, colons, worlds
        self._ways, self._nodes = len(hung.spacing) // len(colons), hung.nodes.shape[1]
        self.rehang(hung)
        first = self._packed[:, np.zeros(worlds, int)].reshape(-1, len(columns))
        self.rows: Float[np.ndarray, "rows columns"] = np.vstack([first, np.ones((1, len(columns)))])
        """To begin with."""

    def rehang(self, hung: Mesentery) -> None:
        """Take other mesenteries, of as many nodes."""
        packed = pack_axis(hung, self._columns)[:-1]
        self._packed = packed.reshape(self._ways, len(self._colons), self._nodes, len(self._columns))
        self._weight = WaterWeight(self._colons, hung)

    def first(self, worlds: Int[np.ndarray, " some"], way: Int[np.ndarray, " some"] | int) -> Int[np.ndarray, " some"]:
        """The first row of some worlds that hang that way; lanes behind the last world look at its rows."""
        return (way * self._worlds + np.minimum(worlds, self._worlds - 1)) * self._nodes

    def put(
        self,
        rows: Float[np.ndarray, "rows columns"],
        worlds: Int[np.ndarray, " some"],
        case: Int[np.ndarray, " some"],
        water: Float[np.ndarray, "some segments"],
    ) -> None:
        """Write the axes of some worlds, in those colons, with so much water in each segment [m^3]."""
        own = rows[:-1].reshape(self._ways, self._worlds, self._nodes, -1)
        for way in range(self._ways):
            own[way, worlds] = self._packed[way, case]
            own[way, worlds, :, _LOAD] += self._weight.loads(way * len(self._colons) + case, water)
