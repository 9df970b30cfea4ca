"""The tracked robot as any other device: what its treads, worm and shaft do on the lumen's table."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.envs.sim.device_native import NativeDevice
from haustra.envs.study.run import Computing, run_sweep
from haustra.envs.study.study_file import load_study
from haustra.envs.tasks.device_env import DeviceEnv
from haustra.envs.tasks.device_task import DeviceRules
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.anatomy.store import save_colon
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import load_device
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.drive import track_normal, worm_lever
from haustra.models.devices.tracked.interface import TrackedRobot
from tests.ring_wall import bent_colon

COLON = bent_colon(bend=0.04, leg=0.3, length=0.5)
"""Straight where the robot stands, and as wide as its tracks reach."""
DIAMETER = 0.032
UPHILL = 1.5
"""Gravity along the way back [m/s^2]: half of what friction holds."""


def robot(**changed: object) -> TrackedRobot:
    found = load_device("tracked")
    assert isinstance(found, TrackedRobot)
    return replace(found, **changed)  # type: ignore[arg-type]


def with_worm(**changed: float) -> TrackedRobot:
    design = slack().design
    return robot(design=replace(design, worm=replace(design.worm, **changed)))


def slack(**changed: object) -> TrackedRobot:
    """A robot whose tether weighs nothing."""
    design = robot().design
    return robot(**{"design": replace(design, tether=replace(design.tether, mass_per_length=0.0)), **changed})


def driven(
    device: TrackedRobot,
    *,
    seconds: float = 1.0,
    colon: Colon = COLON,
    press: tuple[float, ...] = (),
    **options: object,
) -> tuple[NativeDevice, dict[str, float]]:
    """A robot that drives for a while, and means of what is read over the last half; `headway` is its own [m]."""
    asked = device_options(device, **{"start_depth": 0.1, **options})
    scene = build_device_scene(device, asked, pose=pose_in(colon, device, asked))
    one, rows = NativeDevice(scene, device_tables(scene, [colon])), []
    for _ in range(round(seconds / 0.02)):
        assert one.step(np.array([[device.rpm, *press]]), round(0.02 / asked.timestep)).all()
        rows.append({name: float(value[0]) for name, value in one.readings().items()})
        rows[-1] |= {"arc": float(one.read().tip_arc[0]), "power": float(one.power()[0])}
    late = rows[len(rows) // 2 :]
    means = {name: float(np.mean([row[name] for row in late])) for name in rows[0]}
    return one, {**means, "headway": late[-1]["arc"] - late[0]["arc"]}


@cache
def weight_uphill() -> float:
    scene = build_device_scene(robot(), device_options(robot(), gravity=(0.0, 0.0, -UPHILL)), pose=pose_in_any())
    return UPHILL * float(scene.compile().body_mass.sum())


def sliding_uphill() -> float:
    """Speed at which mu(v) is what holds the robot's weight [m/s]."""
    design = robot().design
    held = robot().friction * design.shaft.efficiency * 4 * track_normal(design, DIAMETER)
    return design.speed_friction.sliding(weight_uphill() / held)


def pose_in_any():
    return pose_in(COLON, robot(), device_options(robot(), start_depth=0.1))


@pytest.mark.parametrize("timestep", [1e-3, 2e-3])
def test_it_runs_at_the_speed_of_its_treads_and_presses_as_bellows_and_tissue_say(timestep: float) -> None:
    one, seen = driven(slack(), timestep=timestep)
    ran = robot().design.tread_speed(robot().rpm) * 0.02 * 24
    assert seen["headway"] == pytest.approx(ran, rel=0.005)
    assert seen["normal"] == pytest.approx(4 * track_normal(robot().design, DIAMETER), rel=0.005)
    assert seen["traction"] == pytest.approx(0.0, abs=1e-3)
    assert seen["core_force"] == 0.0
    assert one.spheres().shape[1] == len(one.scene.handles.samples)


@pytest.mark.thorough
def test_the_prototype_drives_in_a_lumen_four_times_as_wide() -> None:
    """Lengths and speed are four times those of the device in practice, forces sixteen times."""
    large = bent_colon(bend=0.16, leg=0.8, length=0.8, radius=0.064)
    prototype = replace(slack(), design=replace(TrackedDesign(), tether=slack().design.tether))
    _, seen = driven(prototype, colon=large, start_depth=0.4)
    assert seen["headway"] == pytest.approx(4 * robot().design.tread_speed(robot().rpm) * 0.02 * 24, rel=0.01)
    assert seen["normal"] == pytest.approx(16 * 4 * track_normal(robot().design, DIAMETER), rel=0.01)
    assert seen["width"] == pytest.approx(4 * DIAMETER, rel=0.02)


@pytest.mark.parametrize("timestep", [1e-3, 2e-3])
def test_uphill_its_treads_pull_its_weight_and_the_worm_its_lever_of_that(timestep: float) -> None:
    """t = F lead / (2 pi eta), which turns the core, too."""
    one, seen = driven(slack(), timestep=timestep, gravity=(0.0, 0.0, -UPHILL))
    assert seen["traction"] == pytest.approx(weight_uphill(), rel=0.002)
    assert seen["worm_torque"] == pytest.approx(worm_lever(robot().design) * weight_uphill(), rel=0.01)
    assert seen["worm_share"] == 1.0
    turned = one._force[0, one.model.actuator("tracked/roll").id]
    assert turned == pytest.approx(seen["worm_torque"], rel=0.01)
    ideal = weight_uphill() * robot().design.tread_speed(robot().rpm)
    assert seen["power"] == pytest.approx(ideal / robot().design.worm.efficiency, rel=0.03)  # and the core rolls


def test_the_worms_torque_turns_the_body_and_the_wall_bears_it() -> None:
    """All forces of the wall have a moment of -t about the core, and the body rolls with t as fast as its film slides.

    Weight F and the treads' friction around, M / R, slide the film at s(F, M / R), of which (M / R) / |F, M / R| is
    around: roll = s (M / R) / |F, M / R| / R. In a perfectly round lumen M is t; in the table's, of flat facets, normal
    forces bear the rest.
    """
    one, _ = driven(slack(), gravity=(0.0, 0.0, -UPHILL))
    design, radius, turned, told = robot().design, DIAMETER / 2, [], []
    largest = robot().friction * design.shaft.efficiency * 4 * track_normal(design, DIAMETER)
    spin = int(one.model.joint("tracked/free").dofadr[0]) + 3
    for _ in range(40):
        one.step(np.array([[robot().rpm]]), 10)
        state, seen = one._state(), one.read()
        levers = one.spheres()[0] - seen.tip[0]
        rubbing = np.cross(levers, state.rubbed[0]).sum(axis=0) @ seen.tip_frame[0][:, 2]
        pressing = np.cross(levers, one._wall.forces()[0]).sum(axis=0) @ seen.tip_frame[0][:, 2]
        assert rubbing + pressing == pytest.approx(-one.readings()["worm_torque"][0], rel=0.1)
        held, whole = -rubbing / radius, np.hypot(weight_uphill(), rubbing / radius)
        told.append(design.speed_friction.sliding(whole / largest) * held / whole / radius)
        turned.append(one.velocities()[0][0, spin])
    assert np.mean(turned) == pytest.approx(np.mean(told), rel=0.1) and np.mean(turned) > 0


def test_a_worm_at_its_torque_limit_slows_down_and_beyond_it_holds() -> None:
    needed = worm_lever(robot().design) * weight_uphill()
    _, slow = driven(with_worm(torque_limit=1.05 * needed), seconds=2.0, gravity=(0.0, 0.0, -UPHILL))
    _, held = driven(with_worm(torque_limit=0.5 * needed), seconds=2.0, gravity=(0.0, 0.0, -UPHILL))
    assert slow["worm_share"] == pytest.approx((1 - 1 / 1.05) / 0.1, rel=0.15)
    assert held["worm_share"] == 0.0 and held["headway"] == pytest.approx(-sliding_uphill() * 0.02 * 49, rel=0.1)
    assert held["traction"] == pytest.approx(weight_uphill(), rel=0.002)


def test_uphill_its_treads_slide_at_the_speed_whose_friction_is_its_weight() -> None:
    _, seen = driven(slack(), gravity=(0.0, 0.0, -UPHILL))
    slid = robot().design.tread_speed(robot().rpm) - seen["headway"] / (0.02 * 24)
    assert slid == pytest.approx(sliding_uphill(), rel=0.06)
    design = robot().design
    coulomb = replace(design, speed_friction=replace(design.speed_friction, exponent=0.0))
    _, seen = driven(robot(design=coulomb), gravity=(0.0, 0.0, -UPHILL))
    assert design.tread_speed(robot().rpm) - seen["headway"] / (0.02 * 24) < 0.06 * slid


def test_what_the_shaft_loses_friction_lacks() -> None:
    """Uphill, between mu N and that times the shaft's efficiency, it climbs without losses, and slides back with."""
    design = replace(robot().design, speed_friction=replace(robot().design.speed_friction, exponent=0.0))
    friction = weight_uphill() / (0.97 * 4 * track_normal(design, DIAMETER))
    lossless = robot(design=replace(design, shaft=replace(design.shaft, efficiency=1.0)))
    uphill = {"gravity": (0.0, 0.0, -UPHILL), "friction": friction, "seconds": 0.4}
    assert driven(lossless, **uphill)[1]["headway"] > 0.001
    assert driven(robot(design=design), **uphill)[1]["headway"] < -0.001


@pytest.mark.thorough
def test_it_goes_round_a_right_angle_of_60_mm_radius_in_a_tube_of_its_width_and_steered_it_does_better() -> None:
    colon = bent_colon(bend=0.06, leg=0.11, length=0.36, radius=robot().design.nominal_diameter / 2)
    ways, soon = {}, 4.0
    for steering, seconds in (("none", 12.0), ("each tread", soon)):
        device = robot(steering=steering, rpm=300.0)
        run = run_device(device, colon, device_options(device, start_depth=0.1), seconds=seconds)
        assert run.records["core_force"].max() < 1.0 and run.wall_law == "table"
        along = np.diff(run.shape, axis=0) @ (run.shape[-1] - run.shape[0])
        assert (along > 0).all() and run.radius == device.design.core_diameter / 2
        ways[steering] = run.records["tip_arc"] - 0.1
    round_it = 0.01 + 0.06 * np.pi / 2 + robot().design.core_length + robot().design.core_diameter
    assert round_it < ways["none"][-1] < 12.0 * robot().design.tread_speed(300.0)
    after = len(ways["each tread"]) - 1
    assert ways["none"][after] < ways["each tread"][after] < 1.02 * soon * robot().design.tread_speed(300.0)


def test_a_study_and_an_environment_run_it(tmp_path: Path) -> None:
    (tmp_path / "colon").mkdir()
    save_colon(COLON, tmp_path / "colon")
    (tmp_path / "study.toml").write_text(
        f"""
question = "device"
title = "Speed of the worm"
[base]
design = "tracked"
[options]
seconds = 0.5
timestep = 0.002
[[variables]]
name = "speed"
path = "design.rpm"
unit = "1/min"
nominal = 150
low = 75
high = 150
values = [75, 150]
[conditions]
colon = ["{tmp_path / "colon"}"]
friction = [0.4]
[[objectives]]
score = "reach"
goal = "maximise"
"""
    )
    polars = pytest.importorskip("polars")
    assert run_sweep(load_study(tmp_path / "study.toml"), tmp_path / "sweep", Computing())["finished"] == 2
    slow, fast = polars.read_csv(tmp_path / "sweep" / "results.csv")["tip_arc_max_m"].to_list()
    assert fast - slow == pytest.approx(0.5 * robot().design.tread_speed(75), rel=0.02)
    from_places = (tmp_path / "study.toml").read_text().replace("friction =", "start = [0.12, 0.2]\nfriction =")
    (tmp_path / "places.toml").write_text(from_places.replace("[75, 150]", "[150]"))
    run_sweep(load_study(tmp_path / "places.toml"), tmp_path / "places", Computing())
    found = polars.read_csv(tmp_path / "places" / "results.csv")
    assert found["start_m"].to_list() == pytest.approx([0.12, 0.2], abs=1e-3)
    assert found["came_m"].to_list() == pytest.approx(2 * [0.5 * robot().design.tread_speed(150)], rel=0.03)
    made = DeviceEnv("tracked", colons=[COLON], rules=DeviceRules(friction=(0.4, 0.4)))
    made.reset(seed=0)
    reward, info = 0.0, {}
    for _ in range(10):
        _, reward, _, _, info = made.step(np.array([-0.7]))
    assert info["tip_arc"] - 0.3 == pytest.approx(10 * 0.04 * robot().design.tread_speed(150), rel=0.1) and reward > 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"timestep": 0.005}, r"cannot honour a time step of 0\.005 s: give up to 0\.002 s"),
        ({"start_depth": 0.01}, "cannot stand at"),
    ],
)
def test_what_a_scene_of_it_does_not_honour_is_refused_by_name(options: dict, message: str) -> None:
    with pytest.raises(HaustraError, match=message):
        driven(robot(), **options)


def test_it_begins_where_it_fits_next_to_what_is_asked() -> None:
    """Inside the colon with its nose, and at the place itself where it fits."""
    long, nose = COLON.centreline.length, robot().design.core_length + robot().design.core_diameter
    assert robot().nearest_start(COLON, 0.2) == pytest.approx(0.2, abs=2e-3)
    assert nose / 2 < robot().nearest_start(COLON, 0.0) < nose + 2e-3
    assert robot().nearest_start(COLON, 9.0) == pytest.approx(long, abs=2e-3)
    with pytest.raises(HaustraError, match="fits nowhere"):
        robot().nearest_start(bent_colon(bend=0.06, leg=0.1, length=0.3, radius=0.005), 0.2)


def test_on_its_mesentery_a_colon_gives_way_to_treads_and_core_and_they_press_as_much() -> None:
    one, seen = driven(slack(), mesentery=True, gravity=(0.0, 0.0, -UPHILL))
    assert one.displacement is not None and np.abs(one.displacement[0, :, :3]).max() > 1e-4
    assert seen["traction"] == pytest.approx(weight_uphill(), rel=0.02)
    assert seen["normal"] == pytest.approx(4 * track_normal(robot().design, DIAMETER), rel=0.01)


def test_bellows_hold_each_track_by_its_preload_at_any_width_and_as_far_as_their_pressure_goes() -> None:
    """Closed bellows press less the further out they stand, by their stiffness; a regulator makes up for it."""
    wide, design = bent_colon(bend=0.06, leg=0.3, length=0.4, radius=0.0183), slack().design
    own = replace(design.bellows, response=0.02)
    design = replace(design, bellows=own)
    held = {"seconds": 0.5, "colon": wide, "friction": 0.1}
    _, closed = driven(slack(design=design), **held)
    assert closed["normal"] < 0.7 * 4 * own.preload
    _, found = driven(slack(regulation="held", design=design), **held)
    assert found["normal"] == pytest.approx(4 * own.preload, rel=0.03)
    extension = (found["width"] - robot().design.nominal_diameter) / 2
    assert found["bellows_pressure"] == pytest.approx(-own.stiffness * extension / own.area, rel=0.03)
    weak = replace(design, bellows=replace(own, lowest_pressure=-1000.0))
    _, found = driven(slack(regulation="held", design=weak), **held)
    assert found["bellows_pressure"] == pytest.approx(-1000.0, rel=0.01)
    press = (2 * own.preload, own.preload, 2 * own.preload, own.preload)
    _, found = driven(slack(regulation="each", design=design), press=press, **held)
    assert found["normal"] == pytest.approx(sum(press), rel=0.05)


def test_its_tether_pulls_as_the_capstan_says() -> None:
    """Behind a bend by 90 degrees the tension outside is greater by exp(mu pi / 2)."""
    colon, design = bent_colon(bend=0.06, leg=0.12, length=0.45), robot().design
    drags = []
    for friction in (0.0, 0.5):
        tether = replace(design.tether, mass_per_length=0.0, held=0.02, friction=friction)
        device = robot(design=replace(design, tether=tether))
        _, seen = driven(device, colon=colon, start_depth=0.33, seconds=0.3)
        drags.append(seen["tether_drag"])
    assert drags[0] == pytest.approx(0.02, rel=0.01)
    assert drags[1] / drags[0] == pytest.approx(np.exp(0.5 * np.pi / 2), rel=0.03)


def test_gas_widens_the_lumen_about_it_and_it_presses_less() -> None:
    """A sigmoid given at 3 kPa is narrower at 2.5 kPa, and squeezes closed bellows; all tables of the robot move."""
    colon = replace(COLON, segments=(ColonSegment("sigmoid", 0.0, COLON.centreline.length),))
    device, pressed = slack(), []
    for pressure in (2500.0, 3000.0):
        options = device_options(device, start_depth=0.1, gas=pressure, gas_start=pressure)
        run = run_device(device, colon, options, seconds=0.3)
        assert run.records["gas_pressure"].shape[0] == len(run.records["time"])
        pressed.append((run.records["normal"][-1], run.records["width"][-1], run.colon.radius.mean()))
    assert pressed[0][0] > 1.1 * pressed[1][0] and pressed[0][1] < pressed[1][1] and pressed[0][2] < pressed[1][2]
