"""An episode of the insertion task, driven live: what it sees and is paid goes along, so that policies can learn."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.console.blood import Lying, WallBlood
from haustra.envs.console.scope_vehicle import LENS_SIZE
from haustra.envs.console.vehicle import Lever, Look, Repeating, Surroundings, digest
from haustra.envs.control.laws import DRIVERS
from haustra.envs.runs.measure.injury import at_stations, stations_of
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.sim.native_batch import batch_model
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import ACTIONS
from haustra.envs.tasks.bank import ColonSet, folder_bank
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.step import Step
from haustra.envs.view.picture.lens import lens_of
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.injury.bleeding import mucosal_shear

_NAMES = ("push", "roll", "up", "left")
_KNOBS = ("up", "left")
_TOLD = ("progress", "wall_force", "push_force", "excess", "tip_arc")


class EpisodeVehicle(Repeating):
    """One world of `haustra.envs.tasks.scope_task.ScopeTask` on the backend 'linear', in one colon."""

    kind = "episode"
    backend = "linear"
    conditions = ()

    def __init__(self, folder: Path, config: TaskConfig, *, seed: int, policy: str = "follower") -> None:
        """Begin the episode of that seed in the colon of a folder.

        Args:
            folder: of the colon.
            config: rules of the episode.
            seed: of what the episode draws: friction, stiffness, how the wires are.
            policy: who assists: a policy's folder or name, or a driver of `haustra.envs.control.laws.DRIVERS`.

        Raises:
            UnreadableFileError: when the policy cannot be read.
        """
        design = named_design(config.design)
        bank = folder_bank([folder], design)
        self.config, self.seed, self._policy = config, seed, policy
        self.task = ScopeTask(config, bank=bank, backend="linear", on_host=True)
        self.given, self.around = load_colon(folder), episode_surroundings(self.task.bank)
        self.interval = self.task.interval
        self.levers = tuple(
            Lever(name, "1", -1.0, 1.0, knob=name in _KNOBS, about=about)
            for name, about in zip(_NAMES, ACTIONS, strict=True)
        )
        import mujoco

        scene = self.task.bank.scene
        self._model = batch_model(scene)
        self._data = mujoco.MjData(self._model)
        self._links = [self._model.body(name).id for name in scene.cable.links]
        self._tip = self._model.site("scope/tip").id
        self._stations, self._cable = stations_of(self.around.colon), scene.cable
        around = self.around
        self._moved: CurrentColon | None = None
        if around.tables is not None:
            self._moved = CurrentColon(around.colon, around.tables, around.origin, around.axes)
        self._driver = self._make_driver(policy)
        self._done = []
        self.restart()

    def _make_driver(self, policy: str) -> Any:
        if policy in DRIVERS:
            return FollowerDriver(self.task, law=policy)
        from haustra.envs.learning.drivers import PolicyDriver
        from haustra.envs.learning.policy import load_policy, policy_folder

        return PolicyDriver(load_policy(policy_folder(policy)))

    def restart(self) -> None:
        """Begin the episode."""
        self._seen = self.task.reset(seeds=[self.seed], case=0)
        self._driver.begin(np.ones(1, bool))
        self._proposed: Float[np.ndarray, " levers"] | None = None
        self._last: Step | None = None
        self._info = self.task.info()
        self._blood = WallBlood(self.around.colon, self._moved)

    def begin(self, start: int, seed: int | None) -> None:
        """Begin an episode, another one if a seed is given."""
        self.seed = self.seed if seed is None else seed
        self.put_back(start)

    def configuration(self) -> dict[str, Any]:
        """Rules, seed, and who assists."""
        return {"kind": self.kind, "task": self.config.to_json(), "seed": self.seed, "policy": self._policy}

    def advance(self, levers: Float[np.ndarray, " levers"]) -> bool:
        """Apply one action. Who assists has looked before each, asked or not: it may remember what it saw."""
        self.assist()
        self._proposed = None
        self._driver.did(levers[None])
        self._last = self.task.step(levers[None])
        self._seen, self._info = self._last.observation, self._last.info
        seen, lengths = self.task.seen, -np.diff(self._cable.node_distances)
        forces = np.where(seen.link_arcs > 0, seen.link_forces, 0.0)
        shear = mucosal_shear(forces, self.task.friction[0], 2 * self._cable.radius, lengths)
        self._blood.shear(at_stations(shear, seen.link_arcs, len(self._stations))[0], self._lying)
        return not bool(self._info["diverged"][0])

    def _lying(self) -> Lying:
        """Where scope and colon are now."""
        past, moved = self._cable.node_distances < float(self.task.seen.insertion[0]), self.task.displacement
        return Lying(self._shape(self.task.backend.positions()[0])[past], None if moved is None else moved[0])

    def look(self) -> Look:
        """Readings, what the task tells, and the shape."""
        seen, info = self.task.seen, self._info
        qpos = self.task.backend.positions()[0]
        moved, bled = self.task.displacement, self._blood.bled
        row = {
            "time": len(self._done) * self.interval,
            "tip": np.array(seen.tip[0], float),
            "tip_frame": np.array(seen.tip_frame[0], float),
            **{name: float(info[name][0]) for name in _TOLD},
            "insertion": float(seen.insertion[0]),
            "torque": float(seen.torque[0]),
            "bend": np.array(seen.bend[0], float),
            "coils": np.array(seen.coils[0], float),
            "p_perforation": float(info["p_perforation"][0]),
            "reward": 0.0 if self._last is None else float(self._last.reward[0]),
            "terminated": self._last is not None and bool(self._last.terminated[0]),
            "truncated": self._last is not None and bool(self._last.truncated[0]),
            "observation": seen_by.flat(self._seen)[0],
            "bleeding_places": int(bled.sheared.sum()),
            "digest": digest(qpos, *bled, *(() if moved is None else (moved,))),
        }
        pressed = np.zeros(len(self._stations))
        arcs = np.array(seen.link_arcs[0], float)
        beside = np.clip(np.rint(arcs / self._stations[1]), 0, len(pressed) - 1).astype(int)
        np.maximum.at(pressed, beside, np.where(arcs > 0, seen.link_forces[0], 0.0))
        frame = {"shape": self._shape(qpos), "pressed": pressed, "pain": np.zeros(len(pressed)), "blood": bled.places}
        if moved is not None:
            frame["displacement"] = np.array(moved[0], float)
        return Look(row, frame)

    def _shape(self, qpos: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "nodes 3"]:
        import mujoco

        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        return np.vstack([self._data.xpos[self._links], self._data.site_xpos[self._tip]])

    def assist(self) -> Float[np.ndarray, " levers"]:
        """What the policy, or the driver, does."""
        if self._proposed is None:
            self._proposed = np.asarray(self._driver.act(self._seen)[0], float)
        return self._proposed

    def change(self, name: str, number: float) -> None:
        """Nothing changes within an episode: what was drawn stays."""
        self.condition(name)

    def now(self) -> Float[np.ndarray, " conditions"]:
        """No conditions."""
        return np.zeros(0)

    def close(self) -> None:
        """End the backend's threads."""
        self.task.close()


def episode_surroundings(bank: ColonSet) -> Surroundings:
    """The one colon of a bank, as its table knows it."""
    tabulated, design = bank.cases[0], bank.design
    tables = bank.tables if bank.options.mesentery else None
    lens = lens_of(design.tip, LENS_SIZE, LENS_SIZE)
    return Surroundings(tabulated.colon(), tables, *tabulated.own_axes, design.diameter / 2, lens)
