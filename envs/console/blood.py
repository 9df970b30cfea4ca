"""Where the wall of a driven scope's colon bleeds: places that were sheared or sucked at too much, step by step."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.view.run_blood import REACH, nearest_to
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.instrument import instrument_number
from haustra.models.injury.bleeding import PATCH, bleeds, bleeds_pulled, wound_area
from haustra.models.wall.signed_distance import surface_arcs


class Bled(NamedTuple):
    """What has bled so far; arrays are replaced, never written into."""

    sheared: Bool[np.ndarray, " stations"]
    """Stations whose mucosa was sheared too much."""
    pulled: Bool[np.ndarray, " stations"]
    """Stations next to which suction pulled at the mucosa too much."""
    places: Float[np.ndarray, "places 4"]
    """Places of the wall at rest and how far blood lies around each [m], one behind the other; NaN of those to come."""


class Lying(NamedTuple):
    """Where scope and colon are."""

    path: Float[np.ndarray, "nodes 3"]
    """The scope's axis past the anus, or the one place of it that is asked about [m]."""
    displacement: Float[np.ndarray, "axis_nodes 7"] | None
    """Poses of the colon's axis in the coordinates of its tables; None where it is fixed."""


class WallBlood:
    """Keeps what bleeds of a colon."""

    def __init__(self, colon: Colon, moved: CurrentColon | None) -> None:
        """Nothing bleeds of a colon, which is fixed where `moved` is None."""
        self._colon, self._moved, self._stations = colon, moved, stations_of(colon)
        self._arcs: Float[np.ndarray, " vertices"] | None = None
        count = len(self._stations)
        self.bled = Bled(np.zeros(count, bool), np.zeros(count, bool), np.full((2 * count, 4), np.nan))

    @property
    def pulled_mm2(self) -> float:
        """Surface that bleeds since suction pulled at it, a mouth of the channel each [mm^2]."""
        return 1e6 * wound_area(instrument_number("channel_width")) * float(self.bled.pulled.sum())

    def shear(self, shear: Float[np.ndarray, " stations"], lies: Callable[[], Lying]) -> bool:
        """Let places bleed that are sheared too much and did not bleed before; says whether any has begun.

        Args:
            shear: of the mucosa at each station [Pa].
            lies: says where scope and colon are; asked only when something bleeds.
        """
        begun = np.asarray(bleeds(shear), bool) & ~self.bled.sheared
        if not begun.any():
            return False
        lying = lies()
        for station in np.flatnonzero(begun):
            self._add(float(self._stations[station]), lying, REACH)
        self.bled = self.bled._replace(sheared=self.bled.sheared | begun)
        return True

    def suck(self, pull: float, arc: float, lies: Callable[[], Lying]) -> bool:
        """Let the wall bleed if suction pulls at it too much and it did not before; says whether it has begun.

        Args:
            pull: of the suction on the mucosa over the channel's mouth [Pa].
            arc: arc length there [m].
            lies: says where the mouth and the colon are; asked only when it bleeds.
        """
        station = int(np.clip(np.rint(arc / PATCH), 0, len(self._stations) - 1))
        if not bleeds_pulled(pull) or self.bled.pulled[station]:
            return False
        self._add(arc, lies(), instrument_number("channel_width"))
        self.bled = self.bled._replace(pulled=self.bled.pulled | (np.arange(len(self._stations)) == station))
        return True

    def _add(self, arc: float, lying: Lying, reach: float) -> None:
        """Let the wall bleed where it is next to the scope, near an arc length [m]; gas's widening is left out."""
        if self._arcs is None:
            self._arcs = surface_arcs(self._colon)
        beside = np.flatnonzero(np.abs(self._arcs - arc) <= REACH)
        if not len(beside) or not len(lying.path):
            return
        wall = rest = self._colon.lumen.vertices[beside]
        if self._moved is not None and lying.displacement is not None:
            wall = self._moved.to_current_all(lying.displacement, rest, self._arcs[beside])
        places = self.bled.places.copy()
        places[int(np.isnan(places[:, 0]).argmax())] = *rest[nearest_to(lying.path, wall)], reach
        self.bled = self.bled._replace(places=places)
