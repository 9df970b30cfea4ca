"""One run: a scope driven into a colon, recorded and scored."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from haustra.envs.control.follower import FollowerSettings, LumenFollower
from haustra.envs.runs.measure.containment import Containment, most_skipped
from haustra.envs.runs.measure.injury import Burden, InjuryMeter, stations_of
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.runs.outcome import Outcome, ending, given_up, outcome_of, withdrawn
from haustra.envs.sim.backend import SingleBackend
from haustra.envs.sim.coils import COIL_DISTANCES
from haustra.envs.sim.gas import GasRecord, gas_pressures
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls, Readings
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import Scene
from haustra.models.wall.moving_colon import POSE

CONTROL_INTERVAL = 0.02
"""Time between two decisions of the driver, and between two records [s]; engineering choice: 50 Hz."""

_FELT = "time", "link_forces", "link_arcs", "bend", "displacement"
"""Names of those readings that tell what the colon bears."""

Progress = Callable[[float, float], None]
"""Called with simulated time [s] and tip arc length [m]."""


@dataclass(frozen=True)
class Trajectory:
    """What was recorded at every control interval."""

    time: Float[np.ndarray, " records"]
    """[s]."""
    qpos: Float[np.ndarray, "records positions"]
    """Generalised positions [m, rad]."""
    ctrl: Float[np.ndarray, "records actuators"]
    """Controls that led to the record [m, rad, N, 1]."""
    tip: Float[np.ndarray, "records 3"]
    """Tip position [m]."""
    insertion: Float[np.ndarray, " records"]
    """Length past the anus [m]."""
    tip_arc: Float[np.ndarray, " records"]
    """Arc length of the centreline next to the tip [m]."""
    push_force: Float[np.ndarray, " records"]
    """Force of the hand [N]."""
    torque: Float[np.ndarray, " records"]
    """Torque of the hand [N m]."""
    wall_force: Float[np.ndarray, " records"]
    """Largest resultant wall force on one link [N]."""
    wall_force_link: Float[np.ndarray, " records"]
    """Distance from the tip of the link that bears it [m]."""
    contacts: Float[np.ndarray, " records"]
    """Contacts that carry force."""
    scope_energy: Float[np.ndarray, " records"]
    """E_c, stored in bending the scope [J]."""
    wall_energy: Float[np.ndarray, " records"]
    """E_b, stored in pressing the wall [J]."""
    outside: Float[np.ndarray, " records"]
    """How far the scope stands outside the lumen at rest [m]; negative inside (`Containment`)."""
    asked_up: Float[np.ndarray, " records"]
    """Bend towards wire 'up' that the driver steered for, as ideal wires would give it [rad]."""
    asked_left: Float[np.ndarray, " records"]
    """Bend towards wire 'left' that the driver steered for, as ideal wires would give it [rad]."""
    bend_up: Float[np.ndarray, " records"]
    """Bend of the bending section towards wire 'up' [rad]."""
    bend_left: Float[np.ndarray, " records"]
    """Bend of the bending section towards wire 'left' [rad]."""
    colon_moved: Float[np.ndarray, " records"]
    """Farthest that a place of the colon's centreline is from where it was at rest [m]."""
    wall_force_sum: Float[np.ndarray, " records"]
    """Sum of the wall's normal forces on the whole scope [N]."""
    coils: Float[np.ndarray, "records coils 3"]
    """Places of a magnetic imager's coils (`haustra.envs.sim.coils`) [m]; those outside the anus are of no meaning."""
    load: Float[np.ndarray, " records"]
    """Largest load of a place of the wall over the median person's strength [1] (`haustra.models.injury`)."""
    load_arc: Float[np.ndarray, " records"]
    """Arc length there [m]."""
    pressed: Float[np.ndarray, "records places"]
    """Largest resultant wall force on one link beside places of the colon two centimetres apart [N]."""
    shear: Float[np.ndarray, "records places"]
    """Largest shear of the mucosa there [Pa]."""
    pain: Float[np.ndarray, "records places"]
    """Tension of wall or mesentery there, over that which is assumed to hurt [1]."""
    mesentery_extension: Float[np.ndarray, " records"]
    """Farthest that the mesentery is drawn out beyond its slack [m]."""
    displacement: Float[np.ndarray, "records nodes 7"]
    """Poses of the colon's axis in the scene's coordinates (`haustra.models.wall.moving_colon.AxisDisplacement`); no
    nodes where the colon is fixed."""
    mocap_pos: Float[np.ndarray, "records blocks 3"]
    """Where the bodies are on which pieces of a wall that moves stand, as MuJoCo's mocap_pos [m]."""
    mocap_quat: Float[np.ndarray, "records blocks 4"]
    """How they are turned, as MuJoCo's mocap_quat."""


@dataclass(frozen=True)
class Insertion:
    """A finished run."""

    outcome: Outcome
    trajectory: Trajectory
    shape: Float[np.ndarray, "nodes 3"]
    """Points along the scope at the end [m]."""
    tip_frame: Float[np.ndarray, "3 3"]
    """Columns: wire 'up', wire 'left', viewing direction at the end."""
    wall_clock: float
    """Time that stepping and deciding took [s]."""
    attempts: int
    """Times that the driver had backed off since its last progress."""
    settings: Any
    """How it was driven: of the follower, or of another driver."""
    colon: Colon
    """As it lay at the end, as if nothing stood in its wall (`haustra.envs.runs.measure.surface.left_behind`)."""
    backend: str = "native"
    """What stepped it, of `haustra.envs.sim.capabilities.BACKENDS`."""
    gas: GasRecord | None = None
    """Pressures and volumes of gas, where the scene had it."""
    shaft_added: tuple[float, ...] = ()
    """When shaft was added to the scene [s]: from then on stock MuJoCo repeats it closely, but not to the bit."""

    @property
    def records(self) -> Mapping[str, np.ndarray]:
        """What was recorded, by name."""
        return vars(self.trajectory)


def run_insertion(
    scene: Scene,
    *,
    seconds: float,
    settings: Any = None,
    backend: Callable[[Scene], SingleBackend] = NativeEngine,
    progress: Progress | None = None,
) -> Insertion:
    """Let a driver, by default the lumen follower, drive the scope for up to `seconds` of simulated time.

    A diverged run ends at once; its last, unsound state is not recorded.

    Args:
        scene: colon, wall and scope.
        seconds: simulated time [s].
        settings: of the driver (`haustra.envs.control.follower.Law`).
        backend: what steps the scene.
        progress: told now and then how far it is.

    Raises:
        UnsupportedSceneError: when the backend cannot honour the scene.
    """
    settings = settings or FollowerSettings()
    driver = LumenFollower(scene.colon.centreline, scene.design, tip_links=scene.cable.tip_links, settings=settings)
    return drive(backend(scene), driver, settings, until=seconds, arc=scene.options.start_depth, progress=progress)


@runtime_checkable
class Driver(Protocol):
    """Who drives one scope."""

    def act(self, seen: Readings, arc: float, interval: float) -> Controls:
        """Inputs for the next `interval` [s], given what was seen and the tip's arc length [m]."""
        ...

    @property
    def asked(self) -> Float[np.ndarray, "2"]:
        """Bend that it steers for, towards wires 'up' and 'left' [rad]."""
        ...

    @property
    def attempts(self) -> int:
        """Times that it backed off since the last progress."""
        ...

    @property
    def gives_up(self) -> bool:
        """Whether it ends the run, having tried what it can."""
        ...


def drive(
    backend: SingleBackend,
    driver: Driver,
    settings: Any,
    *,
    until: float,
    arc: float,
    every: float = CONTROL_INTERVAL,
    left: bool = False,
    progress: Progress | None = None,
) -> Insertion:
    """Let a driver drive a scope from where it is, and record it.

    Args:
        backend: the scope.
        driver: decides.
        settings: what the driver goes by, for the record.
        until: simulated time at which the run is over at the latest [s].
        arc: arc length of the tip at the beginning [m].
        every: time between two decisions, and between two records [s].
        left: end when the scope is withdrawn, instead of when it is inserted.
        progress: told now and then how far it is.
    """
    scene = backend.scene
    line = scene.colon.centreline
    tracker = ArcTracker(line, start=arc)
    steps = max(1, round(every / scene.options.timestep))
    interval = steps * scene.options.timestep
    containment = Containment(scene.colon, radius=scene.cable.radius)
    rows: list[tuple] = []
    felt: list[tuple] = []
    seen, shape = backend.read(), backend.shape()
    ended, healthy = 0, True
    began = time.perf_counter()
    while seen.time < until - interval / 2:
        inputs = driver.act(seen, tracker.arc, interval)
        if not backend.step(inputs, steps):
            healthy = False
            break
        seen, shape = backend.read(), backend.shape()
        tracker.update(seen.tip, seen.way)
        behind = scene.cable.node_distances
        inside = behind < seen.insertion
        outside = containment.outside(shape[inside], behind[inside], tracker.arc, seen.way)
        moved = 0.0 if seen.way is None else float(np.linalg.norm(seen.way - line.points, axis=1).max())
        poses = np.zeros((0, POSE)) if seen.displacement is None else seen.displacement
        last = moved, seen.wall_force_sum, seen.coils, poses, *backend.mocap(scene.blocks)
        felt.append(tuple(getattr(seen, name) for name in _FELT))
        rows.append((*_record(backend, seen, tracker.arc, outside), *driver.asked, *seen.bend, *last))
        if progress and len(rows) % 25 == 0:
            progress(seen.time, tracker.arc)
        where = {"arc": tracker.arc, "insertion": seen.insertion}
        if left:
            ended = withdrawn(scene.options.start_depth, **where)
        else:
            lengths = {"length": line.length, "modelled": scene.cable.length}
            skipped = 0.0 if seen.way is None else most_skipped(np, seen.link_arcs, behind, inside)
            ended = int(ending(np, outside=outside, skipped=skipped, **where, **lengths))
            ended = int(given_up(np, ended, driver.gives_up))
        if ended:
            break
    return Insertion(
        outcome=outcome_of(ended, healthy=healthy, attempts=driver.attempts),
        trajectory=_trajectory(rows, felt, backend),
        shape=shape,
        tip_frame=seen.tip_frame,
        wall_clock=time.perf_counter() - began,
        attempts=driver.attempts,
        settings=settings,
        colon=backend.colon(),
        backend=backend.name,
        gas=backend.gas and backend.gas.record(len(rows)),
        shaft_added=tuple(backend.added),
    )


def _record(backend: SingleBackend, seen: Readings, arc: float, outside: float) -> tuple:
    worst = int(np.argmax(seen.link_forces))
    behind = backend.scene.cable.node_distances[worst]
    return (
        seen.time,
        backend.qpos,
        backend.ctrl,
        seen.tip,
        seen.insertion,
        arc,
        seen.push_force,
        seen.torque,
        seen.link_forces[worst],
        behind,
        float(seen.contacts),
        seen.energies.bending,
        seen.energies.wall,
        outside,
    )


def _trajectory(rows: list[tuple], felt: list[tuple], backend: SingleBackend) -> Trajectory:
    names = [name for name in Trajectory.__dataclass_fields__ if name not in Burden._fields]
    if not rows:
        places = np.zeros((0, len(stations_of(backend.scene.colon))))
        nothing: dict[str, np.ndarray] = dict.fromkeys(Trajectory.__dataclass_fields__, np.zeros(0))
        nothing |= {"qpos": backend.qpos[None][:0], "ctrl": backend.ctrl[None][:0], "tip": np.zeros((0, 3))}
        nothing |= {"coils": np.zeros((0, len(COIL_DISTANCES), 3)), "pressed": places, "shear": places, "pain": places}
        nodes = backend.read().displacement
        nothing |= {"displacement": np.zeros((0, 0 if nodes is None else len(nodes), POSE))}
        blocks = (part[None][:0] for part in backend.mocap(backend.scene.blocks))
        return Trajectory(**nothing | dict(zip(names[-2:], blocks, strict=True)))
    columns = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    parts = (None if column[0] is None else np.array(column, float) for column in zip(*felt, strict=True))
    seen = backend.read()._replace(**dict(zip(_FELT, parts, strict=True)))
    injury = InjuryMeter(backend.scene)
    burden = injury.measure(seen, gas_pressures(backend.gas, len(rows), injury.stations))
    return Trajectory(**dict(zip(names, columns, strict=True)), **burden._asdict())
