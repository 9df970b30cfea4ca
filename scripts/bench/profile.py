"""Where the time of a step goes: MuJoCo's own timers, and the work around it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco

from haustra.envs.control.follower import FollowerSettings, LumenFollower
from haustra.envs.runs.insertion import CONTROL_INTERVAL, run_insertion
from haustra.envs.runs.measure.containment import Containment
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.sim.growing import growing
from haustra.envs.sim.native import NativeEngine
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.law import PadLaw, load_table
from haustra.models.devices.tracked.rig import flat_rig, tube_rig
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.lumen_table import lumen_table
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.machine import machine
from haustra.scripts.bench.result import Bench, Table, Value

STAGES = {
    "kinematics": "POS_KINEMATICS",
    "inertia": "POS_INERTIA",
    "collision, broad": "COL_BROAD",
    "collision, narrow": "COL_NARROW",
    "constraint rows": "POS_MAKE",
    "velocity": "VELOCITY",
    "actuation": "ACTUATION",
    "constraint solver": "CONSTRAINT",
    "integration": "ADVANCE",
}
"""Stages of a step, by the name of MuJoCo's timer."""

_SPEED = 32.5e-3
"""Speed of the tracked robot's treads [m/s]."""

Progress = Callable[[str], None]


def bench_profile(
    colon: Colon,
    wall: Wall,
    design: ScopeDesign,
    *,
    before: float,
    seconds: float,
    progress: Progress = lambda note: None,
) -> Bench:
    """Profile the standard scenes.

    Args:
        colon: the colon.
        wall: its wall of pieces.
        design: the scope.
        before: simulated time of insertion before anything is timed [s].
        seconds: simulated time that is timed [s].
        progress: told what is being profiled.
    """
    rows, around = [], []
    scenes = {"scope, pieces": (SceneOptions(), wall), "scope, planes": (SceneOptions(wall_law="planes"), None)}
    for name, (options, pieces) in scenes.items():
        progress(name)
        deepest = options.start_depth + FollowerSettings.advance_rate * (before + seconds)
        scene = build_scene(colon, pieces, design, options, show_lumen=False, deepest=deepest)
        row, outside = _insertion(scene, before, seconds)
        rows.append({"scene": name} | row)
        around.append({"scene": name} | outside)
    progress("tracked robot")
    tracked = TrackedDesign()
    law = PadLaw.fit(load_table(tracked.tread))
    track = flat_rig(tracked, friction=0.4, indentation=law.indentation(tracked.bellows.preload / 2))
    for name, rig in (("tracked, one track", track), ("tracked, whole", tube_rig(tracked, friction=0.4))):
        model = rig.spec.compile()
        rig.tracked.set_speed(model, _SPEED)
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 500)
        rows.append({"scene": name} | _timed(model, data, lambda m=model, d=data: mujoco.mj_step(m, d, 2000)))
    progress("defaults")
    whole = _at_the_defaults(colon, design, before + seconds)
    return Bench(
        name="profile",
        title="Where the time goes",
        summary=(
            f"MuJoCo's own timers, over {seconds:g} s of an insertion into '{colon.name}' by the lumen follower after "
            f"{before:g} s, and over 2,000 steps of the tracked robot. Times are wall clock on one core, in "
            "microseconds a step; 'timers' is what reading the clock costs, left in.",
        ),
        tables=(
            Table("A step, by stage", tuple(rows)),
            Table("A control interval of a run, 20 ms", tuple(around), "What goes on around the steps, by part."),
            Table(
                "A run at the defaults", (whole,), "On its mesentery, by the table, from the first step to the last."
            ),
        ),
        machine=machine(),
    )


def _insertion(scene: Scene, before: float, seconds: float) -> tuple[dict[str, Value], dict[str, Value]]:
    """Stages of a step, and parts of a control interval, of a driven scope."""
    engine = NativeEngine(scene)
    line = scene.colon.centreline
    follower = LumenFollower(line, scene.design, tip_links=scene.cable.tip_links)
    tracker = ArcTracker(line, start=scene.options.start_depth)
    containment = Containment(scene.colon, radius=scene.cable.radius)
    steps = round(CONTROL_INTERVAL / scene.options.timestep)
    spent: dict[str, float] = {}

    @contextmanager
    def part(name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        spent[name] = spent.get(name, 0.0) + time.perf_counter() - began

    def drive(duration: float) -> None:
        for _ in range(round(duration / CONTROL_INTERVAL)):
            with part("observe"):
                seen = engine.read()
            with part("follow"):
                inputs = follower.act(seen, tracker.update(seen.tip), CONTROL_INTERVAL)
            with part("step"):
                engine.step(inputs, steps)
            with part("containment"):
                behind = scene.cable.node_distances
                inside = behind < seen.insertion
                containment.outside(engine.shape()[inside], behind[inside], tracker.arc)

    drive(before)
    spent.clear()
    row = _timed(engine.model, engine.data, lambda: drive(seconds))
    intervals = round(seconds / CONTROL_INTERVAL)
    around: dict[str, Value] = {f"{name}_us": value / intervals * 1e6 for name, value in spent.items()}
    return row, around


def _at_the_defaults(colon: Colon, design: ScopeDesign, seconds: float) -> dict[str, Value]:
    """Simulated over processor time of a run as `haustra run` does it: what else runs on the machine hardly counts."""
    options, settings = SceneOptions(wall_law="table", mesentery=True), FollowerSettings(straighten=True)
    deepest = options.start_depth + settings.advance_rate * seconds
    scene = build_scene(colon, None, design, options, show_lumen=False, deepest=deepest)
    table = lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True)
    backend = growing(None, deepest=deepest, table=table)(scene)  # what is compiled is compiled now
    began = time.process_time()
    run = run_insertion(scene, seconds=seconds, settings=settings, backend=lambda _: backend)
    used, simulated = time.process_time() - began, float(run.trajectory.time[-1])
    return {
        "outcome": run.outcome.value,
        "simulated_s": simulated,
        "processor_s": used,
        "real_time_factor": simulated / used,
        "contacts_mean": float(run.trajectory.contacts.mean()),
    }


def _timed(model: mujoco.MjModel, data: mujoco.MjData, work: Callable[[], Any]) -> dict[str, Value]:
    """Microseconds a step, by stage, while that work is done."""
    for timer in data.timer:
        timer.duration, timer.number = 0.0, 0
    work()
    steps = data.timer[mujoco.mjtTimer.mjTIMER_STEP].number

    def of(timer: str) -> float:
        # MuJoCo for Python counts in seconds.
        return data.timer[getattr(mujoco.mjtTimer, f"mjTIMER_{timer}")].duration / steps * 1e6

    row: dict[str, Value] = {"dofs": model.nv, "contacts": int(data.ncon), "step_us": of("STEP")}
    row |= {f"{stage.replace(', ', '_').replace(' ', '_')}_us": of(timer) for stage, timer in STAGES.items()}
    return row
