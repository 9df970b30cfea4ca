"""Episodes of many worlds: who steps them, and works out what is seen, what is paid and what is over."""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.runs.measure.load import largest_load, largest_pain
from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import Wires, asked, within
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.coverage import Coverage, camera_in, cameras_at_rest
from haustra.envs.tasks.episode import EpisodeRules, concluded
from haustra.envs.tasks.moment import Dealt, Kept, Sensed, begun
from haustra.envs.tasks.senses import Senses, Wheels
from haustra.errors import UnsupportedSceneError
from haustra.models.wall import vectors
from haustra.models.wall.lumen_table import pick
from haustra.models.wall.moving_colon import back_to_reference


class Drawn(NamedTuple):
    """What episodes that begin were dealt: one number for each world that begins, in rising order."""

    worlds: Int[np.ndarray, " begun"]
    """Which worlds begin."""
    case: Int[np.ndarray, " begun"]
    """Colons of the bank."""
    conditions: Conditions
    """Friction, stiffness and roll."""
    gain: Float[np.ndarray, " begun"]
    """Pull that arrives over pull asked for [1]."""
    slack: Float[np.ndarray, " begun"]
    """Share of a wheel's travel that does nothing [1]."""
    bears: float
    """Largest wall force on one link that does not perforate [N]."""


class InPlace(NamedTuple):
    """Arrays of the program, single precision, worlds first: numpy's on a CPU; on a GPU what JAX, torch and CuPy take.

    They stay where they are: every control step writes into the same ones. Numbers of one kind lie side by side.
    """

    action: Any
    """(worlds, actions), to be written to."""
    observation: dict[str, Any]
    """Parts that programs make, each (worlds, entries); pictures are bytes (worlds, size, size, 4)."""
    reward: Any
    """(worlds, 1)."""
    terminated: Any
    """(worlds, 1): 1 or 0."""
    truncated: Any
    """(worlds, 1): 1 or 0."""
    told: dict[str, Any]
    """All that is told of episodes (`haustra.envs.tasks.episode.concluded`), each (worlds, 1)."""


class Episodes(ABC):
    """Episodes of many worlds on one backend. The caller says which worlds begin anew; nothing resets by itself."""

    backend: AbstractBackend
    """What steps the physics."""

    @property
    @abstractmethod
    def told(self) -> dict[str, np.ndarray]:
        """What is known of all worlds now: by the names of `haustra.envs.tasks.episode.concluded`, tip, push force."""

    @property
    @abstractmethod
    def parts(self) -> seen_by.Observation:
        """Observation, but for what cameras and rays see."""

    @property
    @abstractmethod
    def seen(self) -> Readings:
        """What can be read off now."""

    @abstractmethod
    def begin(self, drawn: Drawn) -> None:
        """Begin anew in some worlds."""

    @abstractmethod
    def step(self, action: Float[np.ndarray, "worlds actions"], drawn: Drawn | None = None) -> None:
        """Apply one action in each world but those of `drawn`, which begin anew instead, as in `begin`."""

    @property
    @abstractmethod
    def in_place(self) -> InPlace:
        """Actions, observations, rewards and endings where the backend's program has them.

        Raises:
            UnsupportedSceneError: when it has none.
        """

    @abstractmethod
    def advance(self, drawn: Drawn | None = None) -> Bool[np.ndarray, " worlds"]:
        """`step` under the actions that are in place; only which episodes are over then comes back.

        Raises:
            UnsupportedSceneError: as `in_place`.
        """

    @abstractmethod
    def grow_older(self, age: Int[np.ndarray, " worlds"]) -> None:
        """Let episodes have lasted for so many control steps."""


@final
class HostEpisodes(Episodes):
    """Episodes on any backend, worked out by numpy."""

    def __init__(
        self,
        rules: EpisodeRules,
        backend: AbstractBackend,
        bank: ColonSet,
        *,
        steps: int,
        coverage: Coverage | None,
        starts: tuple[Snapshot, ...] | None = None,
    ) -> None:
        """Prepare worlds; none has begun.

        Args:
            rules: of all episodes.
            backend: steps the worlds.
            bank: the colons.
            steps: time steps of a control step.
            coverage: looks for what has been seen of the wall, where that counts.
            starts: where scopes begin in each colon; at the start depth when None.
        """
        worlds, config = backend.worlds, rules.config
        self._rules, self.backend, self._bank, self._steps = rules, backend, bank, steps
        self._coverage, self._starts = coverage, starts
        self._kept = Kept(*np.zeros((len(Kept._fields), worlds)))
        self._dealt = Dealt(*np.ones((len(Dealt._fields), worlds)))
        self._case = np.zeros(worlds, int)
        self._share, self._unseen, self._seen = np.zeros(worlds), np.zeros((worlds, 4)), backend.read()
        self._senses, self._told = Senses(config, rules.interval, self._seen), {}
        self._conclude(np.ones(worlds, bool))

    @property
    def told(self) -> dict[str, np.ndarray]:
        """As `Episodes.told`."""
        return self._told

    @property
    def parts(self) -> seen_by.Observation:
        """As `Episodes.parts`."""
        return self._parts

    @property
    def seen(self) -> Readings:
        """What can be read off now."""
        return self._seen

    def begin(self, drawn: Drawn) -> None:
        """As `Episodes.begin`."""
        worlds, case, bank = drawn.worlds, drawn.case, self._bank
        self._case[worlds] = case
        lengths = bank.lengths[case], bank.valves[case]
        dealt = drawn.gain, drawn.slack, drawn.conditions.friction, *lengths, drawn.bears
        for array, values in zip(self._dealt, dealt, strict=True):
            array[worlds] = values
        self.backend.reset(worlds, case, drawn.conditions)
        if self._starts:
            for world in worlds:
                self.backend.restore(int(world), self._starts[self._case[world]])
        begins = np.isin(np.arange(len(self._case)), worlds)
        self._seen = self.backend.read()
        self._kept = begun(np, begins, self._kept, self._seen.tip_arc)
        self._senses.begin(worlds, self._seen, self._wheels)
        if self._coverage:
            for world in worlds:
                self._coverage.begin(int(world), int(self._case[world]))
            self._look(worlds)
        self._conclude(np.ones(len(begins), bool), worlds)

    def step(self, action: Float[np.ndarray, "worlds 4"], drawn: Drawn | None = None) -> None:
        """As `Episodes.step`."""
        rules = self._rules
        sound, within_limits = within(np, tuple(action.T))
        wires = Wires(self._dealt.gain, self._dealt.slack, self._bank.design.wires.pull_limit)
        hand = {"lead": self._seen.hand_lead, "outside": self._bank.scene.cable.length - self._seen.insertion}
        drive = rules.config.drive
        inputs = asked(np, drive, rules.interval, within_limits, sound, self._wheels, wires, **hand)
        pulls = np.stack(inputs.pulls, axis=1)
        healthy = self.backend.step(Controls(inputs.push_rate, inputs.roll_rate, pulls), self._steps)
        up, left = inputs.wheels
        self._kept = self._kept._replace(age=self._kept.age + 1, wheel_up=up, wheel_left=left)
        self._seen = self.backend.read()
        self._senses.acted(self._seen, np.column_stack(within_limits), self._wheels)
        if self._coverage:
            self._look(np.flatnonzero(self._kept.age % rules.look_every == 0))
        self._conclude(healthy)
        if drawn is not None:
            self.begin(drawn)

    @property
    def _wheels(self) -> Wheels:
        return self._kept.wheel_up, self._kept.wheel_left

    @property
    def in_place(self) -> InPlace:
        """As `Episodes.in_place`: there are none."""
        raise UnsupportedSceneError(
            "Observations and rewards are left in place by the program of 'linear' and 'linear-gpu' alone, where "
            "`on_host` is left out: use `step`."
        )

    def advance(self, drawn: Drawn | None = None) -> Bool[np.ndarray, " worlds"]:
        """As `Episodes.advance`: there is nothing in place."""
        return self.in_place.action

    def grow_older(self, age: Int[np.ndarray, " worlds"]) -> None:
        """As `Episodes.grow_older`."""
        self._kept = self._kept._replace(age=age.astype(float))

    def _conclude(self, healthy: np.ndarray, begun: np.ndarray | None = None) -> None:
        """Say what came of a control step, or in worlds that have just begun, of their beginning."""
        kept, told = concluded(np, self._rules, self._dealt, self._kept, self._sense(), healthy)
        told |= {"tip": self._seen.tip, "push_force": self._seen.push_force}
        if begun is not None:
            told |= {name: np.zeros_like(told[name]) for name in self._rules.paid}
            told = {name: _renewed(self._told[name], values, begun) for name, values in told.items()}
            kept = Kept(*(_renewed(old, new, begun) for old, new in zip(self._kept, kept, strict=True)))
        self._kept, self._told = kept, told
        own = {"privileged": self._privileged()} if self._rules.config.privileged else {}
        if "unseen" in seen_by.sizes(self._rules.config):
            own |= {"unseen": seen_by.arrayed([self._share, self._unseen])}
        self._parts: seen_by.Observation = self._senses.parts | own

    def _sense(self) -> Sensed:
        seen, bank = self._seen, self._bank
        about = {"tip_links": bank.scene.cable.tip_links, "diameter": bank.design.diameter, "lengths": self._lengths()}
        facing = self._facing() if self._rules.config.weights.facing else np.ones(len(self._case))
        force = seen.link_forces.max(axis=1)
        load = largest_load(np, seen, **about)
        pained = {"pain": self._pain(), "facing": facing, "coverage": self._share.copy()}
        return Sensed(seen.tip_arc, seen.insertion, force, *load, **pained)

    def _pain(self) -> np.ndarray:
        bank, own = self._bank, self._bank.tables.mesentery
        about: dict[str, Any] = {"diameter": bank.design.diameter, "lengths": self._lengths()}
        if own is None:
            return largest_pain(np, self._seen, **about)[0]
        about |= {"own": pick(bank.tables, self._case).mesentery, "radius": bank.node_widths[self._case]}
        moved = np.asarray(self.backend.displacement, float)  # readings of GPUs leave it there
        return largest_pain(np, self._seen._replace(displacement=moved), **about)[0]

    def _lengths(self) -> np.ndarray:
        return -np.diff(self._bank.scene.cable.node_distances)

    def _facing(self) -> np.ndarray:
        behind, ahead = map(vectors.of, self.backend.way_ahead(np.array(seen_by.BESIDE)).swapaxes(0, 1))
        return seen_by.facing(np, vectors.of(self._seen.tip_frame[:, :, 2]), behind, ahead)

    def _privileged(self) -> np.ndarray:
        placed, told = seen_by.Placed.of(self._seen), self._told
        places = self.backend.way_ahead(np.array(seen_by.AHEAD)).swapaxes(0, 1)
        ahead = [placed.in_frame(vectors.minus(vectors.of(place), placed.tip)) for place in places]
        return seen_by.arrayed(seen_by.privileged(told["progress"], told["wall_force"], self._dealt.friction, ahead))

    def _look(self, worlds: np.ndarray) -> None:
        assert self._coverage is not None, "coverage that nobody asked for"
        seen, back = self._seen, None
        if len(worlds) and seen.displacement is not None:
            back = back_to_reference(np, pick(self._bank.tables, self._case), seen.displacement)
        cameras = cameras_at_rest(seen_by.Placed.of(seen), seen.tip_arc, back)
        for world in worlds.tolist():
            own = camera_in(cameras, world)
            self._share[world], self._unseen[world] = self._coverage.look(world, int(self._case[world]), own)


def _renewed(old: np.ndarray, new: np.ndarray, worlds: np.ndarray) -> np.ndarray:
    """Values of before, but for some worlds."""
    found = old.copy()
    found[worlds] = new[worlds]
    return found
