"""A wall without thickness answers F = K d at any depth, speed, mass and place, and lets a device slide freely."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.models.wall.law import WallContact
from haustra.models.wall.pieces.distance import Faces
from haustra.models.wall.planes import PlaneWall, Sample, add_planes, capsule_samples
from haustra.models.wall.signed_distance import LumenDistance
from tests.tube_colon import RADIUS, folded_tube, straight_tube

SPHERE = 0.0064
FLAT = np.pi / 48  # in the middle of a facet of the tube
OUTWARDS = np.array([np.cos(FLAT), np.sin(FLAT), 0.0])
APOTHEM = RADIUS * np.cos(FLAT)


class Probe:
    """A sphere, or a capsule along z, that moves freely but does not turn, inside a colon."""

    def __init__(self, colon, field, start, arc, *, stiffness=1500.0, friction=0.0, mass=0.01, half=0.0, h=0.005):
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.option.timestep = h
        spec.option.gravity = [0, 0, 0]
        spec.option.tolerance = 1e-14  # which MuJoCo scales with the mass
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        body = spec.worldbody.add_body(name="probe", pos=start)
        for name, axis in zip("xyz", np.eye(3), strict=True):
            body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        ends = [0, 0, -max(half, 1e-5), 0, 0, max(half, 1e-5)]
        geom = body.add_geom(name="capsule", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, mass=mass)
        geom.size, geom.contype, geom.conaffinity = [SPHERE, 0, 0], 0, 0
        bare = spec.compile()
        samples = (Sample("probe", np.zeros(3), SPHERE),)
        if half:
            samples = capsule_samples(bare, ["capsule"], spacing=SPHERE)
        contact = WallContact(stiffness=stiffness, damping=0.005 * stiffness, friction=friction)
        add_planes(spec, bare, samples, contact, timestep=h)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.wall = PlaneWall(self.model, field, arcs=arc + np.array([sample.position[2] for sample in samples]))

    def step(self, seconds: float) -> None:
        for _ in range(round(seconds / self.model.opt.timestep)):
            self.wall.update(self.data)
            mujoco.mj_step(self.model, self.data)

    def force(self) -> np.ndarray:
        """Force of the wall on the probe [N], from the contacts of the last step."""
        rows = self.data.contact.efc_address
        total = np.zeros(3)
        for row, contact in zip(rows, self.data.contact, strict=True):
            size = 3 if contact.dim == 3 else 1
            total += self.data.efc_force[row : row + size] @ contact.frame.reshape(3, 3)[:size]
        return total

    def position(self) -> np.ndarray:
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.body("probe").xpos.copy()


@pytest.fixture(scope="module")
def tube():
    colon = straight_tube()
    return colon, LumenDistance(colon)


@pytest.fixture(scope="module")
def bend(tube_colon):
    return tube_colon, LumenDistance(tube_colon)


@pytest.mark.parametrize(("stiffness", "mass"), [(700.0, 0.1), (700.0, 0.002), (2400.0, 0.01)])
@pytest.mark.parametrize("load", [1.0, 30.0])
def test_a_press_of_up_to_30_newtons_ends_where_hooke_says(tube, stiffness, load, mass):
    """43 mm deep at 700 N/m: further than any piece is thick."""
    colon, field = tube
    probe = Probe(colon, field, 0.013 * OUTWARDS + [0, 0, 0.3], 0.3, stiffness=stiffness, mass=mass)
    probe.model.dof_damping[:] = 2 * np.sqrt(mass * stiffness)  # so that it comes to rest
    probe.data.qfrc_applied[:] = load * OUTWARDS
    probe.step(0.8)
    depth = probe.position() @ OUTWARDS + SPHERE - APOTHEM
    assert depth == pytest.approx(load / stiffness, rel=0.01, abs=2e-5)


@pytest.mark.parametrize("speed", [0.01, 0.05])
def test_pressed_in_at_speed_the_wall_adds_its_damping_and_no_more(tube, speed):
    colon, field = tube
    probe = Probe(colon, field, [0, 0, 0.3], 0.3, mass=500.0)  # whatever resists, it moves on
    probe.data.qpos[:] = OUTWARDS * (APOTHEM - SPHERE + 0.010)
    probe.data.qvel[:] = speed * OUTWARDS
    probe.step(0.1)
    depth = probe.position() @ OUTWARDS + SPHERE - APOTHEM
    force, moving = -probe.force() @ OUTWARDS, probe.data.qvel @ OUTWARDS
    assert moving == pytest.approx(speed, rel=0.5)
    assert force == pytest.approx(1500 * depth, rel=0.05)
    assert force == pytest.approx(1500 * (depth + 0.005 * moving), rel=0.01)


@pytest.mark.parametrize("depth", [0.001, 0.010])
def test_the_same_holds_anywhere_in_a_bend_with_folds(bend, depth):
    """The depth is taken in another way: from the distance to the surface."""
    colon, field = bend
    line, faces = colon.centreline, Faces(colon.lumen)
    for place in range(12):
        station = 8 + place * (len(line.arc) - 16) // 11
        outwards = line.frames[station][:, :2] @ np.array([np.cos(2.4 * place), np.sin(2.4 * place)])
        foot = field.nearest(line.points[station : station + 1] + 0.010 * outwards, line.arc[station : station + 1])
        centre = foot.points[0] + (SPHERE - depth) * foot.inwards[0]
        probe = Probe(colon, field, centre, line.arc[station], mass=500.0)  # too heavy to be moved
        probe.step(0.01)
        found = SPHERE + np.copysign(faces.nearest(centre[None])[0][0], depth - SPHERE)
        pressing = probe.data.efc_force[probe.data.contact.efc_address]
        assert pressing.max() == pytest.approx(1500 * found, rel=0.05)
        assert (pressing > 0.05 * pressing.max()).sum() <= 2  # two sides of a fold at most


@pytest.mark.parametrize("load", [5.0, 30.0])
@pytest.mark.parametrize("speed", [0.02, 0.1])
def test_a_frictionless_capsule_slides_along_a_round_tube_without_drag(tube, load, speed):
    colon, field = tube
    probe = Probe(colon, field, [0.012, 0, 0.05], 0.05, half=0.01)
    probe.model.dof_armature[2] = 1e4
    probe.model.dof_damping[:2] = 5.0
    mujoco.mj_setConst(probe.model, probe.data)
    probe.data.qfrc_applied[0] = load
    probe.step(0.3)
    probe.data.qvel[2] = speed
    axial = []
    for _ in range(40):
        probe.step(0.02 / speed / 40)
        axial.append(probe.force()[2])
    assert abs(np.mean(axial)) < 0.005 * load  # the project's bar
    assert np.abs(axial).max() < 0.01 * load


def test_the_press_of_a_sliding_probe_does_not_depend_on_its_speed(tube):
    colon, field = tube
    depths = []
    for speed in (0.02, 0.05, 0.1):
        probe = Probe(colon, field, 0.013 * OUTWARDS + [0, 0, 0.05], 0.05, friction=0.1)
        probe.model.dof_damping[:] = [5.0, 5.0, 1e3]
        probe.data.qfrc_applied[:] = 5.0 * OUTWARDS
        probe.step(0.3)
        probe.data.qfrc_applied[2] = 1e3 * speed
        probe.step(0.5)
        assert probe.force()[2] == pytest.approx(-0.5, rel=0.01)
        depths.append(probe.position() @ OUTWARDS + SPHERE - APOTHEM)
    assert max(depths) - min(depths) < 0.01 * max(depths)


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_a_sliding_probe_stops_after_m_v_squared_over_2_mu_n(tube, friction):
    colon, field = tube
    mass, speed, load = 0.1, 0.5, 1.0
    probe = Probe(colon, field, 0.013 * OUTWARDS + [0, 0, 0.05], 0.05, friction=friction, mass=mass)
    probe.data.qfrc_applied[:] = load * OUTWARDS
    probe.model.dof_damping[:2] = 5.0
    probe.step(0.3)
    start = probe.position()[2]
    probe.data.qvel[2] = speed
    probe.step(mass * speed / (friction * load) + 0.2)
    assert abs(probe.data.qvel[2]) < 1e-4
    first_step = 0.5 * speed * probe.model.opt.timestep  # what semi-implicit steps leave out
    stop = probe.position()[2] - start + first_step
    assert stop == pytest.approx(mass * speed**2 / (2 * friction * load), rel=0.01)


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_a_probe_starts_to_slide_at_the_angle_of_friction_within_half_a_degree(tube, friction):
    colon, field = tube
    limit, half_degree, weight = np.arctan(friction), np.radians(0.5), 1.0
    speeds = []
    for tilt in (limit - half_degree, limit + half_degree):
        probe = Probe(colon, field, 0.0135 * OUTWARDS + [0, 0, 0.05], 0.05, friction=friction, mass=0.1)
        probe.model.dof_damping[:2] = 5.0
        probe.data.qfrc_applied[:] = weight * np.cos(tilt) * OUTWARDS
        probe.step(0.3)
        probe.data.qfrc_applied[2] = weight * np.sin(tilt)
        probe.step(1.0)
        speeds.append(probe.data.qvel[2])
    free = weight / 0.1 * (np.sin(limit + half_degree) - friction * np.cos(limit + half_degree))
    assert speeds[0] < 0.002  # it creeps, as on a flat wall
    assert speeds[1] == pytest.approx(free, rel=0.05)


def test_a_sphere_between_two_walls_touches_both():
    """In a lumen narrower than the sphere, it is held in the middle from both sides."""
    colon = straight_tube(0.1)
    vertices = colon.lumen.vertices * np.array([0.2, 1.0, 1.0])
    radius = np.linalg.norm(vertices[:48, :2], axis=1)
    narrow = replace(
        colon, lumen=replace(colon.lumen, vertices=vertices), radius=np.broadcast_to(radius, colon.radius.shape).copy()
    )
    probe = Probe(narrow, LumenDistance(narrow), [0.0005, 0, 0.05], 0.05)
    probe.model.dof_damping[:] = 2.0
    probe.step(0.5)
    assert probe.position()[0] == pytest.approx(0.0, abs=1e-4)
    pressing = probe.data.efc_force[probe.data.contact.efc_address]
    assert (pressing > 1500 * 0.002).sum() == 2


def test_loops_that_lie_against_each_other_are_kept_apart(hairpin_colon):
    """The straights are 2 mm apart; a press of 5 mm must not be drawn into the other one."""
    line = hairpin_colon.centreline
    field = LumenDistance(hairpin_colon)
    station = 6
    across = line.points[-1 - station] - line.points[station]
    across /= np.linalg.norm(across)
    probe = Probe(hairpin_colon, field, line.points[station] + 0.012 * across, line.arc[station])
    probe.model.dof_damping[:] = 5.0
    probe.data.qfrc_applied[:] = 15.0 * across
    probe.step(1.0)
    assert -probe.force() @ across == pytest.approx(15.0, abs=0.5)
    assert abs(probe.wall.arcs[0] - line.arc[station]) < 0.02


@pytest.fixture(scope="module")
def folded():
    colon = folded_tube()
    return colon, LumenDistance(colon)


@pytest.mark.parametrize("load", [5.0, 15.0])
def test_what_is_pressed_deeper_than_a_fold_is_thick_does_not_come_out_behind_it(folded, load):
    """A fold of 2 mm; 15 N press the centre 3.6 mm past its face, where its back is nearer."""
    colon, field = folded
    probe = Probe(colon, field, 0.0135 * OUTWARDS + [0, 0, 0.09], 0.09)
    probe.model.dof_damping[:] = load / 0.3  # a hand that moves at 0.3 m/s at most
    probe.data.qfrc_applied[2] = load
    probe.step(1.5)
    depth = probe.position()[2] + SPHERE - 0.099
    assert depth == pytest.approx(load / 1500, rel=0.01, abs=2e-5)


@pytest.mark.parametrize("load", [5.0, 18.0])
def test_a_stiff_tip_across_the_edge_of_a_fold_does_not_sink_over_it(folded, load):
    """The edge is between two of its spheres, which the sides of the fold only push apart."""
    colon, field = folded
    probe = Probe(colon, field, [0, 0, 0.1], 0.1, half=0.01)
    probe.model.dof_damping[:] = [load / 0.3, load / 0.3, 1e4]
    probe.data.qpos[2] = 0.0025
    probe.data.qfrc_applied[:2] = load * OUTWARDS[:2]
    probe.step(1.5)
    depth = probe.position() @ OUTWARDS + SPHERE - 0.008 * np.cos(FLAT)
    assert depth < load / 1500 + 0.001


@pytest.mark.parametrize("half", [0.0, 0.01])
def test_what_was_pressed_into_a_fold_is_free_once_it_has_come_round_its_edge(folded, half):
    colon, field = folded
    start = np.array([0.0135, 0.0, 0.09 - half])
    probe = Probe(colon, field, start, start[2], half=half)
    pressed, round_it = [0.0, 0.0, 0.012], [-0.0135, 0.0, 0.012]
    for one, other in (([0.0, 0.0, 0.0], pressed), (pressed, round_it)):
        for share in np.linspace(0.0, 1.0, 60):
            probe.data.qpos[:] = (1 - share) * np.array(one) + share * np.array(other)
            probe.wall.update(probe.data)
        if other is pressed:
            assert probe.wall.outside.max() == pytest.approx(0.003, abs=1e-5)
    assert probe.wall.outside.max() < -SPHERE
