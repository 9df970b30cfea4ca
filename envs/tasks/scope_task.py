"""Episodes of many worlds at once: actions in; observations, rewards and endings out. Gymnasium is a coat on this."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.runs.measure.load import largest_load
from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.capabilities import require_task_supported
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.jax_setup import share_memory
from haustra.envs.sim.load import backend_of, load_backend
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.bank import TASK_OPTIONS, ColonSet, grown_bank
from haustra.envs.tasks.calls import whole_steps
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.coverage import Coverage
from haustra.envs.tasks.depth import DepthCameras, depth_cameras
from haustra.envs.tasks.pictures import Pictures
from haustra.envs.tasks.rewards import Moment, reward
from haustra.envs.tasks.sight import Eyes, HostEyes, Sight
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.fields import Number
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import named_design
from haustra.models.injury.perforation import perforation_probability, worst_load

ACTIONS = ("push", "roll", "tip up", "tip left")
"""Each from -1 to 1."""
_LOOK_EVERY = 5
"""Control steps from one look for coverage to the next: 0.2 s, in which a tip moves by 12 mm at most."""
_BESIDE = np.array([-0.015, 0.015])
"""Places of the centreline, from the tip on, between which its direction is taken [m]: at its end one is before it."""
_SOME = Number("1", 1, 10**6, whole=True)
"""Worlds, and threads."""
_ANUS = 0.04
"""A withdrawn scope has reached the anus when its tip is less than this far in [m]."""


@dataclass(frozen=True)
class Step:
    """What one action led to; arrays over worlds."""

    observation: seen_by.Observation
    reward: Float[np.ndarray, " worlds"]
    terminated: Bool[np.ndarray, " worlds"]
    """The end of the way was reached, the wall was perforated, or the world diverged."""
    truncated: Bool[np.ndarray, " worlds"]
    """Time is up."""
    info: dict[str, np.ndarray]
    """Ground truth that no device knows, terms of the reward, and why an episode ended. `p_perforation` is the share
    of people whose colon the episode has torn so far (`haustra.models.injury`), `perforation_arc` where [m]."""


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
    ) -> None:
        """Get the bank, growing what is not in the cache, and compile.

        Args:
            config: the rules.
            worlds: how many.
            threads: for physics on the CPU.
            backend: 'native', MuJoCo on threads; 'linear', linear time on them, or 'linear-gpu'; 'warp', MuJoCo Warp.
            bank: colons; those of the configuration's seeds when None.
            progress: told how many colons are there.

        Raises:
            InvalidOptionError: when worlds, threads or a rule of the episode do not fit the colons and the time step.
            UnsupportedSceneError: when the colons are to move and the backend or what is seen of them cannot.
        """
        self.parts = seen_by.sizes(config)
        for name, value in (("worlds", worlds), ("threads", threads)):
            if said := _SOME.wrong(value):
                raise InvalidOptionError(f"{name}{said}.")
        self.config, self.worlds = config, worlds
        design = named_design(config.design)
        timestep = (bank.options if bank else TASK_OPTIONS).timestep
        require_task(config, backend, design=bank.design if bank else design)
        self.steps = whole_steps(config.drive.control_interval, timestep)
        bank = bank or grown_bank(range(*config.seeds), design, difficulty=config.difficulty, progress=progress)
        self.bank = bank.with_mesentery(config.mesentery)
        self._require_way()
        self.backend = load_backend(backend, self.bank.scene, self.bank.tables, worlds=worlds, threads=threads)
        self.sight = Sight(self.bank.cases)
        self._eyes = _eyes(self.backend, self.sight)
        self.pictures = Pictures(self.bank, self.sight, design.tip.field_of_view_deg)
        self._depths: DepthCameras | None = None
        if "depth" in self.parts:
            size = config.picture_size
            lens = {"field_of_view_deg": self.pictures.view, "size": size}
            self._depths = depth_cameras(self.backend, self.bank, self.sight, self._eyes, **lens)
        self.interval = self.steps * timestep
        self._covers = config.task == "withdrawal" or config.weights.coverage != 0
        self._coverage = Coverage(
            self.bank, self.sight, worlds, field_of_view_deg=self.bank.design.tip.field_of_view_deg
        )
        self._starts: tuple[Snapshot, ...] | None = None
        self._random = [np.random.default_rng() for _ in range(worlds)]
        self.case = np.zeros(worlds, int)
        self._gain, self._slack, self.friction = np.ones(worlds), np.zeros(worlds), np.zeros(worlds)
        self._wheels, self._action = np.zeros((worlds, 2)), np.zeros((worlds, len(ACTIONS)))
        self._best, self._from = np.zeros(worlds), np.zeros(worlds)
        self._in_caecum = np.zeros(worlds, bool)
        self._load, self._load_arc = np.zeros(worlds), np.zeros(worlds)
        self._memory = seen_by.Memory(config.memory, worlds, seen_by.measured_size(config), self.interval)
        self._tip_velocity = np.zeros((worlds, 3))
        self._share, self._speed, self._age = np.zeros(worlds), np.zeros(worlds), np.zeros(worlds, int)
        self.seen: Readings = self.backend.read()
        self._measured = self._measure()
        self._moment = self._now(np.ones(worlds, bool))

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
        drawn = []
        for row, world in enumerate(worlds):
            if seeds is not None:
                self._random[world] = np.random.default_rng(seeds[row])
            drawn.append(self._draw(self._random[world]))
        table = np.array(drawn)
        chosen = table[:, 0].astype(int) if case is None else np.full(len(worlds), case, int)
        self.case[worlds] = chosen
        self.friction[worlds], self._gain[worlds], self._slack[worlds] = table[:, 1], table[:, 4], table[:, 5]
        self.backend.reset(worlds, chosen, Conditions(table[:, 1], table[:, 2], table[:, 3], table[:, 6]))
        if self.config.task == "withdrawal":
            self._starts = self._starts or self._inserted()
            for world in worlds:
                self.backend.restore(int(world), self._starts[self.case[world]])
        begun = self._wheels, self._action, self._share, self._speed, self._tip_velocity, self._age
        for array in (*begun, self._load, self._load_arc):
            array[worlds] = 0
        self.seen = self.backend.read()
        self._measured = self._measure()
        self._from[worlds] = self.seen.tip_arc[worlds]
        self._best[worlds], self._in_caecum[worlds] = 0.0, False
        if self._covers:
            for world in worlds:
                self._coverage.begin(int(world), int(self.case[world]))
                self._look(int(world))
        self._moment = self._now(np.ones(self.worlds, bool))
        if self.config.memory:
            self._memory.begin(worlds, self._remembered())
        return self.observe()

    def stagger(self, seed: int) -> None:
        """Let the running episodes end as if each had begun at some time of its own within the longest episode."""
        longest = round(self.config.limits.seconds / self.interval)
        self._age = np.random.default_rng(seed).integers(0, longest, self.worlds)

    def step(self, action: Float[np.ndarray, "worlds 4"]) -> Step:
        """Apply one action in each world. Worlds whose episode is over go on regardless until they are reset.

        A world whose action is not finite is lost, as if it had diverged: no policy means that.
        """
        action = np.asarray(action, float)
        before, insertion, tip = self._moment, self.seen.insertion, self.seen.tip
        sound = np.all(np.isfinite(action), axis=1)
        action = np.clip(np.where(sound[:, None], action, 0.0), -1.0, 1.0)
        inputs = self._inputs(action)
        inputs.push_rate[~sound] = np.nan
        healthy = self.backend.step(inputs, self.steps)
        self._action, self._age = action, self._age + 1
        self.seen = self.backend.read()
        self._speed = (self.seen.insertion - insertion) / self.interval
        self._tip_velocity = (self.seen.tip - tip) / self.interval
        self._measured = self._measure()
        if self._covers:
            for world in np.flatnonzero(self._age % _LOOK_EVERY == 0):
                self._look(int(world))
        if self.config.memory:
            self._memory.add(self._remembered())
        after = self._moment = self._now(healthy)
        terms = reward(before, after, self.config.weights, self.config.limits)
        ended = after.reached | after.perforated | ~healthy
        late = ~ended & (self._age * self.interval >= self.config.limits.seconds - 1e-9)
        return Step(
            observation=self.observe(),
            reward=np.where(healthy, sum(terms.values(), np.zeros(self.worlds)), 0.0),
            terminated=ended,
            truncated=late,
            info=self._info(after, healthy, late, terms),
        )

    def info(self) -> dict[str, np.ndarray]:
        """What `Step.info` says of where all worlds are now, before any action."""
        none = np.zeros(self.worlds, bool)
        terms = {name: np.zeros(self.worlds) for name, weight in vars(self.config.weights).items() if weight != 0}
        return self._info(self._moment, ~none, none, terms)

    def observe(self) -> seen_by.Observation:
        """What all worlds see."""
        made = {
            "recent": lambda: self._memory.recent(self._remembered()),
            "lumen": self._lumen,
            "privileged": self._privileged,
            "depth": self._depth,
            "pixels": self._pixels,
        }
        return {name: self._measured[name] if name in self._measured else made[name]() for name in self.parts}

    def way_ahead(self, distances: Float[np.ndarray, " places"]) -> Float[np.ndarray, "worlds places 3"]:
        """Places of the centreline that far ahead of the tip, from the entry [m]. No device knows them."""
        return self.backend.way_ahead(distances)

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed in space."""
        found = self.backend.displacement
        return None if found is None else np.asarray(found)

    def render_depth(self, world: int, size: int) -> Float[np.ndarray, "size size"]:
        """Depth along the camera's rays [m]."""
        seen, one = self.seen, slice(world, world + 1)
        return self.pictures.depth(self.case[one], seen.tip[one], seen.tip_frame[one], seen.tip_arc[one], size)[0]

    def render(self, world: int, size: int) -> np.ndarray:
        """What the camera shows, RGB."""
        return self.pictures.colour(int(self.case[world]), self._eye(world), size)

    def close(self) -> None:
        """End the threads."""
        self.backend.close()

    def _require_way(self) -> None:
        """Refuse an end of the way that lies before its beginning."""
        margin, start = self.config.limits.caecum_margin, self.bank.options.start_depth
        shortest = float(self.bank.lengths.min())
        if shortest - margin <= start:
            raise InvalidOptionError(
                f"limits.caecum_margin is {margin} m; give less than {shortest - start:.3f} m: the shortest colon is "
                f"{shortest:.3f} m long, and the scope begins {start:g} m inside."
            )

    def _draw(self, random: np.random.Generator) -> list[float]:
        ranges = self.config.randomisation
        case = float(random.integers(len(self.bank.cases)))
        names = ("friction", "wall_stiffness", "shaft_stiffness", "wire_gain", "wire_slack", "start_roll")
        return [case, *(float(random.uniform(*getattr(ranges, name))) for name in names)]

    def _inputs(self, action: np.ndarray) -> Controls:
        drive, lead = self.config.drive, self.seen.hand_lead
        most = drive.wheel_rate * self.interval
        self._wheels = self._wheels + np.clip(action[:, 2:] - self._wheels, -most, most)
        slack = self._slack[:, None]
        pull = np.sign(self._wheels) * np.maximum(np.abs(self._wheels) - slack, 0.0) / (1 - slack)
        pull = pull * self._gain[:, None] * self.bank.design.wires.pull_limit
        outside = self.bank.scene.cable.length - self.seen.insertion
        push = np.clip(
            action[:, 0] * drive.push_rate,
            (-drive.hand_lead - lead) / self.interval,
            np.minimum(drive.hand_lead - lead, outside) / self.interval,
        )
        pulls = np.concatenate([np.maximum(pull, 0.0), np.maximum(-pull, 0.0)], axis=1)
        return Controls(push, action[:, 1] * drive.roll_rate, pulls)

    def _now(self, healthy: np.ndarray) -> Moment:
        arc, length = self.seen.tip_arc, self.bank.lengths[self.case]
        if self.config.task == "insertion":
            way = length - self.config.limits.caecum_margin - self._from
            share, reached = (arc - self._from) / way, arc >= length - self.config.limits.caecum_margin
        else:
            share = (self._from - arc) / np.maximum(self._from - _ANUS, 1e-6)
            reached = arc <= _ANUS
        self._best = np.where(healthy, np.maximum(self._best, np.clip(share, 0.0, 1.0)), self._best)
        self._in_caecum |= healthy & (arc >= self.bank.valves[self.case])
        force = self.seen.link_forces.max(axis=1)
        self._bear(healthy)
        return Moment(
            progress=self._best.copy(),
            place=np.where(healthy, share, self._best),
            facing=self._facing() if self.config.weights.facing else np.ones(self.worlds),
            wall_force=force,
            excess=self.seen.insertion - arc,
            coverage=self._share.copy(),
            reached=reached & healthy,
            perforated=(force > self.config.limits.perforation_force) & healthy,
        )

    def _bear(self, healthy: np.ndarray) -> None:
        """Keep the largest load of the wall over its strength, and where it was."""
        about = {"tip_links": self.bank.scene.cable.tip_links, "diameter": self.bank.design.diameter}
        now, worst = largest_load(np, self.seen, **about), (self._load, self._load_arc)
        for kept, found in zip(worst, worst_load(np, worst, *now, escaped=np.zeros(self.worlds, bool)), strict=True):
            kept[healthy] = found[healthy]

    def _info(self, after: Moment, healthy: np.ndarray, late: np.ndarray, terms: dict) -> dict[str, np.ndarray]:
        return {
            "time": self._age * self.interval,
            "case": self.case.copy(),
            "friction": self.friction.copy(),
            "tip": self.seen.tip,
            "tip_arc": self.seen.tip_arc,
            "progress": after.progress,
            "wall_force": after.wall_force,
            "push_force": self.seen.push_force,
            "excess": after.excess,
            "coverage": after.coverage,
            "reached": after.reached,
            "in_caecum": self._in_caecum.copy(),
            "perforated": after.perforated,
            "p_perforation": perforation_probability(self._load),
            "perforation_arc": self._load_arc.copy(),
            "diverged": ~healthy,
            "time_up": late,
            **{f"reward_{name}": value for name, value in terms.items()},
        }

    def _facing(self) -> np.ndarray:
        """Cosine between the viewing direction and the centreline beside the tip; 0 outside the patient."""
        before, after = self.way_ahead(_BESIDE).swapaxes(0, 1)
        along = after - before
        length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
        return np.einsum("wi,wi->w", self.seen.tip_frame[:, :, 2], along) / length

    def _measure(self) -> seen_by.Observation:
        """What the device itself measures now."""
        state = seen_by.state(self.seen, self._wheels, self._action, self._speed)
        return {"state": state} | (
            {"imager": seen_by.imager(self.seen, self._tip_velocity)} if self.config.imager else {}
        )

    def _remembered(self) -> np.ndarray:
        return np.concatenate(list(self._measured.values()), axis=1)

    def _lumen(self) -> np.ndarray:
        seen = self.seen
        return seen_by.lumen(self._eyes.tip_distances(self.case, seen.tip, seen.tip_frame, seen.tip_arc))

    def _privileged(self) -> np.ndarray:
        ahead = self.way_ahead(np.array(seen_by.AHEAD)) - self.seen.tip[:, None]
        ahead = np.einsum("wij,wpi->wpj", self.seen.tip_frame, ahead)
        return seen_by.privileged(self._best, self._moment.wall_force, self.friction, ahead)

    def _depth(self) -> np.ndarray:
        assert self._depths is not None, "depth pictures that nobody asked for"
        return self._depths(self.case, self.seen.tip, self.seen.tip_frame, self.seen.tip_arc)[..., None]

    def _pixels(self) -> np.ndarray:
        size = self.config.picture_size
        return np.stack(
            [
                self.pictures.both(int(self.case[world]), self._eye(world), float(self.seen.tip_arc[world]), size)
                for world in range(self.worlds)
            ]
        )

    def _eye(self, world: int) -> tuple[np.ndarray, np.ndarray]:
        return self.seen.tip[world], self.seen.tip_frame[world]

    def _look(self, world: int) -> None:
        eye, frame = self._eye(world)
        arc = float(self.seen.tip_arc[world])
        self._share[world] = self._coverage.look(world, int(self.case[world]), eye, frame[:, 2], arc)

    def _inserted(self) -> tuple[Snapshot, ...]:
        from haustra.envs.tasks.inserted import inserted_starts

        return inserted_starts(replace(self.config, task="insertion", observation="state"), self.bank)


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
    if config.mesentery and (config.task == "withdrawal" or "pixels" in seen_by.sizes(config)):
        raise UnsupportedSceneError(
            "Colons that move on their mesentery are not drawn in colour, nor withdrawn from: leave mesentery out."
        )
    require_task_supported(config, design or named_design(config.design), backend_of(backend).name)


def _eyes(backend: AbstractBackend, sight: Sight) -> Eyes:
    """Rays are followed on a GPU where the physics is there and JAX is installed; else by numpy."""
    if not backend.on_device or find_spec("jax") is None:
        return HostEyes(sight, backend)
    share_memory()
    from haustra.envs.tasks.device_sight import DeviceEyes

    return DeviceEyes(sight, backend)
