"""An everting endoscope: what pressure leaves for the tip, and a body that does not slide."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.envs.sim.device_native import NativeDevice
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import BENDS, Device, Pose, load_device
from haustra.models.devices.tether import tether_tension
from haustra.models.devices.vine.interface import Vine
from haustra.models.wall.threads import FURTHEST, RING
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.ring_wall import bent_colon
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def tube():
    return straight_tube(0.2)


def vine(**changes) -> Vine:
    found = load_device("vine")
    assert isinstance(found, Vine)
    return replace(found, length=0.4, **changes)


def test_its_stiffness_is_that_of_a_wrinkled_tube():
    """EI = pi p r^3 R."""
    assert vine().flexural_rigidity == pytest.approx(np.pi * 20000 * 0.009**3 * 0.04)


def test_it_grows_through_a_tube_and_nothing_slides(tube):
    run = run_device(vine(), tube, device_options(vine(), friction=0.5), seconds=12.0)
    assert run.outcome.value == "completed"
    assert run.records["time"][-1] == pytest.approx((0.17 - 0.03) / 0.03, rel=0.1)  # as fast as the tail is paid out
    under_way = run.records["time"] > 1.0
    assert run.records["tip_press"][under_way].max() < 0.05  # friction of 0.5 would hold the body back


def test_the_pressure_leaves_what_eversion_and_tail_do_not_take(tube):
    """F = (p - p_y) A - T; below the pressure that everts it the tip stays, above it grows."""
    device = vine(tail_friction=0.5, tail_held=0.5)
    scene = build_device_scene(device, device_options(device), pose=Pose())
    one = NativeDevice(scene, device_tables(scene, [tube]), worlds=2)
    for _ in range(50):
        assert one.step(np.array([[0.03, 3500.0, 0, 0], [0.03, 20000.0, 0, 0]]), 8).all()  # 20 ms
    tip = one.read().tip_arc
    assert abs(tip[0] - 0.03) < 2e-3 and tip[1] - 0.03 == pytest.approx(0.03, rel=0.1)
    tail = tether_tension(np, np.zeros((2, BENDS)), tip, friction=0.5, mass_per_length=0.04, held=0.5)
    np.testing.assert_allclose(one.readings()["tail_tension"], tail, rtol=1e-3)
    np.testing.assert_allclose(one.readings()["available"], (20000.0 - 3000.0) * device.area - tail, rtol=1e-3)


def test_what_is_drawn_at_its_tip_weighs_nothing_and_does_not_touch():
    one = build_device_scene(vine(), device_options(vine()), pose=Pose()).compile()
    drawn = [one.geom(index) for index in range(one.ngeom) if one.geom(index).name.startswith("vine/")]
    assert len(drawn) == 5 and not any(geom.contype or geom.conaffinity for geom in drawn)
    chain = mujoco.MjSpec()
    vine().body.add_to(chain, Pose(), timestep=0.0025, start=0.03)
    assert one.body_mass.sum() == pytest.approx(chain.compile().body_mass.sum(), rel=1e-12)


@pytest.mark.parametrize("device", [vine(), load_device("capsule")], ids=["vine", "capsule"])
def test_a_colon_is_drawn_to_its_body_between_the_spheres_as_to_a_scope(device: Device):
    """Straight across a bend it leaves loops of colon empty, which are drawn to it; a capsule is no shaft.

    The body bears what the nodes are drawn by: some newtons, each node's at most the law's largest.
    """
    bend = bent_colon(bend=0.05, leg=0.1, length=0.35)
    bend = replace(bend, segments=(ColonSegment("sigmoid", 0.0, 0.35),))
    options = device_options(device, mesentery=True, start_depth=0.2)
    scene = build_device_scene(device, options, pose=pose_in(bend, device, options))
    one = NativeDevice(scene, device_tables(scene, [bend]))
    one.step(np.zeros((1, len(device.controls))), 1)
    borne = one.world_data(0)[1].xfrc_applied
    assert borne.any() == device.is_shaft
    if device.is_shaft:
        assert RING * FURTHEST < np.linalg.norm(borne[:, :3].sum(axis=0)) < 10 * RING * FURTHEST


def test_its_time_step_is_short_enough_for_so_light_a_body():
    """Halved, it presses the same; at 5 ms links chattered and pressed two to six times as hard."""
    bends = swept_colon(winding([(0.02, 0.0), (0.06, 1.5), (0.10, -1.2)]), name="two bends")
    usual, halved = (
        run_device(vine(), bends, device_options(vine(), wall_stiffness=2400.0, **short), seconds=3.0).records
        for short in ({}, {"timestep": device_options(vine()).timestep / 2})
    )
    assert halved["wall_force"].max() > 0.5
    assert usual["wall_force"].max() == pytest.approx(halved["wall_force"].max(), rel=0.05)
    assert usual["wall_force_sum"].mean() == pytest.approx(halved["wall_force_sum"].mean(), rel=0.05)
