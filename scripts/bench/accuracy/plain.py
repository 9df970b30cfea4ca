"""Question: how much faster is `balanced` than the scene that a competent user would write, at no more error?

Bars: 20 times at 60 segments, 100 times at 140. The shaft is pushed in at a steady speed, tip free, under the same
hand; costs are those of the state at the end, when both lie against the wall, in turns.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import HaustraError
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import PRESETS
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.accuracy.drive import replay, set_tolerance, steady_push
from haustra.scripts.bench.accuracy.insertion import refined
from haustra.scripts.bench.accuracy.places import Place, grown
from haustra.scripts.bench.accuracy.plain_scope import PlainScope, plain_scope
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Block, in_turns, sound, stepping
from haustra.scripts.bench.result import Criterion, Table, Value

RATE = 0.04
"""Speed of the hand [m/s]."""
BARS = {60: 20.0, 140: 100.0}
"""How many times faster `balanced` is to be than a cable of so many segments."""
STEPS = (5e-3, 4e-3, 2.5e-3, 2e-3, 1e-3, 5e-4, 2e-4)
"""Time steps that are tried where joints are damped [s]: whole numbers of them make an interval."""
SMALL_STEPS = (4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.2e-5)
"""Time steps that are tried where joints are not damped [s]."""
_FASTEST = 100.0
"""Speed of a joint that is taken for divergence [rad/s]."""
_HOLD = 150
"""Steps for which an undamped cable must be stable from that state; an explicit chain blows up within tens."""


@dataclass(frozen=True)
class Plain:
    """A plain scene that has been pushed in."""

    scope: PlainScope
    data: mujoco.MjData
    timestep: float
    tip: Float[np.ndarray, "records 3"]


def answer(effort: Effort) -> Answer:
    """Push the shaft in, compare tips with a converged run, and time steps in turns."""
    place, design = grown(effort), find_design("adult")
    seconds = 3.0 if effort.quick else 5.0
    script = steady_push(seconds, RATE)
    wall = place.wall("prism" if effort.quick else "coacd")
    effort.tell("plain scene: reference")
    finest = refined(2, 2, SceneOptions.timestep) if effort.quick else refined(6, 4, SceneOptions.timestep / 4)
    reference = replay(script, place.colon, None, design, finest, tweak=set_tolerance(1e-8))
    own = replay(script, place.colon, wall, design, PRESETS["balanced"].apply())
    engine, inputs = _balanced(place, wall, design, seconds)
    blocks: dict[str, Block] = {"balanced": _block(engine, inputs)}
    errors = {"balanced": _gap(own.tip, reference.tip)}
    details: dict[str, dict[str, Value]] = {"balanced": {"timestep_s": SceneOptions.timestep, "dofs": engine.model.nv}}
    for segments in list(BARS)[: 1 if effort.quick else None]:
        effort.tell(f"plain scene: {segments} segments")
        damped = _pushed(place, wall, design, segments, seconds)
        name = f"plugin cable, {segments} segments"
        errors[f"{name}, damped"] = _gap(damped.tip, reference.tip)
        blocks[f"{name}, damped"] = stepping(damped.scope.model, damped.data, steps=20)
        step, block = _undamped(damped)
        blocks[f"{name}, MuJoCo's damping"] = block
        for kind, size in (("damped", damped.timestep), ("MuJoCo's damping", step)):
            details[f"{name}, {kind}"] = {"timestep_s": size, "dofs": damped.scope.model.nv}
    effort.tell("plain scene: timing in turns")
    costs = dict(zip(blocks, in_turns(list(blocks.values()), repeats=3), strict=True))
    return Answer(
        tables=[_table(costs, errors, details)],
        criteria=_criteria(costs, errors),
        notes=[
            f"Plain scene: pushed in at {RATE} m/s for {seconds:g} s ({reference.insertion[-1]:.2f} m) unsteered, "
            "all pieces of the wall standing. MuJoCo's joints have no damping unless a user adds it; 'damped' has the "
            "scope's own. Both take the largest step of a ladder at which they are stable. Undamped, tips are those of "
            "the damped cable, from whose last state the undamped one goes on."
        ],
    )


def _balanced(place: Place, wall: Wall, design: ScopeDesign, seconds: float) -> tuple[NativeEngine, Controls]:
    """The preset's engine at the end of the script."""
    options = PRESETS["balanced"].apply()
    scene_wall = wall if options.wall_law == "pieces" else None
    deepest = steady_push(seconds, RATE).deepest(options.start_depth)
    engine = NativeEngine(build_scene(place.colon, scene_wall, design, options, show_lumen=False, deepest=deepest))
    inputs = Controls(RATE, 0.0)
    for _ in range(round(seconds / CONTROL_INTERVAL)):
        engine.step(inputs, round(CONTROL_INTERVAL / options.timestep))
    return engine, inputs


def _block(engine: NativeEngine, inputs: Controls) -> Block:
    engine.step(inputs, 1)
    return stepping(engine.model, engine.data, steps=100)


def _pushed(place: Place, wall: Wall, design: ScopeDesign, segments: int, seconds: float) -> Plain:
    """The plain scene at the largest step of the ladder at which it survives the script."""
    for step in STEPS:
        scope = plain_scope(place.colon, wall, design, segments=segments, timestep=step, damped=True)
        data, tips = scope.begin(), []
        for _ in range(round(seconds / CONTROL_INTERVAL)):
            for _ in range(round(CONTROL_INTERVAL / step)):
                data.ctrl[0] = RATE * (data.time + step)
                if not _stepped(scope.model, data):
                    break
            if not sound(data) or np.abs(data.qvel).max() >= _FASTEST:
                break
            mujoco.mj_kinematics(scope.model, data)
            tips.append(scope.tip_of(data))
        else:
            return Plain(scope, data, step, np.array(tips))
    raise HaustraError(f"A plain cable of {segments} segments diverged at every time step down to {STEPS[-1]} s.")


def _undamped(pushed: Plain) -> tuple[float, Block]:
    """The largest step that MuJoCo's own damping, none, allows from that state, and its block."""
    model, start = pushed.scope.model, pushed.data
    damping, step_before = model.dof_damping.copy(), model.opt.timestep
    for step in SMALL_STEPS:
        model.dof_damping[1:], model.opt.timestep = 0.0, step
        data = mujoco.MjData(model)
        data.qpos[:], data.ctrl[:], data.time = start.qpos, start.ctrl, start.time
        fine = all(_stepped(model, data) for _ in range(_HOLD))
        model.dof_damping[:], model.opt.timestep = damping, step_before
        if fine:
            return step, _without_damping(model, data, step)
    return float("nan"), lambda: float("inf")


def _stepped(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether one more step left a state worth stepping from: a wild one touches every piece, and takes minutes."""
    mujoco.mj_step(model, data)
    return sound(data) and bool(np.abs(data.qvel).max() < _FASTEST)


def _without_damping(model: mujoco.MjModel, data: mujoco.MjData, step: float) -> Block:
    """A block that takes damping off for its own time, since both cables share a model."""
    damping, before = model.dof_damping.copy(), model.opt.timestep

    def block() -> float:
        model.dof_damping[1:], model.opt.timestep = 0.0, step
        try:
            return stepping(model, data, steps=20)()
        finally:
            model.dof_damping[:], model.opt.timestep = damping, before

    return block


def _gap(tips: Float[np.ndarray, "records 3"], reference: Float[np.ndarray, "records 3"]) -> float:
    return float(np.median(np.linalg.norm(tips - reference, axis=1))) * 1e3


def _table(costs: dict[str, float], errors: dict[str, float], details: dict[str, dict[str, Value]]) -> Table:
    rows: Sequence[dict[str, Value]] = [
        {
            "scene": name,
            "cost_processor_s_per_s": cost,
            "over_balanced": cost / costs["balanced"],
            "tip_error_mm": errors.get(name),
            **details[name],
        }
        for name, cost in costs.items()
    ]
    return Table("Against the scene that a competent user would write", tuple(rows))


def _criteria(costs: dict[str, float], errors: dict[str, float]) -> list[Criterion]:
    criteria = []
    for segments, bound in BARS.items():
        name = f"plugin cable, {segments} segments"
        if f"{name}, damped" not in costs:
            continue
        for kind in ("MuJoCo's damping", "damped"):
            ratio = costs[f"{name}, {kind}"] / costs["balanced"]
            criteria.append(
                Criterion(f"balanced is faster than the plain scene: {name}, {kind}", ratio, bound, "times", "at least")
            )
        plain = errors[f"{name}, damped"]
        criteria.append(
            Criterion(f"tip error of balanced against that of the {name}", errors["balanced"], plain, "mm", "at most")
        )
    return criteria
