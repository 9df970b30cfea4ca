"""Any device natively: a scope behind the common interface, worlds apart, and what is refused by name."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.envs.runs.device_run import common_scores, device_scores, run_device
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import load_device
from haustra.models.devices.capsule.interface import Capsule
from haustra.models.devices.scope.interface import Scope
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, empty_spec
from haustra.models.wall.elasticity import depth_under
from haustra.models.wall.lumen_table import lumen_table
from haustra.models.wall.planes import Sample, add_planes
from haustra.models.wall.table_wall import TableWall
from tests.ring_wall import bent_colon
from tests.tube_colon import straight_tube

SETTLING = 8.0
"""Until a pressed colon creeps no further [s]."""


@pytest.fixture(scope="module")
def tube():
    return straight_tube(0.3)


def scope() -> Scope:
    return Scope(
        name="adult", design=named_design("adult"), shaft_cell=0.0625, bending_cell=0.034, twist_hinges=1, inserted=0.4
    )


def test_a_scope_goes_as_far_as_its_hand_pushes(tube):
    run = run_device(scope(), tube, seconds=2.0)
    assert run.outcome.value == "time_up"
    assert run.records["insertion"][-1] == pytest.approx(0.03 + 2.0 * 0.03, abs=0.003)
    assert run.records["tip_arc"][-1] == pytest.approx(run.records["insertion"][-1], abs=0.003)


def test_worlds_have_conditions_of_their_own_and_one_that_is_lost_stands(tube):
    """Three equal worlds but for friction: the third is told no number, and only it is lost."""
    scene = build_device_scene(scope(), device_options())
    one = NativeDevice(scene, device_tables(scene, [tube]), worlds=3)
    one.reset(np.arange(3), np.zeros(3, int), friction=np.array([0.0, 0.5, 0.1]), wall_stiffness=np.full(3, 1500.0))
    commands = np.zeros((3, len(scene.device.controls)))
    commands[:, 0], commands[:, 2] = 0.05, 10.0
    healthy = np.ones(3, bool)
    for step in range(60):
        if step == 30:
            commands[2, 0] = np.nan
        healthy = one.step(commands, 4)
    assert healthy.tolist() == [True, True, False]
    assert np.isfinite(one.read().tip).all()
    push = one.readings()["push_force"]
    assert push[1] > push[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (SceneOptions(wall_law="table", twist_hinges=2), "do not honour the option twist_hinges"),
        (SceneOptions(wall_law="planes"), "Wall law 'planes' is that of one colon"),
        (SceneOptions(wall_law="table", gravity=(0.0, 0.0, -9.81)), "Gravity needs one colon"),
    ],
)
def test_what_is_not_honoured_is_refused_by_name(options, message):
    with pytest.raises(UnsupportedSceneError, match=message):
        build_device_scene(scope(), options)


def test_worn_wires_are_refused():
    with pytest.raises(UnsupportedSceneError, match=r"has wires\.friction, which"):
        build_device_scene(load_device("adult-worn"))


def pressed_sphere(colon: Colon, *, radius: float, arc: float, force: float, options: SceneOptions) -> np.ndarray:
    """Where the axis of a colon comes to when one sphere of a scope presses on it sideways, by a scope's own wall."""
    spec = empty_spec("sphere", options)
    body = spec.worldbody.add_body(name="ball", pos=[0, 0, arc])
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, damping=[10.0, 0, 0], armature=0.05)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], mass=0.015, contype=0, conaffinity=0)
    samples = (Sample("ball", np.zeros(3), radius),)
    add_planes(spec, spec.compile(), samples, options.contact, timestep=options.timestep, planes=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = force
    table = lumen_table(colon, device_radius=radius, with_mesentery=True)
    wall = TableWall(model, table, options.contact, arcs=np.array([arc]))
    for _ in range(round(SETTLING / options.timestep)):
        wall.update(data)
        wall.step(data)
    assert wall.displacement is not None
    return wall.displacement[:, :3].copy()


class Own(Capsule):
    """A capsule that is softer than the wall."""

    def add_to(self, *args, **options):
        handles = super().add_to(*args, **options)
        return replace(handles, samples=tuple(replace(one, stiffness=40.0) for one in handles.samples))


@pytest.mark.parametrize("own", [False, True])
def test_a_capsule_is_as_deep_in_a_wall_that_stiffens_as_the_law_says(tube, own):
    """Spheres share one load by either law: each is as deep as the inverse of one law says of the other's force.

    Not so spheres with a stiffness of their own: what gives way there is the device, which is linear.
    """
    depth = {}
    capsule = (Own if own else Capsule)(**{**vars(load_device("capsule")), "led_by": "wrench"})
    for name in ("linear", "exponential"):
        options = device_options(capsule, elasticity=name, wall_stiffness=1500.0 if own else 40.0, friction=0.0)
        scene = build_device_scene(capsule, options, pose=pose_in(tube, capsule, options))
        one = NativeDevice(scene, device_tables(scene, [tube]))
        for _ in range(150):
            assert one.step(np.array([[3.0, 0, 0, 0, 0, 0]]), 5).all()
        depth[name] = float(one.read().deepest[0])
    assert depth["linear"] > 3e-3
    known = depth_under("exponential", np.array(40.0 * depth["linear"]), 40.0)
    assert depth["exponential"] == pytest.approx(float(depth["linear"] if own else known), rel=0.01)


@pytest.mark.parametrize("force", [pytest.param(0.3, marks=pytest.mark.thorough), 0.9])
def test_a_pressed_capsule_displaces_the_colon_as_a_scopes_sphere_with_that_force_does(force):
    """Six spheres in one place share the force of one: without friction the axis comes to the same place.

    Within 2 % of the largest displacement, all along the colon; friction would hold both where they first stuck.
    """
    tube = straight_tube(0.4)
    tube = replace(tube, segments=(ColonSegment("rectum", 0.0, 0.05), ColonSegment("sigmoid", 0.05, 0.4)))
    found = load_device("capsule")
    assert isinstance(found, Capsule)
    own = {"led_by": "wrench", "tether_friction": 0.0, "tether_held": 0.0}
    ball = replace(found, length=0.0122, diameter=0.012, turning_drag=0.1, **own)
    options = device_options(mesentery=True, start_depth=0.206, friction=0.0)
    scene = build_device_scene(ball, options, pose=pose_in(tube, ball, options))
    one = NativeDevice(scene, device_tables(scene, [tube]))
    for _ in range(round(SETTLING / 0.02)):
        assert one.step(np.array([[force, 0, 0, 0, 0, 0]]), 4).all()
    assert one.displacement is not None
    found = one.displacement[0, :, :3]
    assert one.read().wall_force[0] == pytest.approx(force, rel=0.005)
    expected = pressed_sphere(tube, radius=0.006, arc=0.2, force=force, options=options)
    largest = np.linalg.norm(expected, axis=1).max()
    assert largest > 0.01
    assert np.linalg.norm(found - expected, axis=1).max() < 0.02 * largest


@pytest.mark.parametrize("stiffness", [1500.0, 2400.0])
def test_a_colon_is_pressed_by_what_presses_back_while_both_move(stiffness):
    """Newton's third law on a capsule without mass to speak of: F = sum of the wall's forces + drag v, within 2 %.

    Each of its six spheres presses less hard than the contact's damper would at the speed at which the wall gives way.
    """
    tube = replace(straight_tube(0.4), segments=(ColonSegment("sigmoid", 0.0, 0.4),))
    ball = load_device("capsule")
    assert isinstance(ball, Capsule)
    ball = replace(ball, led_by="wrench", tether_held=0.0)
    options = device_options(mesentery=True, start_depth=0.2, friction=0.0, wall_stiffness=stiffness)
    scene = build_device_scene(ball, options, pose=pose_in(tube, ball, options))
    one = NativeDevice(scene, device_tables(scene, [tube]))
    for _ in range(120):
        assert one.step(np.array([[0.6, 0, 0, 0, 0, 0]]), 1).all()
    assert one.readings()["speed"][0] > 3e-3
    drag = ball.drag * one.readings()["speed"][0]
    assert one.read().wall_force[0] == pytest.approx(0.6 - drag, rel=0.02)


def test_worlds_rub_whose_scene_does_not(tube):
    """A pull along a wall that it is pressed on: friction slows one of two capsules in a scene without any."""
    ball = load_device("capsule")
    assert isinstance(ball, Capsule)
    ball = replace(ball, led_by="wrench")
    scene = build_device_scene(ball, device_options(friction=0.0))
    one = NativeDevice(scene, device_tables(scene, [tube]), worlds=2)
    one.reset(np.arange(2), np.zeros(2, int), friction=np.array([0.0, 0.5]), wall_stiffness=np.full(2, 1500.0))
    for step in range(100):
        one.step(np.tile([0.5, 0.0, 0.3 if step > 60 else 0.0, 0, 0, 0], (2, 1)), 4)
    arcs = one.read().tip_arc
    assert arcs[1] < arcs[0] - 0.005


def test_a_capsule_drives_through_a_colon_that_moves_and_the_run_says_so():
    bend = replace(bent_colon(bend=0.05, leg=0.06, length=0.25), segments=(ColonSegment("sigmoid", 0.0, 0.25),))
    runs = {}
    for moves in (False, True):
        run = run_device(load_device("capsule"), bend, device_options(mesentery=moves), seconds=4.0)
        assert run.outcome is not Outcome.DIVERGED
        scores = device_scores(run, bend)
        assert scores["mesentery"] is moves and ("mesentery" in scores["not_modelled"]) is not moves
        assert np.array_equal(run.colon.lumen.vertices, bend.lumen.vertices) is not moves
        runs[moves] = scores["wall_force_peak_N"], run.records["tip_arc"][-1]
    assert runs[True] != runs[False] and runs[True][1] > 0.05


@pytest.mark.parametrize(("outcome", "torn"), [(Outcome.TIME_UP, False), (Outcome.ESCAPED, True)])
def test_any_device_tells_how_likely_it_tears_the_wall(outcome: Outcome, torn: bool):
    """A straight head of 13.2 mm tears half of people at 14.1 N times human over porcine; an escape tears all."""
    colon = replace(bent_colon(bend=0.05, leg=0.06, length=0.25), segments=(ColonSegment("sigmoid", 0.0, 0.25),))
    forces = np.array([1.0, 1.5 * 14.1, 3.0])
    records = {"time": np.arange(3.0), "tip_arc": np.array([0.05, 0.1, 0.15]), "wall_force": forces, "deepest": forces}
    found = common_scores(outcome, records, (), colon, 0.0066)
    assert found["p_perforation"] == pytest.approx(1.0 if torn else 0.5)
    assert found["perforation_arc_m"] == pytest.approx(0.15 if torn else 0.1)
    assert found["perforation_site"] == "sigmoid"
