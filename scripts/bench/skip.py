"""What leaving something out of a scene gains and changes: each lever put back, under the same controls, in one run."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.control.follower import LumenFollower
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.pieces.reach import within_reach
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.machine import machine
from haustra.scripts.bench.result import Bench, Criterion, Table

ADVANCE = 0.04
"""Speed at which the scope is pushed in [m/s]."""

BOUND = 1e-3
"""Largest change of a score that leaving something out may cause [1]."""

_SETTLED = 0.5
"""Peaks are read after this time [s]: at the start there is nothing to compare."""

Progress = Callable[[float, str, float], None]
"""Called with levers done, the name of the last, and their number."""


@dataclass(frozen=True)
class Lever:
    """Something a scene may go without."""

    name: str
    gone: Scene
    """Without it."""
    whole: Scene
    """With it."""
    steered: bool = True
    """Whether the question it is left out of steers the tip."""
    use: Literal["left out", "kept", "a choice"] = "left out"
    """Left out where nothing asks for it; kept, since it is not worth its change; or a choice of model."""


@dataclass(frozen=True)
class Replay:
    """A scene under recorded controls."""

    cost: float
    """Processor seconds per simulated second."""
    tip: Float[np.ndarray, "records 3"]
    """[m]."""
    push: Float[np.ndarray, " records"]
    """Force of the hand [N]."""
    wall: Float[np.ndarray, " records"]
    """Sum of all normal forces of the wall [N]."""


def bench_skip(
    colon: Colon,
    wall: Wall,
    design: ScopeDesign,
    *,
    seconds: float,
    repeats: int,
    progress: Progress = lambda done, note, total: None,
) -> Bench:
    """Drive a scope into a colon, then replay its controls in the scene with and without each thing.

    Args:
        colon: the colon.
        wall: its wall of pieces.
        design: the scope.
        seconds: simulated time of a replay [s].
        repeats: how often each pair is timed, alternating; the median counts.
        progress: told after each lever.

    Raises:
        HaustraError: when a replay diverges.
    """
    rows, criteria = [], []
    pairs = levers(colon, wall, design, deepest=SceneOptions.start_depth + ADVANCE * seconds)
    for number, lever in enumerate(pairs):
        row = compare(lever, seconds=seconds, repeats=repeats)
        rows.append(row)
        if lever.use == "left out":
            worst = max(float(row[name]) for name in ("tip_change", "push_change", "wall_change"))
            criteria.append(Criterion(f"Change by leaving out {lever.name}", worst, BOUND, "1", "at most"))
        progress(number + 1, lever.name, len(pairs))
    return Bench(
        name="skip",
        title="Paying only for what a scene needs",
        summary=(
            f"An adult scope is driven for {seconds:g} s into '{colon.name}' by the lumen follower in the scene that "
            "has everything. Its controls are replayed with and without each thing, alternating; gain is the median "
            f"ratio of processor times of {repeats} pairs. Changes: of the tip's last place, and of its path at worst, "
            "over the length inside; and of the peaks of push and wall force.",
        ),
        criteria=tuple(criteria),
        tables=(Table("What is left out", tuple(rows)),),
        machine=machine(),
    )


def compare(lever: Lever, *, seconds: float, repeats: int) -> dict[str, Any]:
    """A row of the table: what a lever gains, and what it changes."""
    names, controls = _drive(lever.whole, seconds, steered=lever.steered)
    models = {"whole": lever.whole.compile(), "gone": lever.gone.compile()}
    count = len(lever.whole.cable.cells)
    runs: dict[str, list[Replay]] = {name: [] for name in models}
    for _ in range(repeats):
        for name, model in models.items():
            shift = count - len((lever.whole if name == "whole" else lever.gone).cable.cells)
            runs[name].append(_replay(model, names, controls, shift=shift, timestep=model.opt.timestep))
    gains = [whole.cost / gone.cost for whole, gone in zip(runs["whole"], runs["gone"], strict=True)]
    whole, gone = runs["whole"][0], runs["gone"][0]
    inside = SceneOptions.start_depth + ADVANCE * seconds
    late = slice(int(_SETTLED / CONTROL_INTERVAL), None)
    return {
        "left_out": lever.name,
        "use": lever.use,
        "dofs_with": models["whole"].nv,
        "dofs_without": models["gone"].nv,
        "cost_with_s_per_s": float(np.median([run.cost for run in runs["whole"]])),
        "cost_without_s_per_s": float(np.median([run.cost for run in runs["gone"]])),
        "gain": float(np.median(gains)),
        "tip_change": float(np.linalg.norm(whole.tip[-1] - gone.tip[-1]) / inside),
        "tip_path_change": float(np.linalg.norm(whole.tip - gone.tip, axis=1).max() / inside),
        "push_change": _relative(whole.push[late], gone.push[late]),
        "wall_change": _relative(whole.wall[late], gone.wall[late]),
    }


def levers(colon: Colon, wall: Wall, design: ScopeDesign, *, deepest: float) -> tuple[Lever, ...]:
    """All of them, each against the scene that a run of that depth gets."""
    options = SceneOptions()
    entry, _ = entry_of(colon)
    near = within_reach(wall, entry, deepest=deepest)

    def scene(chosen: SceneOptions = options, *, edit: Callable[[Scene], None] | None = None, view=False) -> Scene:
        built = build_scene(colon, near, design, chosen, show_lumen=view, deepest=deepest)
        if edit:
            edit(built)
        return built

    shipped = scene()
    whole_shaft = build_scene(colon, near, design, options, show_lumen=False)
    no_friction = replace(options, friction=0.0)
    return (
        Lever("shaft that stays outside", shipped, whole_shaft),
        Lever("wall out of reach", whole_shaft, build_scene(colon, wall, design, options, show_lumen=False)),
        Lever("friction, where none is asked", scene(no_friction), scene(no_friction, edit=_tangents)),
        Lever("contact of the scope with itself", shipped, scene(edit=_self_contact)),
        Lever(
            "several points a pair of hulls",
            shipped,
            scene(edit=_flag(mujoco.mjtDisableBit.mjDSBL_MULTICCD)),
            use="a choice",
        ),
        Lever("islands", shipped, scene(edit=_flag(mujoco.mjtDisableBit.mjDSBL_ISLAND))),
        Lever("sparse matrices", shipped, scene(edit=_sparse)),
        Lever("picture of the lumen", shipped, scene(view=True)),
        Lever("twist, where no torque is asked", scene(replace(options, twist_hinges=0)), shipped, use="kept"),
        Lever("wires, where nothing steers", scene(edit=_no_wires), shipped, steered=False, use="kept"),
    )


def _tangents(scene: Scene) -> None:
    for name in scene.cable.geoms:
        scene.spec.geom(name).condim = 3


def _self_contact(scene: Scene) -> None:
    for name in scene.cable.geoms:
        scene.spec.geom(name).contype = 1


def _sparse(scene: Scene) -> None:
    scene.spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE


def _flag(bit: mujoco.mjtDisableBit) -> Callable[[Scene], None]:
    def clear(scene: Scene) -> None:
        scene.spec.option.disableflags &= ~int(bit)

    return clear


def _no_wires(scene: Scene) -> None:
    spec = scene.spec
    for actuator in [each for each in spec.actuators if each.name.startswith("scope/pull_")]:
        spec.delete(actuator)
    for tendon in list(spec.tendons):
        spec.delete(tendon)


def _drive(scene: Scene, seconds: float, *, steered: bool) -> tuple[list[str], Float[np.ndarray, "records actuators"]]:
    """Names of a scene's actuators, and their controls while the follower drives it."""
    engine = NativeEngine(scene)
    line = scene.colon.centreline
    follower = LumenFollower(line, scene.design, tip_links=scene.cable.tip_links)
    tracker = ArcTracker(line, start=scene.options.start_depth)
    steps = round(CONTROL_INTERVAL / scene.options.timestep)
    rows = []
    for _ in range(round(seconds / CONTROL_INTERVAL)):
        seen = engine.read()
        inputs = follower.act(seen, tracker.update(seen.tip), CONTROL_INTERVAL)
        rate = min(inputs.push_rate, ADVANCE)
        if not engine.step(inputs if steered else Controls(rate, 0.0), steps):
            raise HaustraError("The scene to compare with diverged: choose another colon, design or time.")
        rows.append(engine.data.ctrl.copy())
    names = [engine.model.actuator(number).name for number in range(engine.model.nu)]
    return names, np.array(rows)


def _replay(
    model: mujoco.MjModel, names: Sequence[str], controls: np.ndarray, *, shift: int, timestep: float
) -> Replay:
    """Step a model under controls of a scene that had `shift` more joints at the handle's end."""
    known = {name: column for column, name in enumerate(names)}
    columns = [known[_shifted(model.actuator(number).name, shift)] for number in range(model.nu)]
    data = mujoco.MjData(model)
    steps = round(CONTROL_INTERVAL / timestep)
    push, tip = model.actuator("scope/push").id, model.site("scope/tip").id
    spent, rows = 0.0, []
    for control in controls[:, columns]:
        data.ctrl[:] = control
        began = time.process_time()
        mujoco.mj_step(model, data, steps)
        spent += time.process_time() - began
        pressed = data.contact.efc_address
        normal = data.efc_force[pressed[pressed >= 0]].sum()
        rows.append((*data.site_xpos[tip], data.actuator_force[push], normal))
    found = np.array(rows)
    if not np.isfinite(found).all():
        raise HaustraError("A replay of the controls diverged: choose another colon, design or time.")
    return Replay(spent / (len(controls) * CONTROL_INTERVAL), found[:, :3], found[:, 3], found[:, 4])


def _shifted(name: str, shift: int) -> str:
    if not name.startswith("scope/lock_"):
        return name
    stem, index = name.rsplit("_", 1)
    return f"{stem}_{int(index) + shift:03d}"


def _relative(whole: np.ndarray, gone: np.ndarray) -> float:
    return float(abs(np.abs(whole).max() - np.abs(gone).max()) / max(np.abs(whole).max(), 1e-9))
