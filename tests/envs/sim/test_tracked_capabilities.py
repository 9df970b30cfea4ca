"""Every field of the tracked design: its effect natively, the same rig on Warp, or its refusal by name.

A robot slides down a bent tube, its treads running against that, and reads change with each field. On the rigs
a field's effect is that of the closed form.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from haustra.envs.runs.measure.propulsion import pull
from haustra.envs.sim.capabilities import TRACKED, TRACKED_ON
from haustra.envs.sim.device_native import NativeDevice
from haustra.envs.study.questions import find_backend
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import HaustraError, InvalidDesignError, InvalidOptionError
from haustra.models.device_scene import build_device_scene, device_options, device_tables
from haustra.models.devices.base import Pose
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.drive import drive_point
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.models.devices.tracked.rig import Rig, tube_rig
from tests.ring_wall import bent_colon
from tests.tube_colon import straight_tube

LEAST = 2e-3
"""Size of the smallest effect that counts as one, in units of `SCALES`."""
SCALES = np.array([0.01, 0.1, 1.0, 0.1, 2e-4, 1.0, 1e4, 1e-3, 1.0])
"""Headway [m], traction, normal and core's force [N], torque [N m], share [1], pressure [Pa], struts [m], turn [1]."""
RIG_TOLERANCE, RIG_FLOOR = 0.05, 2e-3
"""By which the effect of a field on the pull of a rig may differ from the closed form: of its size, and of the pull."""
RPM, FRICTION, SECONDS = 250.0, 0.2, 0.4
BEND = bent_colon(bend=0.04, leg=0.12, length=0.25)
WIDE = straight_tube(0.3)
"""No track reaches its wall."""
DESIGN = replace(TrackedDesign().at_scale(1.0), bellows=replace(TrackedDesign().at_scale(1.0).bellows, pressure=1000.0))


def _part(part: str, **factors: float) -> Callable[[TrackedDesign], TrackedDesign]:
    """A design of which a part's numbers are multiplied."""

    def change(design: TrackedDesign) -> TrackedDesign:
        own = getattr(design, part)
        return replace(design, **{part: replace(own, **{n: getattr(own, n) * by for n, by in factors.items()})})

    return change


def _times(**factors: float) -> Callable[[TrackedDesign], TrackedDesign]:
    return lambda design: replace(design, **{name: getattr(design, name) * by for name, by in factors.items()})


def _one_start(design: TrackedDesign) -> TrackedDesign:
    """Another tread for which a table is solved: its lead is one pitch, and its tooth is half of that."""
    tread = replace(design.tread, pitch=2 * design.tread.pitch, tooth_width=2 * design.tread.tooth_width)
    return replace(design, worm=replace(design.worm, starts=1), tread=tread)


EFFECTS: Mapping[str, Callable[[TrackedDesign], TrackedDesign]] = {
    "scale": lambda design: replace(design, scale=2.0),
    "speed_friction.peak_speed": _part("speed_friction", peak_speed=2.0),
    "speed_friction.exponent": _part("speed_friction", exponent=0.3),
    "tread.pitch": _one_start,
    "tread.tooth_width": _one_start,
    "worm.starts": _one_start,
    "tread.tip_spacing": _part("tread", tip_spacing=1.4),
    "worm.lead": _part("worm", lead=1.009),
    "worm.efficiency": _part("worm", efficiency=0.5),
    "worm.torque_limit": _part("worm", torque_limit=0.12),
    "shaft.onset_speed": _part("shaft", onset_speed=0.5),
    "shaft.efficiency": _part("shaft", efficiency=0.8),
    "shaft.stall_excess": _part("shaft", stall_excess=0.5),
    "bellows.stiffness": _part("bellows", stiffness=1.5),
    "bellows.preload": _part("bellows", preload=1.3),
    "bellows.pressure": _part("bellows", pressure=3.0),
    "bellows.area": _part("bellows", area=3.0),
    "bellows.lowest_pressure": _part("bellows", lowest_pressure=0.01),
    "bellows.highest_pressure": _part("bellows", highest_pressure=0.01),
    "bellows.response": _part("bellows", response=0.2),
    "tether.mass_per_length": _part("tether", mass_per_length=20.0),
    "tether.friction": _part("tether", friction=10.0),
    "tether.held": lambda design: replace(design, tether=replace(design.tether, held=0.05)),
    "nominal_diameter": _times(nominal_diameter=0.97),
    "smallest_diameter": _times(smallest_diameter=1.345),
    "largest_diameter": _times(largest_diameter=0.963),
    "core_length": _times(core_length=1.3),
    "core_diameter": _times(core_diameter=1.4),
    "mass": _times(mass=2.0),
}
"""Designs in which one field has an effect on a robot in a colon."""
REGULATED = ("bellows.lowest_pressure", "bellows.highest_pressure", "bellows.response")
"""Fields that count where bellows are regulated."""
UNSOLVED = ("tooth_height", "belt_thickness", "tip_radius", "width", "tissue_thickness", "clearance")
"""Lengths of a tread without a force table of its own, unless all change together."""
ON_RIGS: Mapping[str, Callable[[TrackedDesign], TrackedDesign]] = {
    "speed_friction.peak_speed": _part("speed_friction", peak_speed=2.0),
    "speed_friction.exponent": _part("speed_friction", exponent=0.3),
    "shaft.efficiency": _part("shaft", efficiency=0.8),
    "shaft.onset_speed": _part("shaft", onset_speed=0.5),
    "worm.efficiency": _part("worm", efficiency=0.5),
    "bellows.preload": _part("bellows", preload=1.3),
}
RIG_RPM = 100.0
"""Below the speed of the largest friction, above half of the shaft's onset."""


def _driven(design: TrackedDesign, *, wide: bool, pull: float = 1.5, bellows: str = "closed") -> np.ndarray:
    """Means of what is read in units of `SCALES`, with gravity so large back along the way [m/s^2]."""
    robot = TrackedRobot(name="robot", design=design, rpm=RPM, friction=FRICTION, regulation=bellows)
    colon = WIDE if wide else BEND
    arc = 0.09
    line = colon.centreline
    pose = Pose(np.array([np.interp(arc, line.arc, axis) for axis in line.points.T]), np.eye(3), arc)
    options = device_options(robot, timestep=2e-3, gravity=(0.0, 0.0, 0.0 if wide else -pull))
    scene = build_device_scene(robot, options, pose=pose)
    one, rows = NativeDevice(scene, device_tables(scene, [colon])), []
    names = ("traction", "normal", "core_force", "worm_torque", "worm_share", "bellows_pressure")
    struts = [int(one.model.joint(f"tracked/strut{track}").qposadr[0]) for track in range(4)]
    begun = float(one.read().tip_arc[0])
    for _ in range(round(SECONDS / 0.02)):
        assert one.step(np.array([[RPM]]), 10).all()
        seen, qpos = one.readings(), one.positions()[0][0]
        own = [float(seen[name][0]) for name in names]
        radius = design.nominal_diameter / 2 + float(qpos[struts].mean())
        rows.append([float(one.read().tip_arc[0]) - begun, *own, radius, float(qpos[4])])
    return np.mean(rows, axis=0) / SCALES


@cache
def _base(wide: bool, pull: float, bellows: str) -> np.ndarray:
    return _driven(DESIGN, wide=wide, pull=pull, bellows=bellows)


@pytest.mark.parametrize("name", EFFECTS)
def test_a_robot_in_a_colon_honours_it(name: str) -> None:
    # Treads that slide throughout, as under the larger pull, rub the same at any exponent.
    wide, pull = name in ("largest_diameter", "bellows.lowest_pressure"), 0.5 if "exponent" in name else 1.5
    bellows = "held" if name in REGULATED else "closed"
    changed = _driven(EFFECTS[name](DESIGN), wide=wide, pull=pull, bellows=bellows)
    assert np.linalg.norm(changed - _base(wide, pull, bellows)) > LEAST


def _rig(design: TrackedDesign) -> tuple[Rig, Any]:
    point = drive_point(design, FRICTION, RIG_RPM)
    return tube_rig(design, friction=point.friction), point


@cache
def _pulled(design: TrackedDesign) -> tuple[float, float]:
    """Pull of a robot at its string, and that by the closed form [N]."""
    rig, point = _rig(design)
    return float(pull(rig, point.speed, roll_torque=point.worm_torque).string.mean()), point.force


@pytest.mark.parametrize("name", ON_RIGS)
def test_a_robot_on_a_rig_pulls_as_the_closed_form_says(name: str) -> None:
    base = TrackedDesign()
    changed = ON_RIGS[name](base)
    (found, told), (usual, usually) = _pulled(changed), _pulled(base)
    assert abs(told - usually) > LEAST * usually
    assert found - usual == pytest.approx(told - usually, rel=RIG_TOLERANCE, abs=RIG_FLOOR * usually)


@pytest.mark.parametrize("name", UNSOLVED)
def test_a_tread_without_a_force_table_is_refused_by_the_length_that_differs(name: str) -> None:
    with pytest.raises(InvalidDesignError, match=f"No force table for a tread of pitch 1.62 mm with {name} "):
        _driven(_part("tread", **{name: 1.1})(DESIGN), wide=False)
    with pytest.raises(InvalidDesignError, match=name):
        tube_rig(_part("tread", **{name: 1.1})(TrackedDesign()), friction=FRICTION)


@pytest.mark.parametrize("backend", [name for name, where in TRACKED_ON.items() if where == "no tracked robots"])
def test_backends_of_scopes_refuse_a_robot_by_name(backend: str) -> None:
    for question in ("device", "propulsion"):
        with pytest.raises(InvalidOptionError, match=f"'{backend}' does not answer '{question}'. Known: native, warp"):
            find_backend(question, backend)
    name = backend.removesuffix("-batch")
    with pytest.raises(HaustraError, match="'tracked'"):
        NavigationVectorEnv(1, TaskConfig(design="tracked", seeds=(0, 1)), backend=name)


@pytest.mark.parametrize("name", sorted({*EFFECTS, *ON_RIGS} - {"tread.pitch", "tread.tooth_width", "worm.starts"}))
def test_warp_steps_the_rig_that_is_stepped_natively(name: str) -> None:
    """Numbers that Warp's kernels read, to single precision. What they pull is held in `test_propulsion_worlds.py`."""
    pytest.importorskip("warp", reason="the extra warp is not installed")
    from haustra.envs.runs.warp_rigs import WarpRigs

    rig, _ = _rig({**EFFECTS, **ON_RIGS}[name](TrackedDesign()))
    known, own = rig.spec.compile(), WarpRigs([rig], which=np.zeros(1, int), device="cpu")._warp
    for array in ("body_mass", "jnt_stiffness", "jnt_range", "dof_damping", "qpos_spring", "geom_size", "body_pos"):
        wanted = getattr(known, array)
        np.testing.assert_allclose(getattr(own, array).numpy().reshape(wanted.shape), wanted, rtol=1e-6, atol=1e-9)


def test_every_field_has_a_value_to_test_it_with() -> None:
    tested = {"name", *EFFECTS, *ON_RIGS, *(f"tread.{name}" for name in UNSOLVED)}
    assert {entry.path.removeprefix("tracked.") for entry in TRACKED} == tested
