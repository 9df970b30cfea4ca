"""Sudden changes to a scope that lies in a colon: what moves how fast, and whether it comes to rest again."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import mujoco
import numpy as np

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.containment import Containment
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.runs.outcome import ESCAPE_DEPTH
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.cable import PULL_OUT_LIMIT
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.law import SoftContact, WallContact, contact_parameters, solimp
from haustra.models.wall.pieces.folder import wall_of
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.laying import lay_along
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import divergence, prepare_colons
from haustra.scripts.bench.stability.rows import Answer, Row, Rows, fill

DRIVE_IN, QUICK_DRIVE_IN = 6.0, 3.0
"""Time in which the scope is pushed in before the shock [s]."""
PUSH_RATE = 0.05
"""Meanwhile [m/s]."""
PULLS = np.array([20.0, 8.0, 0.0, 0.0])
"""Meanwhile [N]: the tip is bent, as in use."""
AFTER, QUICK_AFTER = 10.0, 6.0
"""Time to come to rest in [s]; hands are still."""
AT_REST = 5e-4
"""Furthest that any joint of a scope at rest gets from where it ends, over the last second [m]: friction below its
limit creeps. Speeds tell less: a tip in a crease of the lumen's triangles is pushed to and fro as its tangent plane
changes facets, by 0.2 rad/s in single steps and by microns."""
STEP_PUSH, STEP_TIME = 50.0, 0.5
"""Force along the shaft [N], and how long it lasts [s]."""
STILL_SPEED = 0.05
"""Bar of generalised speeds over the last second, set before that of `AT_REST` and kept beside it [rad/s or m/s]."""
PULL_OUT = PULL_OUT_LIMIT, 0.12
"""Speed [m/s] and length [m] of a sudden pull: the fastest that the shaft's locks are made for."""
LARGEST_SPEED = 1000.0
"""Bound of every generalised speed [rad/s or m/s]: a freed tip of 15 mm would move at 15 m/s."""

LAST = round(1 / CONTROL_INTERVAL)
"""Records of the last second."""

Act: TypeAlias = Callable[[NativeEngine], Iterator[tuple[Controls, float]]]
"""Does the shock; gives inputs, and for how long [s]."""
STILL = Controls(0.0, 0.0)


@dataclass(frozen=True)
class Shocked:
    """What became of one shock."""

    name: str
    wall: str
    outcome: Literal["at rest", "moving", "escaped", "diverged"]
    reason: str
    fastest: float
    """Largest generalised speed after the shock [rad/s or m/s]."""
    energy_before: float
    """Stored in bending, twist and wall [J]."""
    energy_peak: float
    energy_end: float
    wander: float
    """Furthest that any joint gets from where it ends, over the last second [m]."""
    speed_end: float
    """Largest generalised speed over the last second [rad/s or m/s]."""


def shocks(order: RunOptions, progress: Progress) -> Part:
    """All shocks against tangent planes and, unless quick, against pieces."""
    folder = order.folder / "colons"
    prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"), walls=not order.quick)
    rows = Rows(order.folder / "shocks.jsonl", {"quick": order.quick, "shocks": list(SHOCKS)})
    count = len(SHOCKS) * (1 if order.quick else 2)
    given = (str(folder / "grown-0"), order.quick)
    fill(rows, count, begin, given, workers=order.workers, deadline=order.deadline, progress=progress)
    return judge([_shocked(row) for row in rows.first(count)], count)


def begin(folder: str, quick: bool) -> Answer:
    """What answers rows in one process: all shocks against planes, then all against pieces."""
    colon = load_colon(Path(folder))

    def answer(number: int) -> Row:
        pieces, index = divmod(number, len(SHOCKS))
        wall = wall_of(Path(folder), colon, "prism") if pieces else None
        return {"number": number, **asdict(shock(colon, wall, list(SHOCKS)[index], quick=quick))}

    return answer


def _shocked(row: Row) -> Shocked:
    if row["outcome"] == "crashed":
        pieces, index = divmod(row["number"], len(SHOCKS))
        name, wall = list(SHOCKS)[index], "pieces" if pieces else "planes"
        return Shocked(name, wall, "diverged", "process died", *[np.inf] * 6)
    return Shocked(**{key: value for key, value in row.items() if key != "number"})


def shock(colon: Colon, wall: Wall | None, name: str, *, quick: bool = False) -> Shocked:
    """Drive a scope in, shock it, and watch it come to rest."""
    options = SceneOptions(wall_law="pieces" if wall else "planes")
    engine = NativeEngine(build_scene(colon, wall, named_design("adult"), options, show_lumen=False))
    watch = _Watch(engine)
    drive_in = QUICK_DRIVE_IN if quick else DRIVE_IN
    if not watch.run(Controls(PUSH_RATE, 0.0, PULLS), drive_in):
        return watch.told(name, before=np.nan)
    watch.forget()
    before = watch.energy
    for inputs, seconds in SHOCKS[name](engine):
        if not watch.run(inputs, seconds):
            return watch.told(name, before=before)
    watch.run(STILL, QUICK_AFTER if quick else AFTER)
    return watch.told(name, before=before)


class _Watch:
    """Steps a backend and keeps what was seen."""

    def __init__(self, engine: NativeEngine) -> None:
        self._engine = engine
        line = engine.scene.colon.centreline
        self._tracker = ArcTracker(line, start=engine.scene.options.start_depth)
        self._containment = Containment(engine.scene.colon, radius=engine.scene.cable.radius)
        self.energy, self._sound = _energy(engine), True
        self._outside = -np.inf
        self.forget()

    def forget(self) -> None:
        self._speeds: list[float] = []
        self._energies: list[float] = [self.energy]
        self._shapes: list[np.ndarray] = []

    def run(self, inputs: Controls, seconds: float) -> bool:
        engine = self._engine
        steps = max(1, round(CONTROL_INTERVAL / engine.model.opt.timestep))
        for _ in range(round(seconds / CONTROL_INTERVAL)):
            self._sound = engine.step(inputs, steps)
            if not self._sound:
                return False
            self._tracker.update(engine.data.site("scope/tip").xpos)  # near where it was last seen
            self.energy = _energy(engine)
            self._speeds.append(float(np.abs(engine.data.qvel).max()))
            self._energies.append(self.energy)
            self._shapes = [*self._shapes[1 - LAST :], engine.shape()]
        shape, behind = engine.shape(), engine.scene.cable.node_distances
        inside = behind < engine.insertion
        self._outside = self._containment.outside(shape[inside], behind[inside], self._tracker.arc)
        return True

    def told(self, name: str, *, before: float) -> Shocked:
        last = max(self._speeds[-LAST:], default=np.inf)
        shapes = np.array(self._shapes)
        wander = float(np.linalg.norm(shapes - shapes[-1], axis=-1).max()) if len(shapes) == LAST else np.inf
        outcome = "at rest" if wander < AT_REST else "moving"
        if self._outside > ESCAPE_DEPTH:
            outcome = "escaped"
        return Shocked(
            name=name,
            wall=self._engine.scene.options.wall_law,
            outcome=outcome if self._sound else "diverged",
            reason="" if self._sound else divergence(self._engine),
            fastest=max(self._speeds, default=np.inf),
            energy_before=before,
            energy_peak=max(self._energies),
            energy_end=self.energy,
            wander=wander,
            speed_end=last,
        )


def _energy(engine: NativeEngine) -> float:
    energies = engine.read().energies
    return energies.total + energies.twist


def judge(found: list[Shocked], planned: int) -> Part:
    """Bars and table of what was run of the planned."""
    lost = [each for each in found if each.outcome in ("diverged", "escaped")]
    restless = [each for each in found if each.outcome == "moving"]
    turning = [each for each in found if not each.speed_end < STILL_SPEED]
    fastest = max((each.fastest for each in found), default=np.inf)
    criteria = (
        Criterion("shocks after which a scope diverged or left the colon", len(lost), 0, "shocks", "at most"),
        Criterion("shocks after which a scope did not come to rest", len(restless), 0, "shocks", "at most"),
        Criterion(
            f"shocks after which a joint still turned at {STILL_SPEED:g} rad/s", len(turning), 0, "shocks", "at most"
        ),
        Criterion("largest generalised speed after a shock", fastest, LARGEST_SPEED, "rad/s or m/s", "at most"),
    )
    rows = tuple(
        {
            "shock": each.name,
            "wall": each.wall,
            "outcome": each.outcome,
            "named": each.reason,
            "fastest_rad_s": each.fastest,
            "energy_before_J": each.energy_before,
            "energy_peak_J": each.energy_peak,
            "energy_end_J": each.energy_end,
            "wander_last_second_mm": each.wander * 1e3,
            "speed_last_second_rad_s": each.speed_end,
        }
        for each in found
    )
    return Part(
        criteria, (Table("Shocks", rows),), summary=_SUMMARY, counts={"shocks": len(found)}, planned={"shocks": planned}
    )


def _push_hard(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    engine.data.qfrc_applied[0] = STEP_PUSH
    yield STILL, STEP_TIME
    engine.data.qfrc_applied[0] = 0.0


def _release(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    yield Controls(0.0, 0.0, np.array([engine.scene.design.wires.pull_limit, 0.0, 0.0, 0.0])), 2.0


def _cut(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    limit = engine.scene.design.wires.pull_limit
    taut = Controls(0.0, 0.0, np.array([limit / 2, limit / 2, limit / 2, limit / 2]))
    yield taut, 2.0
    engine.model.actuator_gainprm[engine.model.actuator("scope/pull_left").id, 0] = 0.0
    yield taut, 2.0


def _switch_friction(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    for value in (0.0, 1.0, engine.scene.options.friction):
        engine.model.pair_friction[:, :2] = value
        engine.model.geom_friction[_scope_geoms(engine), 0] = value
        yield Controls(PUSH_RATE, 0.0, PULLS), 1.0


def _stiffness(factor: float) -> Act:
    def act(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
        set_wall(engine, factor)
        yield STILL, 2.0
        set_wall(engine, 1.0)

    return act


def _lighten(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    engine.model.body_mass[:] /= 10
    engine.model.body_inertia[:] /= 10
    mujoco.mj_setConst(engine.model, mujoco.MjData(engine.model))
    yield Controls(PUSH_RATE, 0.0, PULLS), 1.0


def _turn_gravity(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        engine.model.opt.gravity[:] = 9.81 * axis
        yield STILL, 0.5
    engine.model.opt.gravity[:] = 0.0


def _lay(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    lay_along(engine, engine.insertion)
    yield STILL, 1.0


def _change_step(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    usual = engine.model.opt.timestep
    for factor in (0.2, 2.0, 1.0):
        engine.model.opt.timestep = factor * usual
        yield Controls(PUSH_RATE / 2, 0.0, PULLS), 1.0


def _keep_step(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    yield Controls(PUSH_RATE / 2, 0.0, PULLS), 3.0


def _pull_out(engine: NativeEngine) -> Iterator[tuple[Controls, float]]:
    speed, length = PULL_OUT
    yield Controls(-speed, 0.0), length / speed


SHOCKS: dict[str, Act] = {
    f"a push of {STEP_PUSH:g} N for {STEP_TIME:g} s": _push_hard,
    "tip released from full bend": _release,
    "wire cut, all four taut": _cut,
    "friction 0, 1, back": _switch_friction,
    "wall stiffness times 100, back": _stiffness(100.0),
    "wall stiffness over 100, back": _stiffness(0.01),
    "masses over 10": _lighten,
    "gravity turned six ways": _turn_gravity,
    "laid along the lumen, straight at rest": _lay,
    "time step over 5, times 2, back": _change_step,
    "none: the same motion, step unchanged": _keep_step,
    f"pulled out at {PULL_OUT[0]:g} m/s": _pull_out,
}
"""What is done to a scope; each yields the inputs of what follows, and for how long [s]."""


def set_wall(engine: NativeEngine, factor: float) -> None:
    """Give the contacts of a running scene that many times the stiffness and damping they were built with."""
    model, options = engine.model, engine.scene.options
    law = WallContact(
        stiffness=options.contact.stiffness * factor,
        damping=options.contact.damping * factor,
        friction=options.friction,
    )

    def parameters(body: int) -> SoftContact:
        inverse, where = float(model.body_invweight0[body, 0]), model.body(body).name
        return contact_parameters(inverse, law, timestep=options.timestep, where=where)

    for pair in range(model.npair):
        bodies = [model.geom_bodyid[geom] for geom in (model.pair_geom1[pair], model.pair_geom2[pair])]
        soft = parameters(next(body for body in bodies if model.body_mocapid[body] < 0))
        model.pair_solref[pair], model.pair_solreffriction[pair] = soft.solref, soft.sliding
        model.pair_solimp[pair] = solimp(float(soft.impedance))
    for geom in _scope_geoms(engine):
        soft = parameters(model.geom_bodyid[geom])
        model.geom_solref[geom], model.geom_solimp[geom] = soft.solref, solimp(float(soft.impedance))


def _scope_geoms(engine: NativeEngine) -> list[int]:
    return [engine.model.geom(name).id for name in engine.scene.cable.geoms]


_SUMMARY = (
    "An adult scope is pushed some 0.2 m into grown colon 0 with its tip bent, shocked, and left alone. A "
    f"scope is at rest when no joint gets further than {AT_REST * 1e3:g} mm from where it ends, over the last second. "
    "One shock is none: the motion of the changed time step, at the usual one."
)
