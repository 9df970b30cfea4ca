"""One script of hand and wires, driven through any model of the same scope in the same colon."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.control.follower import FollowerSettings, LumenFollower
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.sim.backend import SingleBackend
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.accuracy.knobs import Tweak, unchanged
from haustra.scripts.bench.accuracy.timing import processor_seconds

TIMED = 25
"""Control intervals in which stepping is timed, as one."""


@dataclass(frozen=True)
class Script:
    """Inputs at 50 Hz."""

    push_rate: Float[np.ndarray, " n"]
    """[m/s]."""
    roll_rate: Float[np.ndarray, " n"]
    """[rad/s]."""
    pulls: Float[np.ndarray, "n 4"]
    """[N]."""

    def __len__(self) -> int:
        return len(self.push_rate)

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return len(self) * CONTROL_INTERVAL

    def deepest(self, start: float) -> float:
        """The most scope that can be past the anus when the tip starts at that depth [m]."""
        return start + max(0.0, float(np.cumsum(self.push_rate).max()) * CONTROL_INTERVAL)


@dataclass(frozen=True)
class Track:
    """What a script did to one model."""

    tip: Float[np.ndarray, "records 3"]
    """[m]."""
    insertion: Float[np.ndarray, " records"]
    """[m]."""
    push: Float[np.ndarray, " records"]
    """Force with which the hand pushes [N]."""
    wall: Float[np.ndarray, " records"]
    """Sum of the wall's normal forces [N]."""
    contacts: float
    """Number of contacts that carry force, on average."""
    cost: float
    """Processor seconds of stepping per simulated second, from where the script ended; infinite where it fell over."""

    def __len__(self) -> int:
        return len(self.push)


@dataclass(frozen=True)
class Errors:
    """One track against another under the same script."""

    tip: float
    """Median distance of the tips [m]."""
    push: float
    """Difference of the mean sizes of push, relative [1]; moments differ more, since a scope sticks and slips."""
    wall: float
    """Difference of the mean wall forces, relative [1]."""


def steady_push(seconds: float, rate: float) -> Script:
    """Push at one speed [m/s] and leave the wires alone."""
    count = round(seconds / CONTROL_INTERVAL)
    return Script(np.full(count, rate), np.zeros(count), np.zeros((count, 4)))


def honouring(scene: Scene) -> SingleBackend:
    """The backend that `haustra run` chooses for a scene: linear time by the lumen's table, or native MuJoCo."""
    return LinearSingle(scene) if scene.options.wall_law == "table" else NativeEngine(scene)


def record_script(colon: Colon, design: ScopeDesign, options: SceneOptions, *, seconds: float) -> Script:
    """What the lumen follower does in that scene; in tangent planes it feels true forces."""
    settings = FollowerSettings(straighten=options.mesentery)
    deepest = options.start_depth + settings.advance_rate * seconds
    engine = honouring(build_scene(colon, None, design, options, show_lumen=False, deepest=deepest))
    links = engine.scene.cable.tip_links
    follower = LumenFollower(colon.centreline, design, tip_links=links, settings=settings)
    tracker = ArcTracker(colon.centreline, start=options.start_depth)
    rows = []
    for _ in range(round(seconds / CONTROL_INTERVAL)):
        seen = engine.read()
        inputs = follower.act(seen, tracker.update(seen.tip, seen.way), CONTROL_INTERVAL)
        engine.step(inputs, round(CONTROL_INTERVAL / options.timestep))
        rows.append([inputs.push_rate, inputs.roll_rate, *inputs.pulls])
    table = np.array(rows)
    return Script(table[:, 0], table[:, 1], table[:, 2:])


def replay(
    script: Script,
    colon: Colon,
    wall: Wall | None,
    design: ScopeDesign,
    options: SceneOptions,
    *,
    tweak: Tweak = unchanged,
) -> Track:
    """Drive one model by a script; records end where it diverges.

    Raises:
        UnsupportedSceneError: when no backend honours the scene.
    """
    deepest = script.deepest(options.start_depth)
    scene = build_scene(colon, wall, design, options, show_lumen=False, deepest=deepest)
    tweak(scene.spec)
    engine = honouring(scene)
    steps = round(CONTROL_INTERVAL / options.timestep)
    rows = []
    for index in range(len(script)):
        inputs = Controls(float(script.push_rate[index]), float(script.roll_rate[index]), script.pulls[index])
        if not engine.step(inputs, steps):
            break
        rows.append(_read(engine))
    table = np.array(rows).reshape(-1, 7)
    still = Controls(0.0, 0.0, script.pulls[-1])
    spent = processor_seconds(lambda: engine.step(still, TIMED * steps)) if len(rows) == len(script) else np.inf
    return Track(
        tip=table[:, :3],
        insertion=table[:, 3],
        push=table[:, 4],
        wall=table[:, 5],
        contacts=float(table[:, 6].mean()) if len(table) else 0.0,
        cost=spent / (TIMED * CONTROL_INTERVAL),
    )


def _read(engine: SingleBackend) -> tuple[float, ...]:
    seen = engine.read()
    return (*seen.tip, seen.insertion, seen.push_force, seen.wall_force_sum, float(seen.contacts))


def compare(track: Track, reference: Track) -> Errors:
    """How far a track is from a reference; infinite when it ended early."""
    if len(track) < len(reference):
        return Errors(np.inf, np.inf, np.inf)
    gap = np.linalg.norm(track.tip - reference.tip, axis=1)
    return Errors(
        tip=float(np.median(gap)),
        push=abs(float(np.abs(track.push).mean() / np.abs(reference.push).mean()) - 1),
        wall=abs(float(track.wall.mean() / reference.wall.mean()) - 1),
    )


def set_tolerance(size: float) -> Tweak:
    """Another tolerance of the solver, with as many iterations as it needs."""

    def change(spec: mujoco.MjSpec) -> None:
        spec.option.tolerance, spec.option.iterations = size, 1000

    return change
