"""Every field of scenes, designs and tasks on every backend: its effect is the native one, or it is refused.

A scope is pushed round a bend, turned and steered. The effect of a field is how the means of what is read off over the
run change with it. Backends of many worlds meet the wall's table, the native backend its tangent planes, one sphere
against two planes: effects agree within `TOLERANCE` of their size.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.sim.capabilities import (
    BACKENDS,
    CAMERA,
    CAPABILITIES,
    MANY_WORLDS,
    SCENE,
    require_supported,
    require_task_supported,
)
from haustra.envs.sim.capabilities import DESIGN as DESIGN_TABLE
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend, batch_model
from haustra.envs.sim.state import Controls
from haustra.envs.tasks.config import TaskConfig
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import ColonSegment, Surface
from haustra.models.device_scene import HONOURED
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import ANGLES, Tables, lumen_table, stack
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube, wedge_wall

TOLERANCE, AT_THE_WALL_TOLERANCE = 0.1, 0.3
"""Tolerances relative to the size of an effect [1]; spheres at two planes each, and at a table, touch differently."""
LEAST = 3e-3
"""Size of the smallest effect that counts as one, in units of `SCALES`."""
FLOOR, SINGLE_FLOOR = 2e-3, 1e-2
"""By which effects may differ in any case, in units of `SCALES`: linear time computes in single precision, and reads
the hand's force at the end of a step."""
SCALES = np.array([0.01, 0.01, 0.01, 0.3, 0.3, 3.0, 0.01, 3.0, 0.01])
"""Tip [m], bend [rad], push [N], torque [N m], wall [N], insertion [m]."""
SECONDS, LOOK = 0.6, 0.04
"""Duration of a run, twice that at the wall; and time between two looks [s]."""
PULLS = np.array([10.0, 5.0, 0.0, 0.0])
PUSH, ROLL = 0.06, 0.4

BEND = replace(
    swept_colon(winding([(0.06, 0.0), (0.06, 1.0), (0.12, 0.0)]), name="bend"),
    segments=(ColonSegment("rectum", 0.0, 0.04), ColonSegment("sigmoid", 0.04, 0.24)),
)
OPEN = replace(
    straight_tube(0.4),
    lumen=Surface(straight_tube(0.4).lumen.vertices * [3, 3, 1], straight_tube(0.4).lumen.faces),
    radius=3 * straight_tube(0.4).radius,
)
"""So wide that no scope meets its wall."""
NO_WALL = replace(wedge_wall(), pieces=())
AT_THE_WALL = {"wall_stiffness", "segment_stiffness", "wall_damping_time", "sample_spacing", "friction", "diameter"}
"""Fields that count where there is contact: a scope in a bend; for the others it stands free under its weight."""
OPTIONS = SceneOptions(
    insertion_limit=0.31,
    shaft_cell=0.0625,
    bending_cell=0.034,
    wall_law="planes",
    sample_spacing=0.02,
    twist_hinges=2,
    friction=0.1,
    start_depth=0.06,
    wall_stiffness=1500.0,
)
SHIPPED = named_design("adult")
DESIGN = replace(
    SHIPPED,
    shaft=(replace(SHIPPED.shaft[0], stiffening=1.5, bias_up_deg=30.0),),
    bending=replace(SHIPPED.bending, stiffening=1.5),
    variable_stiffness=0.5,
)

SCENE_CHANGES: Mapping[str, Any] = {
    "timestep": 0.0025,
    "shaft_cell": 0.03,
    "largest_bend_deg": 5.0,
    "bending_cell": 0.017,
    "twist_hinges": 0,
    "wall_stiffness": 500.0,
    "segment_stiffness": (("sigmoid", 300.0),),
    "wall_damping_time": 0.05,
    "sample_spacing": 0.04,
    "friction": 0.3,
    "push_limit": 0.3,
    "torque_limit": 5e-4,
    "start_depth": 0.14,
    "insertion_limit": 0.2,
    "gravity": (5.0, -6.0, 2.0),
}
"""A value of each field that has an effect; 'wall_law', 'mesentery', 'abdomen', 'softening' have their own tests."""
DESIGN_CHANGES: Mapping[str, Callable[[ScopeDesign], ScopeDesign]] = {
    "diameter": lambda d: replace(d, diameter=0.0145),
    "mass_per_length": lambda d: replace(d, mass_per_length=10 * d.mass_per_length),
    "relaxation_time": lambda d: replace(d, relaxation_time=5 * d.relaxation_time),
    "variable_stiffness": lambda d: replace(d, variable_stiffness=1.0),
    "temperature_factor_bending": lambda d: replace(d, temperature_factor_bending=0.6),
    "temperature_factor_torsion": lambda d: replace(d, temperature_factor_torsion=0.1),
    "shaft.length": lambda d: _shaft(d, length=0.08),
    "shaft.flexural_rigidity": lambda d: _shaft(d, flexural_rigidity=0.02),
    "shaft.torsional_rigidity": lambda d: _shaft(d, torsional_rigidity=0.02),
    "shaft.stiffening": lambda d: _shaft(d, stiffening=3.0),
    "shaft.minimum_bend_radius": lambda d: _shaft(d, minimum_bend_radius=2.9),
    "shaft.bias_up_deg": lambda d: _shaft(d, bias_up_deg=60.0),
    "shaft.bias_left_deg": lambda d: _shaft(d, bias_left_deg=60.0),
    "bending.length": lambda d: _bending(d, length=1.1 * d.bending.length),
    "bending.flexural_rigidity": lambda d: _bending(d, flexural_rigidity=0.6 * d.bending.flexural_rigidity),
    "bending.torsional_rigidity": lambda d: _bending(d, torsional_rigidity=0.005),
    "bending.stiffening": lambda d: _bending(d, stiffening=3.0),
    "bending.minimum_bend_radius": lambda d: _bending(d, minimum_bend_radius=0.5),
    "bending.bias_up_deg": lambda d: _bending(d, bias_up_deg=20.0),
    "bending.bias_left_deg": lambda d: _bending(d, bias_left_deg=20.0),
    "limits.up": lambda d: replace(d, limits=replace(d.limits, up=10.0)),
    "limits.left": lambda d: replace(d, limits=replace(d.limits, left=5.0)),
    "limits.down": lambda d: replace(d, limits=replace(d.limits, down=10.0)),
    "limits.right": lambda d: replace(d, limits=replace(d.limits, right=5.0)),
    "wires.routing_radius": lambda d: _wires(d, routing_radius=0.8 * d.wires.routing_radius),
    "wires.pull_limit": lambda d: _wires(d, pull_limit=4.0),
    "wires.friction": lambda d: _wires(d, friction=3.0),
    "wires.hysteresis": lambda d: _wires(d, hysteresis=0.3),
    "tip.length": lambda d: replace(d, tip=replace(d.tip, length=1.5 * d.tip.length)),
}
"""Designs in which one field has an effect."""
NO_EFFECT = {"name", "working_length", "wires.slack", "wires.compliance", "tip.field_of_view_deg", "tip.lens"}
"""Fields of designs without an effect on motion under pulls; `CAPABILITIES` says where they count."""


def _shaft(design: ScopeDesign, **changed: Any) -> ScopeDesign:
    return replace(design, shaft=(replace(design.shaft[0], **changed),))


def _bending(design: ScopeDesign, **changed: Any) -> ScopeDesign:
    return replace(design, bending=replace(design.bending, **changed))


def _wires(design: ScopeDesign, **changed: Any) -> ScopeDesign:
    return replace(design, wires=replace(design.wires, **changed))


def _case(path: str) -> tuple[ScopeDesign, SceneOptions]:
    room, _, name = path.partition(".")
    if room == "scene":
        return DESIGN, replace(_options(path), **{name: SCENE_CHANGES[name]})
    return DESIGN_CHANGES[name](DESIGN), _options(path)


def _options(path: str) -> SceneOptions:
    return (
        OPTIONS
        if _at_the_wall(path)
        else replace(OPTIONS, gravity=(0.0, -3.0, 0.0), start_depth=0.13, insertion_limit=0.24)
    )


def _at_the_wall(path: str) -> bool:
    return path.rpartition(".")[2] in AT_THE_WALL


def _seconds(path: str) -> float:
    return 2 * SECONDS if _at_the_wall(path) else SECONDS


def _scene(design: ScopeDesign, options: SceneOptions, path: str, *, many: bool) -> Scene:
    wall = _at_the_wall(path)
    law = "table" if many else "planes" if wall else "pieces"
    options = replace(options, wall_law=law, softening=not many)
    return build_scene(BEND if wall else OPEN, NO_WALL, design, options, show_lumen=False)


PATHS = [f"scene.{name}" for name in SCENE_CHANGES] + [f"design.{name}" for name in DESIGN_CHANGES]


@cache
def _tables(at_the_wall: bool, radius: float) -> Tables:
    colon = BEND if at_the_wall else OPEN
    tables = lumen_table(colon, device_radius=radius).seen_from(*entry_of(colon))
    if not at_the_wall:  # without the ends of the tube
        wall = tables.wall.copy()
        turn = 2 * np.pi * np.arange(ANGLES) / ANGLES
        wall[...] = np.column_stack([np.full(ANGLES, 1.0), -np.cos(turn), -np.sin(turn), 0 * turn])
        tables = tables._replace(wall=wall)
    return stack([tables])


def _pulls(time: float, path: str) -> np.ndarray:
    """Pulls of the wires [N]: against the stop that is asked for; eased at the end, which friction resists."""
    pulls = np.roll(PULLS, 2) if path.endswith(("down", "right")) else PULLS
    return pulls if time < 0.75 * _seconds(path) else 0.8 * pulls


def _native(design: ScopeDesign, options: SceneOptions, path: str) -> np.ndarray:
    backend, rows = NativeEngine(_scene(design, options, path, many=False)), []
    axes = entry_of(backend.scene.colon)[1]
    for look in range(round(_seconds(path) / LOOK)):
        backend.step(Controls(PUSH, ROLL, _pulls(look * LOOK, path)), round(LOOK / options.timestep))
        seen = backend.read()
        tip = axes.T @ (seen.tip - backend.scene.entry)
        rows.append([*tip, *seen.bend, seen.push_force, seen.torque, seen.link_forces.sum(), seen.insertion])
    return np.mean(rows, axis=0) / SCALES


def _native_batch(design: ScopeDesign, options: SceneOptions, path: str) -> np.ndarray:
    return _batch(NativeBackend, design, options, path)


def _linear(design: ScopeDesign, options: SceneOptions, path: str) -> np.ndarray:
    return _batch(LinearBackend, design, options, path)


def _batch(kind: Any, design: ScopeDesign, options: SceneOptions, path: str) -> np.ndarray:
    scene, tables = _scene(design, options, path, many=True), _tables(_at_the_wall(path), design.diameter / 2)
    batch, rows = kind(scene, tables, worlds=1), []
    own = (np.array([options.friction]), np.array([options.wall_stiffness]), np.ones(1))
    batch.reset(np.zeros(1, int), np.zeros(1, int), Conditions(*own))
    for look in range(round(_seconds(path) / LOOK)):
        asked = Controls(np.array([PUSH]), np.array([ROLL]), _pulls(look * LOOK, path)[None])
        batch.step(asked, round(LOOK / options.timestep))
        rows.append(_row(batch.read()))
    return np.mean(rows, axis=0)[0] / SCALES


def _row(seen: Any) -> np.ndarray:
    """What is read off of each world of a batch."""
    forces = np.asarray(seen.link_forces).sum(axis=1)
    rest = (seen.push_force, seen.torque, forces, seen.insertion)
    return np.column_stack([seen.tip, seen.bend, *rest]).astype(float)


def _effect(run: Callable, path: str) -> np.ndarray:
    """How what is read off changes with a field."""
    side = "down" if path.endswith(("down", "right")) else "up"
    return run(*_case(path), path) - _base(run, f"{'friction' if _at_the_wall(path) else ''}.{side}")


@cache
def _base(run: Callable, like: str) -> np.ndarray:
    path = "scene.friction" if like.startswith("friction") else f"design.limits.{like[1:]}"
    return run(DESIGN, _options(path), path)


@cache
def _known(path: str) -> np.ndarray:
    """The effect on the native backend, which every field but labels has."""
    return _effect(_native, path)


def _require_same(path: str, effect: np.ndarray, floor: float = FLOOR) -> None:
    known = _known(path)
    share = AT_THE_WALL_TOLERANCE if _at_the_wall(path) else TOLERANCE
    if path == "scene.wall_damping_time":  # batches read K (d + t d'), the backend what its solver found
        share, effect, known = 0.9, np.delete(effect, 7), np.delete(known, 7)
    apart = np.linalg.norm(effect - known)
    assert apart < share * np.linalg.norm(known) + floor, f"{np.round(effect, 3)} instead of {np.round(known, 3)}"


def _entry(path: str) -> Any:
    return next(each for each in CAPABILITIES if each.path == path)


def _refused(path: str, backend: str) -> bool:
    return not _entry(path).honoured(backend, SCENE_CHANGES.get(path.removeprefix("scene.")))


@pytest.mark.parametrize("path", PATHS)
def test_the_native_backend_honours_it(path: str) -> None:
    assert np.linalg.norm(_known(path)) > LEAST


@pytest.mark.parametrize("path", [path for path in PATHS if not _refused(path, "native-batch")])
def test_the_native_batch_does_the_same(path: str) -> None:
    _require_same(path, _effect(_native_batch, path))


@pytest.mark.parametrize("path", [path for path in PATHS if not _refused(path, "linear")])
def test_linear_time_does_the_same(path: str) -> None:
    # Half the step takes half the error from either integrator, MuJoCo's and the chain's: 0.03 of the tip's scale.
    _require_same(path, _effect(_linear, path), 2 * SINGLE_FLOOR if path == "scene.timestep" else SINGLE_FLOOR)


@pytest.mark.parametrize("path", [path for path in PATHS if not _refused(path, "warp")])
def test_warp_steps_the_same_model_as_the_native_batch(path: str) -> None:
    """Each design has a batch of its own there, of the native batch's own model but for solver and flags."""
    pytest.importorskip("warp")
    from haustra.envs.sim.warp_planes import for_warp

    scene = _scene(*_case(path), path, many=True)
    own, known = for_warp(batch_model(scene)), batch_model(scene)
    for name in (
        "body_mass",
        "jnt_stiffness",
        "jnt_range",
        "dof_damping",
        "wrap_prm",
        "actuator_ctrlrange",
        "qpos_spring",
    ):
        np.testing.assert_array_equal(getattr(own, name), getattr(known, name))
    require_supported(scene, "warp")


REFUSALS = {
    "scene.segment_stiffness": replace(OPTIONS, segment_stiffness=(("sigmoid", 300.0),)),
    "scene.wall_law": OPTIONS,
    "scene.mesentery": replace(OPTIONS, wall_law="table", mesentery=True, softening=False),
    "scene.abdomen.posture": replace(
        OPTIONS, wall_law="table", mesentery=True, softening=False, abdomen=Abdomen(posture="left")
    ),
    "scene.abdomen.loops_touch": replace(
        OPTIONS, wall_law="table", mesentery=True, softening=False, abdomen=Abdomen(loops_touch=True)
    ),
    "scene.softening": replace(OPTIONS, wall_law="table"),
    "scene.gas": replace(OPTIONS, wall_law="table", softening=False, gas=3333.0),
    "scene.water": replace(OPTIONS, wall_law="table", softening=False, gas=3333.0, water=1e-5),
    "scene.elasticity": replace(OPTIONS, wall_law="table", softening=False, elasticity="exponential"),
    "scene.friction_rise": replace(OPTIONS, wall_law="table", softening=False, friction_rise=0.78),
}
AROUND = {
    f"scene.abdomen.{name}"
    for name in ("mobile", "adhesions", "pressed", "hand", "rooted", "envelope", "breathing", "torsion")
}
"""Fields of the patient around a colon that moves: `test_moving_native.py` beside this one."""
WITH_GAS = {"scene.gas_flow", "scene.gas_start"}
"""Fields that count with gas: `test_gas.py` beside this one."""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("path", REFUSALS)
def test_what_a_backend_cannot_honour_of_a_scene_it_refuses_by_name(path: str, backend: str) -> None:
    scene = build_scene(BEND, None, DESIGN, REFUSALS[path], show_lumen=False)
    value = attrgetter(path.removeprefix("scene."))(scene.options)
    if _entry(path).honoured(backend, value):
        require_supported(scene, backend)
        return
    others = [other for other in BACKENDS if _entry(path).honoured(other, value)]
    make = {
        "native": lambda: NativeEngine(scene),
        "native-batch": lambda: NativeBackend(scene, _tables(True, DESIGN.diameter / 2), worlds=1),
    }.get(backend, lambda: require_supported(scene, backend))
    with pytest.raises(UnsupportedSceneError, match=f"'{backend}' cannot honour scene") as refusal:
        make()
    assert all(other in str(refusal.value) for other in others)


@pytest.mark.parametrize("entry", CAMERA, ids=lambda entry: entry.path)
@pytest.mark.parametrize("backend", MANY_WORLDS)
def test_a_camera_that_tasks_cannot_show_is_refused_by_them(entry: Any, backend: str) -> None:
    name = entry.path.removeprefix("design.tip.")
    design = replace(DESIGN, tip=replace(DESIGN.tip, **{name: 0.001 if "offset" in name else 0.5}))
    scene = build_scene(OPEN, None, design, replace(OPTIONS, wall_law="table", softening=False), show_lumen=False)
    with pytest.raises(UnsupportedSceneError, match=name):
        require_task_supported(TaskConfig(), scene.design, backend)
    base = build_scene(OPEN, None, DESIGN, replace(OPTIONS, wall_law="table", softening=False), show_lumen=False)
    drawn, usual = scene.compile(), base.compile()
    parts = ("cam_pos", "cam_quat", "light_diffuse", "light_dir")
    assert any(not np.allclose(getattr(drawn, part), getattr(usual, part)) for part in parts)


@pytest.mark.parametrize(
    ("backend", "changed"),
    [
        ("warp", {"task": "withdrawal"}),
        *((backend, {"water": 1e-4, "gas": 3333.0}) for backend in ("native-batch", "warp")),
        *((backend, {"gas": 3333.0}) for backend in ("native-batch", "warp")),
    ],
)
def test_what_a_backend_cannot_honour_of_a_task_it_refuses_by_name(backend: str, changed: dict) -> None:
    options = replace(OPTIONS, wall_law="table", softening=False)
    scene = build_scene(OPEN, None, DESIGN, options, show_lumen=False)
    with pytest.raises(UnsupportedSceneError, match=f"'{backend}' cannot honour task.{next(iter(changed))}"):
        require_task_supported(TaskConfig(**changed), scene.design, backend)


@pytest.mark.parametrize("make", [NativeEngine, LinearSingle])
def test_wires_slack_and_stretch_count_where_wheels_steer(make) -> None:
    bends = []
    for changed in ({}, {"slack": 0.002}, {"compliance": 3 * DESIGN.wires.compliance}):
        design = _wires(DESIGN, **changed)
        backend = make(_scene(design, _options("design.name"), "design.name", many=make is LinearSingle))
        backend.step(Controls(0.0, 0.0, wheels=np.array([0.006, 0.0])), 60)
        bends.append(backend.read().bend[0])
    assert bends[1] < 0.95 * bends[0]
    assert bends[2] < 0.95 * bends[0]


def test_the_follower_in_jax_refuses_wheels() -> None:
    pytest.importorskip("jax")
    from haustra.envs.control.follower_worlds import WorldsFollower

    with pytest.raises(InvalidOptionError, match="wheels"):
        WorldsFollower(FollowerSettings(steer="wheels"), 2)


def test_no_field_is_missing_from_the_table_and_none_has_gone() -> None:
    named = {entry.path for entry in CAPABILITIES}
    assert len(named) == len(CAPABILITIES)
    design = _names(ScopeDesign, DESIGN, "design.")
    asked = _names(SceneOptions, SceneOptions(), "scene.") | design | _names(TaskConfig, TaskConfig(), "task.")
    inner = {path for path in asked if path.startswith("task.randomisation.")}
    asked |= _names(TrackedDesign, TrackedDesign(), "tracked.")
    asked |= {f"device.{name}" for name in (*HONOURED, "abdomen.loops_touch")}
    asked = (asked - inner) | {path.removeprefix("task.") for path in inner} | {"task.randomisation"}
    assert named == asked


def test_every_field_has_a_value_to_test_it_with() -> None:
    tested = {
        *PATHS,
        *REFUSALS,
        *AROUND,
        *WITH_GAS,
        *(entry.path for entry in CAMERA),
        *(f"design.{name}" for name in NO_EFFECT),
    }
    assert {entry.path for entry in (*SCENE, *DESIGN_TABLE, *CAMERA)} == tested


def _names(kind: Any, value: Any, prefix: str) -> set[str]:
    """Paths of all fields of a dataclass and its parts; a tuple of parts counts as one."""
    found = set()
    for entry in fields(kind):
        part = getattr(value, entry.name)
        part = part[0] if isinstance(part, tuple) and part and is_dataclass(part[0]) else part
        if is_dataclass(part):
            found |= _names(type(part), part, f"{prefix}{entry.name}.")
        else:
            found.add(f"{prefix}{entry.name}")
    return found
