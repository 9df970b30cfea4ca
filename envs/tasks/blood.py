"""Where the walls of episodes bleed: places that were sheared or sucked at too much, action by action.

Laws, thresholds and lengths are those of a single run and of a drive (`haustra.models.injury.bleeding`); what is
measured is where the worlds stand at the end of each action.
"""

from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.runs.measure.injury import at_stations
from haustra.envs.runs.treatment import beyond_wall
from haustra.envs.sim.gas import GasWorlds
from haustra.envs.sim.state import Readings
from haustra.envs.tasks.bank import ColonSet
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.instrument import channel_mouth, instrument_number
from haustra.models.injury.bleeding import PATCH, bleeds, bleeds_pulled, mucosal_shear, suction_pull
from haustra.models.injury.numbers import injury_number
from haustra.models.wall.lumen_table import pick
from haustra.models.wall.moving_colon import back_to_reference


class EpisodeBlood:
    """Keeps what bleeds in each world of a task."""

    def __init__(self, bank: ColonSet, worlds: int) -> None:
        """Nothing bleeds in so many worlds, each of one colon of the bank."""
        self._bank, self._lengths = bank, -np.diff(bank.scene.cable.node_distances)
        stations = int(np.ceil(bank.lengths.max() / PATCH)) + 1
        self._sheared, self._pulled = np.zeros((2, worlds, stations), bool)
        self._pull = np.zeros(worlds)

    def begin(self, worlds: Int[np.ndarray, " begun"]) -> None:
        """Nothing bleeds in worlds that begin anew."""
        self._sheared[worlds], self._pulled[worlds], self._pull[worlds] = False, False, 0.0

    def acted(
        self,
        seen: Readings,
        moved: Float[np.ndarray, "worlds nodes 7"] | None,
        *,
        case: Int[np.ndarray, " worlds"],
        friction: Float[np.ndarray, " worlds"],
        sucked: Float[np.ndarray, " worlds"],
        gas: GasWorlds | None,
        acts: Bool[np.ndarray, " worlds"],
    ) -> None:
        """Let places bleed, in worlds that have acted, that did not bleed before.

        Args:
            seen: where all worlds stand.
            moved: poses of the nodes of their colons' axes; None where these are fixed.
            case: their colons.
            friction: between scope and wall [1].
            sucked: share of the greatest suction that each scope sucks with [1].
            gas: what fills the colons; None where there is none to suck.
            acts: which worlds.
        """
        arcs = np.asarray(seen.link_arcs, float)
        forces = np.where(arcs > 0, np.asarray(seen.link_forces, float), 0.0)
        shear = mucosal_shear(forces, friction[:, None], self._bank.design.diameter, self._lengths)
        self._sheared |= acts[:, None] & np.asarray(bleeds(at_stations(shear, arcs, self._sheared.shape[1])), bool)
        self._pull = np.zeros(len(case))
        sucking = np.flatnonzero(acts & (sucked > 0))
        if gas is None or not len(sucking):
            return
        sealed, suction = self._sealed(seen, moved, case, sucking, gas), sucked[sucking] * injury_number("suction")
        self._pull[sucking] = suction_pull(np, suction, gas.tip_pressure[sucking], sealed)
        beside = np.clip(np.rint(np.asarray(seen.tip_arc, float) / PATCH), 0, self._pulled.shape[1] - 1).astype(int)
        torn = np.flatnonzero(bleeds_pulled(self._pull))
        self._pulled[torn, beside[torn]] = True

    def told(self) -> dict[str, np.ndarray]:
        """What `Step.info` says of it."""
        places = {"bleeding_places": self._sheared.sum(axis=1), "bleeding_pulled": self._pulled.sum(axis=1)}
        return places | {"suction_pull": self._pull.copy()}

    def _sealed(
        self, seen: Readings, moved: np.ndarray | None, case: np.ndarray, worlds: np.ndarray, gas: GasWorlds
    ) -> Bool[np.ndarray, " sucking"]:
        """Whether the wall lies over the channel of the scopes of some worlds, as the centreline sees it."""
        tips, frames = np.asarray(seen.tip, float)[worlds], np.asarray(seen.tip_frame, float)[worlds]
        arcs, reach = np.asarray(seen.tip_arc, float)[worlds], instrument_number("channel_width")
        places = np.array([channel_mouth(*each) + reach * each[1][:, 2] for each in zip(tips, frames, strict=True)])
        if moved is not None:
            back = back_to_reference(np, pick(self._bank.tables, case[worlds]), np.asarray(moved, float)[worlds])
            places = np.asarray(back(places[:, None], arcs[:, None]))[:, 0]
        widths, found = gas.widths(worlds), np.zeros(len(worlds), bool)
        for row, world in enumerate(worlds):
            colon = self._colons[case[world]]
            stations = colon.centreline.arc
            width = float(np.interp(arcs[row], stations, widths[row, : len(stations)]))
            found[row] = beyond_wall(colon, places[row], float(arcs[row]), width=width) > 0
        return found

    @cached_property
    def _colons(self) -> list[Colon]:
        return [case.colon() for case in self._bank.cases]
