"""Any device meets tangent planes and pieces, fixed or on the mesentery, as it meets the table of the lumen."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import load_device
from haustra.models.devices.capsule.interface import Capsule
from haustra.models.devices.tracked.interface import TrackedRobot
from tests.ring_wall import bent_colon, ring_wall
from tests.tube_colon import straight_tube, wedge_wall

TUBE = replace(straight_tube(0.3), segments=(ColonSegment("rectum", 0.0, 0.03), ColonSegment("sigmoid", 0.03, 0.3)))
WALL = wedge_wall(0.3, sectors=48)
PRESS = 0.6 * np.array([np.cos(np.pi / 48), np.sin(np.pi / 48)])
"""Onto the middle of one of the flat sides that the round tube is made of [N]."""
TRACKED = load_device("tracked")
FITTING = bent_colon(bend=0.06, leg=0.11, length=0.36, radius=0.017)


def placed(device, law: str, *, colon=TUBE, wall=WALL, **changed) -> NativeDevice:
    options = device_options(device, wall_law=law, **changed)
    scene = build_device_scene(device, options, pose=pose_in(colon, device, options), colon=colon, wall=wall)
    return NativeDevice(scene, device_tables(scene, [colon]))


def capsule() -> Capsule:
    found = load_device("capsule")
    assert isinstance(found, Capsule)
    return replace(found, led_by="wrench", tether_held=0.0)


@cache
def pressed(law: str, *, intervals: int, friction: float, mesentery: bool = False) -> tuple[NativeDevice, float]:
    """A capsule that is pressed on the wall, and after half the time drawn along it, too; its mean force then [N]."""
    one, forces = placed(capsule(), law, mesentery=mesentery, start_depth=0.15, friction=friction), []
    for interval in range(intervals):
        assert one.step(np.array([[*PRESS, 0.1 if 2 * interval > intervals else 0.0, 0, 0, 0]]), 4).all()
        forces.append(one.read().wall_force[0])
    return one, float(np.mean(forces[intervals // 2 :]))


@pytest.mark.parametrize("law", ["planes", "pieces"])
def test_a_capsule_is_pressed_and_rubbed_as_by_the_table(law: str) -> None:
    """Force and depth within 2 % and 0.05 mm; drawn by 0.1 N against 0.06 N of friction, its way within 2 %.

    The table tells K d of what slides, which MuJoCo's cones press 0.01 N harder (`law.SLIP_RELAXATION`).
    """
    (found, force), (known, expected) = (pressed(each, intervals=80, friction=0.1) for each in (law, "table"))
    seen, wanted = found.read(), known.read()
    assert force == pytest.approx(expected, rel=0.02)
    assert seen.deepest == pytest.approx(wanted.deepest, abs=5e-5)
    assert wanted.tip_arc[0] > 0.152
    assert seen.tip_arc - 0.15 == pytest.approx(wanted.tip_arc - 0.15, rel=0.02)
    assert seen.tip[0, 0] == pytest.approx(wanted.tip[0, 0], abs=1e-4)


@pytest.mark.parametrize("law", ["planes", "pieces"])
def test_on_the_mesentery_a_capsule_moves_the_wall_as_it_moves_the_table(law: str) -> None:
    """While it gives way and after: the axis within 1 % of the largest displacement, mean force within 1 %.

    It gives way at 30 mm/s at first, by three times the contacts' depth in c / K + h: their damper must be weaker.
    """
    (found, force), (known, expected) = (
        pressed(each, intervals=80, friction=0.0, mesentery=True) for each in (law, "table")
    )
    assert found.displacement is not None and known.displacement is not None
    way, wanted = found.displacement[0, :, :3], known.displacement[0, :, :3]
    largest = np.linalg.norm(wanted, axis=1).max()
    assert largest > 0.007
    assert np.linalg.norm(way - wanted, axis=1).max() < 0.01 * largest
    assert force == pytest.approx(expected, rel=0.01)
    assert not known.mocap()[0].size
    if law == "planes":
        return
    places, _ = found.mocap()
    assert np.linalg.norm(places - found.scene.blocks.places, axis=1).max() == pytest.approx(largest, rel=0.1)


class Rough(Capsule):
    """A capsule that rubs by a coefficient of its own."""

    def add_to(self, *args, **options):
        handles = super().add_to(*args, **options)
        return replace(handles, samples=tuple(replace(one, friction=0.3) for one in handles.samples))


def test_what_rubs_by_a_coefficient_of_its_own_drags_the_axis_along() -> None:
    """On a wall without friction: by planes as by the table, within a fifth of the way along the tube."""
    ways = {}
    for law in ("planes", "table"):
        one = placed(Rough(**vars(capsule())), law, mesentery=True, start_depth=0.15, friction=0.0)
        for _ in range(60):
            assert one.step(np.array([[*PRESS, 0.1, 0, 0, 0]]), 4).all()
        assert one.displacement is not None
        ways[law] = one.displacement[0, :, 2]
    assert ways["table"].max() > 1e-5
    np.testing.assert_allclose(ways["planes"], ways["table"], atol=0.2 * np.abs(ways["table"]).max())


@pytest.mark.parametrize("law", ["planes", "pieces"])
def test_a_robots_treads_drive_it_as_on_the_table(law: str) -> None:
    assert isinstance(TRACKED, TrackedRobot)
    wall = ring_wall(FITTING, sectors=24, thickness=0.02)
    rows = {}
    for each in (law, "table"):
        one = placed(TRACKED, each, colon=FITTING, wall=wall, start_depth=0.1)
        seen = []
        for _ in range(20):
            assert one.step(np.array([[TRACKED.rpm]]), 10).all()
            told = one.readings()
            seen.append([float(told[name][0]) for name in ("normal", "core_force")] + [float(one.read().tip_arc[0])])
        rows[each] = np.array(seen)
    found, known = rows[law], rows["table"]
    assert found[10:, 0].mean() == pytest.approx(known[10:, 0].mean(), rel=0.05)
    assert found[-1, 2] - 0.1 == pytest.approx(known[-1, 2] - 0.1, rel=0.03)
    assert found[:, 1].max() == known[:, 1].max() == 0.0


@pytest.mark.parametrize("law", ["planes", "pieces"])
def test_a_world_that_is_lost_stands_and_begins_anew_as_it_began(law: str) -> None:
    one = placed(capsule(), law, mesentery=True, start_depth=0.15)
    command = np.array([[0.6, 0.0, 0.0, 0, 0, 0]])
    ways = []
    for _ in range(2):
        for _ in range(20):
            assert one.step(command, 4).all()
        ways.append(one.read())
        assert not one.step(np.nan * command, 4).any() and not one.step(command, 4).any()
        one.reset(np.zeros(1, int), np.zeros(1, int), friction=np.array([0.1]), wall_stiffness=np.array([1500.0]))
        assert one.read().time == 0.0
    for name in ("time", "tip", "tip_arc", "wall_force", "deepest"):
        np.testing.assert_array_equal(getattr(ways[1], name), getattr(ways[0], name))


def test_what_has_no_colon_no_wall_or_many_worlds_is_refused() -> None:
    ball = capsule()
    with pytest.raises(UnsupportedSceneError, match="Wall law 'planes' is that of one colon"):
        build_device_scene(ball, device_options(wall_law="planes"))
    with pytest.raises(InvalidOptionError, match="'pieces' needs a wall"):
        run_device(ball, TUBE, device_options(wall_law="pieces"), seconds=0.1)
    scene = placed(ball, "planes").scene
    with pytest.raises(UnsupportedSceneError, match="'planes' is stepped in one world"):
        NativeDevice(scene, device_tables(scene, [TUBE]), worlds=2)


def test_a_run_among_pieces_that_move_keeps_where_they_were() -> None:
    """The scene holds them on mocap bodies, as its records say for every instant."""
    options = device_options(wall_law="pieces", mesentery=True)
    run = run_device(load_device("capsule"), TUBE, options, seconds=0.2, wall=WALL)
    model = run.spec.compile()
    assert run.wall_law == "pieces" and run.mesentery and "wall" not in run.left_out
    assert run.records["mocap_pos"].shape == (10, model.nmocap, 3) and model.nmocap > 10
    assert run.records["mocap_quat"].shape == (10, model.nmocap, 4)
