"""Episodes of many worlds at once: actions in; observations, rewards and endings out. Gymnasium is a coat on this."""

from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.capabilities import require_task_supported
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.jax_setup import share_memory
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.load import backend_of
from haustra.envs.sim.state import Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.bank import TASK_OPTIONS, ColonSet, grown_bank
from haustra.envs.tasks.blood import EpisodeBlood
from haustra.envs.tasks.calls import whole_steps
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.depth import DepthCameras, depth_cameras
from haustra.envs.tasks.episode import EpisodeRules
from haustra.envs.tasks.episodes import Drawn, InPlace
from haustra.envs.tasks.inserted import inserted_starts
from haustra.envs.tasks.load_episodes import load_episodes
from haustra.envs.tasks.pictures import Pictures
from haustra.envs.tasks.sight import Eyes, HostEyes, Sight
from haustra.envs.tasks.step import Step
from haustra.envs.tasks.tip_pictures import TipPictures
from haustra.envs.view.picture.appearance import Residue
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.fields import Number
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import named_design
from haustra.models.injury.perforation import perforation_probability

_TOLD = ("tip", "tip_arc", "progress", "wall_force", "push_force", "excess", "coverage", "reached", "perforated",
         "diverged")  # fmt: skip
"""What `Step.info` says by the names that it is told by."""
_SOME = Number("1", 1, 10**6, whole=True)
"""Worlds, and threads."""


class ScopeTask:
    """Worlds of one task. The caller says which worlds begin anew; nothing resets by itself."""

    def __init__(
        self,
        config: TaskConfig,
        *,
        worlds: int = 1,
        threads: int = 1,
        backend: str = "native",
        bank: ColonSet | None = None,
        progress: Callable[[int], None] = lambda done: None,
        on_host: bool = False,
    ) -> None:
        """Get the bank, growing what is not in the cache, and compile.

        Args:
            config: the rules.
            worlds: how many.
            threads: for physics on the CPU.
            backend: 'native', MuJoCo on threads; 'linear', linear time on them, or 'linear-gpu'; 'warp', MuJoCo Warp.
            bank: colons; those of the configuration's seeds when None.
            progress: told how many colons are there.
            on_host: work observations, rewards and endings out by numpy also where the backend's own program can, and
                draw pictures world by world, by exact rays.

        Raises:
            InvalidOptionError: when worlds, threads or a rule of the episode do not fit the colons and the time step.
            UnsupportedSceneError: when the colons are to move and the backend or what is seen of them cannot.
        """
        self.parts = seen_by.sizes(config)
        for name, value in (("worlds", worlds), ("threads", threads)):
            if said := _SOME.wrong(value):
                raise InvalidOptionError(f"{name}{said}.")
        self.config, self.worlds = config, worlds
        self.bears = config.limits.perforation_force
        """Perforation limit of the episodes that begin from now on [N]."""
        design = named_design(config.design)
        timestep = (bank.options if bank else TASK_OPTIONS).timestep
        require_task(config, backend, design=bank.design if bank else design)
        if config.gas is not None and on_host:
            raise UnsupportedSceneError("Under gas only the backend's own program sees the lumen: leave out `on_host`.")
        self.steps = whole_steps(config.drive.control_interval, timestep)
        self.interval = self.steps * timestep
        bank = bank or grown_bank(range(*config.seeds), design, difficulty=config.difficulty, progress=progress)
        filled = {"flow": config.gas_flow, "start": config.gas_start, "water": config.water}
        self.bank = bank.with_mesentery(config.mesentery).with_gas(config.gas, **filled)
        self._require_way()
        self.rules, self.sight = EpisodeRules(config, self.interval), Sight(self.bank.cases)
        about: dict[str, Any] = {"worlds": worlds, "threads": threads, "steps": self.steps, "on_host": on_host}
        if config.task == "withdrawal":
            about["starts"] = inserted_starts(config, self.bank, backend, threads=threads)
        self._episodes = load_episodes(self.rules, self.bank, self.sight, backend, **about)
        self.backend = self._episodes.backend
        residue = Residue(config.stool, config.mucus)
        self.pictures = Pictures(self.bank, self.sight, design.tip.field_of_view_deg, residue=residue)
        self._depths: DepthCameras | None = None
        if "depth" in self.parts:
            size = config.picture_size
            lens = {"field_of_view_deg": self.pictures.view, "size": size}
            self._depths = depth_cameras(self.backend, self.bank, self.sight, self._eyes, **lens)
        self._tips: TipPictures | None = None
        if "pixels" in self.parts and isinstance(self.backend, LinearBackend) and not on_host:
            self._tips = TipPictures(self.bank, self.backend, config.picture_size, threads=threads, residue=residue)
        self._blood = EpisodeBlood(self.bank, worlds) if config.bleeding else None
        self._random = [np.random.default_rng() for _ in range(worlds)]
        self.case, self.friction = np.zeros(worlds, int), np.zeros(worlds)

    @property
    def seen(self) -> Readings:
        """What can be read off all worlds now."""
        return self._episodes.seen

    def reset(
        self,
        worlds: Int[np.ndarray, " reset"] | None = None,
        seeds: list[int] | None = None,
        case: int | Int[np.ndarray, " reset"] | None = None,
    ) -> seen_by.Observation:
        """Begin anew in some worlds, or all.

        Args:
            worlds: which, in rising order.
            seeds: of their random draws from now on; the streams that they have go on when None.
            case: which colon of the bank, for all or for each; drawn when None.

        Returns:
            What all worlds see now.
        """
        worlds = np.arange(self.worlds) if worlds is None else worlds
        self._episodes.begin(self._dealt(worlds, seeds, case))
        if self._blood is not None:
            self._blood.begin(worlds)
        return self.observe()

    def stagger(self, seed: int) -> None:
        """Let the running episodes end as if each had begun at some time of its own within the longest episode."""
        longest = round(self.config.limits.seconds / self.interval)
        self._episodes.grow_older(np.random.default_rng(seed).integers(0, longest, self.worlds))

    def step(
        self, action: Float[np.ndarray, "worlds actions"], begins: Bool[np.ndarray, " worlds"] | None = None
    ) -> Step:
        """Apply one action in each world. Worlds whose episode is over go on regardless until they are reset.

        A world whose action is not finite is lost, as if it had diverged: no policy means that.

        Args:
            action: of each world, by `haustra.envs.tasks.actions.actions_of` the task.
            begins: worlds that begin anew instead of acting: nothing is paid there, and nothing ends.
        """
        self._episodes.step(np.asarray(action, float), self._beginning(begins))
        self._bleed(np.asarray(action, float), np.zeros(self.worlds, bool) if begins is None else np.asarray(begins))
        told = self._episodes.told
        return Step(
            observation=self.observe(),
            reward=told["reward"],
            terminated=told["terminated"],
            truncated=told["truncated"],
            info=self._info(told),
        )

    def _bleed(self, action: np.ndarray, begins: np.ndarray) -> None:
        """Let walls bleed where these actions have led to, but in worlds that have begun anew instead."""
        if self._blood is None:
            return
        self._blood.begin(np.flatnonzero(begins))
        asked = action[:, 4] if self.config.gas_action else np.zeros(self.worlds)
        sucked = -np.clip(np.nan_to_num(asked), -1.0, 0.0)
        about = {"case": self.case, "friction": self.friction, "gas": self.backend.gas, "acts": ~begins}
        self._blood.acted(self.seen, self.displacement, sucked=sucked, **about)

    @property
    def in_place(self) -> InPlace:
        """Actions, observations, rewards and endings where the program of the backends in linear time has them.

        On a GPU, torch, JAX and CuPy take them as they are; `advance` steps by the actions that are written there. What
        libraries do in CUDA's default stream is waited for.

        Raises:
            UnsupportedSceneError: when the backend has no such program, coverage counts, or bleeding does.
        """
        self._require_no_account()
        place = self._episodes.in_place
        if self._tips is None:
            return place
        return place._replace(observation=place.observation | {"pixels": self._tips.in_place})

    def advance(self, begins: Bool[np.ndarray, " worlds"] | None = None) -> Bool[np.ndarray, " worlds"]:
        """`step` under the actions that are `in_place`, leaving there what it leads to; which episodes are over then.

        Args:
            begins: as of `step`.

        Raises:
            UnsupportedSceneError: as `in_place`.
        """
        self._require_no_account()
        over = self._episodes.advance(self._beginning(begins))
        self.draw()
        return over

    def draw(self) -> None:
        """Draw the pictures that are `in_place`, as the worlds are now; `advance` does so. Nothing, where none are."""
        if self._tips is not None:
            self._tips.draw()

    def info(self) -> dict[str, np.ndarray]:
        """What `Step.info` says of where all worlds are now, before any action."""
        told = self._episodes.told
        return self._info(told | {name: np.zeros_like(told[name]) for name in self.rules.paid})

    def observe(self) -> seen_by.Observation:
        """What all worlds see."""
        made = {
            "lumen": self._lumen,
            "depth": self._depth,
            "pixels": self._pixels,
        }
        parts = self._episodes.parts
        return {name: parts[name] if name in parts else made[name]() for name in self.parts}

    def way_ahead(self, distances: Float[np.ndarray, " places"]) -> Float[np.ndarray, "worlds places 3"]:
        """Places of the centreline that far ahead of the tip, from the entry [m]. No device knows them."""
        return self.backend.way_ahead(distances)

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed in space."""
        found = self.backend.displacement
        return None if found is None else np.asarray(found)

    def render_depth(self, world: int, size: int) -> Float[np.ndarray, "size size"]:
        """Depth along the camera's rays [m].

        Raises:
            UnsupportedSceneError: under gas.
        """
        self._require_as_given()
        seen, one = self.seen, slice(world, world + 1)
        return self.pictures.depth(self.case[one], seen.tip[one], seen.tip_frame[one], seen.tip_arc[one], size)[0]

    def render(self, world: int, size: int) -> np.ndarray:
        """What the camera shows, RGB.

        Raises:
            UnsupportedSceneError: under gas.
        """
        self._require_as_given()
        return self.pictures.colour(*self._before(world), size, self._displaced(world))

    def close(self) -> None:
        """End the threads."""
        self.backend.close()

    def _require_as_given(self) -> None:
        """Refuse to show colons that gas holds open otherwise."""
        if self.config.gas is not None:
            raise UnsupportedSceneError(
                "Pictures show colons as they were given, not as gas holds them: leave gas out."
            )

    def _require_no_account(self) -> None:
        if self._blood is not None:
            raise UnsupportedSceneError("Bleeding is told by `step` alone, not in place: leave task.bleeding out.")

    def _require_way(self) -> None:
        """Refuse an end of the way that lies before its beginning."""
        margin, start = self.config.limits.caecum_margin, self.bank.options.start_depth
        shortest = float(self.bank.lengths.min())
        if shortest - margin <= start:
            raise InvalidOptionError(
                f"limits.caecum_margin is {margin} m; give less than {shortest - start:.3f} m: the shortest colon is "
                f"{shortest:.3f} m long, and the scope begins {start:g} m inside."
            )

    def _beginning(self, begins: np.ndarray | None) -> Drawn | None:
        return None if begins is None or not begins.any() else self._dealt(np.flatnonzero(begins))

    def _dealt(self, worlds: np.ndarray, seeds: list[int] | None = None, case: int | np.ndarray | None = None) -> Drawn:
        """What the next episodes of some worlds are dealt."""
        rows = []
        for row, world in enumerate(worlds):
            if seeds is not None:
                self._random[world] = np.random.default_rng(seeds[row])
            rows.append(self._draw(self._random[world]))
        table = np.array(rows).reshape(len(worlds), -1)
        self.case[worlds] = table[:, 0].astype(int) if case is None else case
        self.friction[worlds] = table[:, 1]
        conditions = Conditions(table[:, 1], table[:, 2], table[:, 3], table[:, 6])
        dealt = {"gain": table[:, 4], "slack": table[:, 5], "bears": self.bears}
        return Drawn(worlds, self.case[worlds], conditions, **dealt)

    def _draw(self, random: np.random.Generator) -> list[float]:
        ranges = self.config.randomisation
        case = float(random.integers(len(self.bank.cases)))
        names = ("friction", "wall_stiffness", "shaft_stiffness", "wire_gain", "wire_slack", "start_roll")
        return [case, *(float(random.uniform(*getattr(ranges, name))) for name in names)]

    def _info(self, told: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {
            "time": told["age"] * self.interval,
            "case": self.case.copy(),
            "friction": self.friction.copy(),
            **{name: told[name] for name in _TOLD},
            "in_caecum": told["in_caecum"] > 0,
            "p_perforation": perforation_probability(told["load"]),
            "perforation_arc": told["load_arc"],
            "pain": told["pain"],
            "time_up": told["truncated"],
            **{name: told[name] for name in self.rules.terms},
            **self._gas(),
            **({} if self._blood is None else self._blood.told()),
        }

    def _gas(self) -> dict[str, np.ndarray]:
        """Highest pressure of the episode [Pa], and volume now of gas and water [m^3], where there is either."""
        gas = self.backend.gas
        if gas is None:
            return {}
        told = {"gas_pressure_peak": gas.pressure_peak.copy(), "gas_volume": gas.volume}
        return told | ({"water_volume": gas.water.sum(axis=1)} if self.config.water else {})

    @cached_property
    def _eyes(self) -> Eyes:
        """Rays are followed on a GPU where the physics is there and JAX is installed; else by numpy."""
        if not self.backend.on_device or find_spec("jax") is None:
            return HostEyes(self.sight, self.backend)
        share_memory()
        from haustra.envs.tasks.device_sight import DeviceEyes

        return DeviceEyes(self.sight, self.backend)

    def _lumen(self) -> np.ndarray:
        seen = self.seen
        return seen_by.lumen(self._eyes.tip_distances(self.case, seen.tip, seen.tip_frame, seen.tip_arc))

    def _depth(self) -> np.ndarray:
        assert self._depths is not None, "depth pictures that nobody asked for"
        return self._depths(self.case, self.seen.tip, self.seen.tip_frame, self.seen.tip_arc)[..., None]

    def _pixels(self) -> np.ndarray:
        if self._tips is not None:
            return self._tips.both()
        size = self.config.picture_size
        return np.stack(
            [self.pictures.both(*self._before(world), size, self._displaced(world)) for world in range(self.worlds)]
        )

    def _before(self, world: int) -> tuple[int, tuple[np.ndarray, np.ndarray], float]:
        """Case, eye and arc length of a world's camera."""
        seen = self.seen
        return int(self.case[world]), (seen.tip[world], seen.tip_frame[world]), float(seen.tip_arc[world])

    def _displaced(self, world: int) -> np.ndarray | None:
        moved = self.displacement
        return None if moved is None else moved[world]


def require_task(config: TaskConfig, backend: str, *, design: ScopeDesign | None = None) -> None:
    """Refuse what can be known to be impossible before any colon is grown.

    Args:
        config: the rules.
        backend: as for `ScopeTask`.
        design: the scope; that of the configuration when None.

    Raises:
        InvalidOptionError: when the backend is not known, or what is seen does not fit together.
        MissingDependencyError: when what the backend computes with is not installed.
        UnsupportedSceneError: when the colons are to move and the backend or what is seen of them cannot.
    """
    if config.mesentery and config.task == "withdrawal" and not backend.startswith("linear"):
        raise UnsupportedSceneError(
            "From colons that move on their mesentery only 'linear' and 'linear-gpu' withdraw: choose one."
        )
    if config.gas is not None and (backend == "linear-gpu" or {"depth", "pixels"} & {*seen_by.sizes(config)}):
        raise UnsupportedSceneError(
            "Gas holds colons open on 'linear' only, and pictures and depth show them as they were given: leave gas "
            "out, or choose that backend and observation 'state', 'lumen', or 'dict' without pictures."
        )
    if config.bleeding and "pixels" in seen_by.sizes(config):
        raise UnsupportedSceneError(
            "Pictures that a learner sees show no blood: leave task.bleeding out, or pictures in colour."
        )
    if (config.stool or config.mucus) and "pixels" not in seen_by.sizes(config):
        raise InvalidOptionError(
            "Stool and mucus are seen in pictures in colour only: leave them out, or choose observation 'pixels'."
        )
    require_task_supported(config, design or named_design(config.design), backend_of(backend).name)
