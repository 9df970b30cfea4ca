"""A colon that moves on its mesentery: rods, springs and balances that are known."""

from dataclasses import replace
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runtime_types import unchecked
from scipy.spatial.transform import Rotation

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.scope_colon_set import ScopeColonSet, build_bank
from haustra.envs.sim.state import Controls, Readings
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions
from haustra.models.wall import mesentery, moving_colon
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import Tables, axis_at, lumen_table, pick, query, stack
from haustra.models.wall.mesentery import Mesentery, hang
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement
from haustra.models.wall.sections import SHORTEST, carried, twisted
from haustra.models.wall.table_wall import TableWalls
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.models.wall.quickly import crept, jitted
from tests.tube_colon import straight_tube

_STEP = 0.005
_OPTIONS = SceneOptions(
    insertion_limit=0.3,
    shaft_cell=0.0625,
    bending_cell=0.034,
    sample_spacing=0.03,
    mesentery=True,
    wall_law="table",
    softening=False,
)


def _straight(length: float = 0.3, **changed: Any) -> Mesentery:
    """A tube along z with 100 N of tension per strain, hung as `changed` says; worlds first, in double precision."""
    arcs = np.linspace(0.0, length, 100)
    own = hang(arcs[:, None] * [0.0, 0.0, 1.0], arcs, np.full(100, 0.02), ())
    count = len(own.nodes)
    free = {"hold": np.zeros(count), "support": np.zeros(count), "drag": np.full(count, 0.02)}
    free |= {"tension": np.full(count - 1, 100.0), "bending": np.zeros(count)}
    free |= {"torsion": np.zeros(count - 1), "upright": np.zeros(count), "turn_drag": np.full(count, 1e-5)}
    return mesentery.stack([own._replace(**free | changed)])


def _creep(own: Mesentery, force: np.ndarray, steps: int) -> np.ndarray:
    """Displacements after steps under forces on the nodes (nodes, 3) [N]."""
    return crept(own, steps, _STEP, force)


def _only(count: int, node: int, force: list[float]) -> np.ndarray:
    forces = np.zeros((count, 3))
    forces[node] = force
    return forces


@pytest.fixture(autouse=True)
def _double_precision():
    with jax.enable_x64(True):
        yield


def test_a_mesentery_extends_only_beyond_its_slack():
    """Shifted aside by d, a node that hangs on a slack s has drawn its mesentery out by d - s; a fixed one has none."""
    arcs = np.linspace(0.0, 0.4, 81)
    segments = [ColonSegment("rectum", 0.0, 0.1), ColonSegment("sigmoid", 0.1, 0.4)]
    own = hang(arcs[:, None] * [0.0, 0.0, 1.0], arcs, np.full(81, 0.02), segments)
    aside = np.zeros((2, len(own.nodes), 3))
    aside[:, :, 0] = [[0.03], [0.08]]
    found = moving_colon.mesentery_extension(np, own, aside, np.zeros(2))
    assert (found[:, own.slack == 0] == 0).all()
    middle = len(own.nodes) * 5 // 8
    assert own.slack[middle] == pytest.approx(0.063)
    np.testing.assert_allclose(found[:, middle], [0.0, 0.08 - 0.063], atol=1e-12)


def test_a_pulled_tube_stretches_and_a_pushed_one_pleats_more() -> None:
    """F L / EA in tension; in compression divided by the share of stiffness that pleats have."""
    count = 31
    anchored = np.zeros(count)
    anchored[0] = 1e6
    own = _straight(hold=anchored)
    length = float(own.lengths.sum())
    pulled = _creep(own, _only(count, -1, [0, 0, 5.0]), 1500)[-1, 2]
    assert pulled == pytest.approx(5.0 * length / 100.0, rel=1e-3)
    pushed = _creep(own, _only(count, -1, [0, 0, -0.5]), 4000)[-1, 2]
    assert pushed == pytest.approx(-0.5 * length / (100.0 * float(own.pleating[0])), rel=1e-3)


def test_a_tube_that_has_lost_its_gas_shortens_by_its_thrust_over_the_stiffness_of_pleats() -> None:
    """p pi r^2 L / EA, divided by the share of stiffness that pleats have; nodes that fill a row up pull at nothing."""
    count, lost, radius = 31, 300.0, 0.02
    anchored = np.zeros(count)
    anchored[0] = 1e6
    one = _straight(hold=anchored, turn_drag=np.full(count, 0.02 * radius**2))
    alone = Mesentery(*(part[0] for part in one))
    longer = hang(np.linspace(0, 0.5, 9)[:, None] * [0.0, 0.0, 1.0], np.linspace(0, 0.5, 9), np.full(9, radius), ())
    own = Mesentery(*(part[:1] for part in mesentery.stack([alone, longer])))._replace(pressure_lost=np.array([lost]))
    assert own.nodes.shape[1] > count
    moved = _creep(own, np.zeros((own.nodes.shape[1], 3)), 4000)[count - 1, 2]
    thrust = lost * np.pi * radius**2
    assert moved == pytest.approx(-thrust * float(one.lengths.sum()) / (100.0 * float(one.pleating[0])), rel=1e-3)


def _telescope(force: float, steps: int) -> tuple[Mesentery, AxisDisplacement, np.ndarray]:
    """A tube of a colon's wall, held at the anus and pushed together from its end [N], and energies meanwhile [J]."""
    arcs = np.linspace(0.0, 0.1, 50)
    own = hang(arcs[:, None] * [0.0, 0.0, 1.0], arcs, np.full(50, 0.02), ())
    count = len(own.nodes)
    anchored, none = np.zeros(count), np.zeros(count)
    anchored[0] = 1e6
    own = mesentery.stack([own._replace(hold=anchored, support=none, upright=none)])
    grip = AttachmentPoints(np.maximum(arcs[-1] * np.linspace(0, 1, count), 1e-9)[None], np.zeros((1, count, 3)))
    now, forces, energies = moving_colon.at_rest(np, own, 1, float), _only(count, -1, [0, 0, -force])[None], []
    for _ in range(steps):
        now = moving_colon.step_axis(np, own, now, grip, forces, np.zeros((1, count, 2)), _STEP)
        energies.append(float(moving_colon.energy(np, own, now.pose)[0]) + force * float(now.pose[0, -1, 2]))
    return own, now, np.array(energies)


def test_folds_that_lie_against_each_other_are_pressed_like_a_solid() -> None:
    """A neo-Hookean ring of the wall's volume bears EA/3 (1/s^2 - s), and pleats their share; no energy is gained."""
    force = 30.0
    own, now, energies = _telescope(force, 250)
    stretch = float((moving_colon.shape_of(np, own, now.pose).lengths / own.lengths)[0, 5])
    left, tension, pleating = stretch / SHORTEST, float(own.tension[0, 0]), float(own.pleating[0])
    pressed = tension / SHORTEST / 3 * (1 / left**2 - left) + tension * pleating * (1 - stretch)
    assert stretch < SHORTEST
    assert pressed == pytest.approx(force, rel=0.01)
    assert np.abs(now.speed).max() < 1e-3
    assert np.diff(energies).max() < 1e-9


def _bent(angle: float) -> tuple[float, float, float]:
    """Change of direction at a bend by that angle [rad], of an edge along the last axis."""
    return np.sin(angle), 0.0, np.cos(angle) - 1


@pytest.mark.parametrize(
    ("stretch", "angle", "rest"), [(1.0, 0.4, 0.4), (0.4, 0.1, 0.4), (0.35, 1.2, 0.8), (1.2, 0.3, 0.0)]
)
def test_moment_and_tension_of_a_bend_are_slopes_of_its_energy(stretch: float, angle: float, rest: float) -> None:
    """And there is none of either at rest."""
    turn, bending, length, step = 2 * np.tan(rest / 2), 0.2, 0.02, 1e-6
    found = moving_colon.wall_bend(np, stretch * length, length, _bent(angle), turn, bending)

    def energy(stretch: float, angle: float) -> float:
        return moving_colon.bend_energy(np, stretch * length, length, 2 * np.sin(angle / 2), turn, bending)

    moment = np.dot(found.gradient, (np.cos(angle), 0.0, -np.sin(angle)))
    slopes = [
        (energy(stretch + s, angle + t) - energy(stretch - s, angle - t)) / 2e-6 for s, t in ((step, 0), (0, step))
    ]
    assert (found.tension * length, moment) == pytest.approx(slopes, rel=1e-6, abs=1e-9)
    if (stretch, angle) == (1.0, rest):
        assert (moment, energy(stretch, angle)) == pytest.approx((0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("stretch", [0.35, 0.6, 1.2])
def test_a_gathered_bend_keeps_its_curvature(stretch: float) -> None:
    """Folds are drawn together on both sides of a bend alike: over so much less length it bends by so much less.

    Colons whose every node kept its angle curled up as they were gathered, to a third of their radius, and pinched the
    shaft by up to 108 N that held them.
    """
    angle, bending = 0.4, 0.2
    turn = 2 * np.tan(angle / 2)
    found = moving_colon.wall_bend(np, stretch * 0.02, 0.02, _bent(stretch * angle), turn, bending)
    assert np.linalg.norm(found.gradient) < 0.03 * bending * angle


@pytest.mark.parametrize("angle", [0.1, 0.4, 1.2])
def test_folds_of_a_bend_are_not_pressed_at_rest_and_bend_less_where_they_lie_against_each_other(angle: float) -> None:
    """Not even where a bend is so sharp that its wall on the inside has no length."""
    width, length, turn = 0.015, 0.02, 2 * np.tan(angle / 2)
    packed = moving_colon.packed_bend(np, length, length, _bent(angle), turn, 0.2, width)
    assert (*packed.gradient, packed.tension) == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-9)
    itself = moving_colon.folded_bend(np, turn, 2 * width / length)
    folded = _bent(2 * np.arcsin(itself / 2))
    found = moving_colon.packed_bend(np, 0.9 * SHORTEST * length, length, folded, turn, 0.2, width)
    assert np.linalg.norm(found.gradient) < 1e-6
    chord, per = 2 * np.sin(angle / 2), 2 * width / length
    assert per * (chord - itself) == pytest.approx(min((1 - SHORTEST) * per * chord, 1 - SHORTEST))


def _wedge(stretch: float, angle: float) -> tuple[float, float, float, float]:
    """Energy of both halves of a wall at a bend [J], by what each is pressed together, and what enters there."""
    rigidity, width, rest = 0.2, 0.012, 0.01
    bent = width * 2 * np.sin(angle / 2) / rest
    modulus = moving_colon.STACKED * rigidity * (rest / width) ** 2
    halves = sum(max(SHORTEST - stretch + side * bent, 0.0) ** 2 for side in (-1, 1)) / 4
    return modulus * (halves - max(SHORTEST - stretch, 0.0) ** 2 / 2), rigidity, width, rest


@pytest.mark.parametrize(("stretch", "angle"), [(0.3, 0.02), (0.34, 0.3), (0.4, 0.3), (1.0, 0.9)])
def test_folds_on_the_inside_of_a_bend_are_pressed_as_both_halves_of_a_ring(stretch: float, angle: float) -> None:
    """Moment and force along the axis are slopes of the energy of two halves, each pressed by its own shortening."""
    energy, rigidity, width, rest = _wedge(stretch, angle)

    def bent(turned: float) -> tuple[float, float, float]:
        return np.cos(turned) - 1, np.sin(turned), 0.0

    at = 2 * stretch * rest, 2 * rest, bent(angle), 0.0, rigidity, width
    found, step = moving_colon.packed_bend(np, *at), 1e-6
    assert moving_colon.packed_energy(np, *at[:2], 2 * np.sin(angle / 2), *at[3:]) == pytest.approx(energy, rel=1e-9)
    moment = np.dot(found.gradient, (-np.sin(angle), np.cos(angle), 0.0))
    slope = (_wedge(stretch, angle + step)[0] - _wedge(stretch, angle - step)[0]) / (2 * step)
    assert moment == pytest.approx(slope, rel=1e-6)
    longer = (_wedge(stretch + step, angle)[0] - _wedge(stretch - step, angle)[0]) / (2 * step) / (2 * rest)
    assert found.tension == pytest.approx(longer, rel=1e-6, abs=1e-9)


def test_a_straight_colon_that_is_not_gathered_has_no_folds_to_press() -> None:
    found = moving_colon.packed_bend(np, 0.02, 0.02, (-0.02, 0.2, 0.0), 0.0, 0.2, 0.012)
    assert found == moving_colon.PackedBend((0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


def test_a_gathered_colon_hardly_kinks_where_it_is_pushed_aside() -> None:
    """Folds that are pressed together between two ends bend by 8 degrees where half a newton pushes; alone by 14."""
    count = 31
    held, pushed = np.zeros(count), np.zeros((count, 3))
    held[[0, -1]], pushed[15, 0] = 1e6, 0.5
    bending = np.full(count, 0.2)
    own = _straight(hold=held, bending=bending, widths=np.full(count, 0.012), tension=np.full(count - 1, 40.0))
    gathered = own._replace(nodes=own.nodes * [1.0, 1.0, 0.9 * SHORTEST])
    edges = np.diff(gathered.nodes[0] + crept(gathered, 2000, _STEP, pushed), axis=0)
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    sharpest = np.degrees(np.arccos(np.clip((edges[1:] * edges[:-1]).sum(axis=1), -1, 1)).max())
    assert sharpest < 9


@pytest.mark.parametrize("drag", [0.0, 50.0])
def test_contacts_on_a_gathered_bend_come_to_rest(drag: float) -> None:
    """Springs and dampers that press on flattened sections leave no more energy than there was; nothing trembles."""
    random, stiffness, damper = np.random.default_rng(0), 1500.0, 15.0
    colon = swept_colon(winding([(0.04, 0.0), (0.04, 1.6), (0.04, 0.0)]), name="bend")
    own = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables]).mesentery
    assert own is not None
    now = moving_colon.at_rest(np, own, 1, float)
    now.pose[..., :3] = -0.55 * (own.nodes - own.nodes[:, :1]) + random.normal(size=own.nodes.shape) * 3e-4
    count = own.nodes.shape[1]
    lever = random.normal(size=(1, 3 * count, 3))
    lever *= 0.02 / np.linalg.norm(lever, axis=-1, keepdims=True)
    grip = AttachmentPoints(np.linspace(0.005, float(own.spacing[0]) * (count - 1) - 0.005, 3 * count)[None], lever)

    def places() -> np.ndarray:
        moved = moving_colon.axis_places(np, own, now.pose, grip.arcs)
        return np.asarray(moved + moving_colon.directions(np, own, now.pose, grip.arcs, lever))

    inwards = -np.asarray(moving_colon.directions(np, own, now.pose, grip.arcs, lever))
    inwards /= np.linalg.norm(inwards, axis=-1, keepdims=True)
    held, energies = places() - 0.001 * inwards, []
    for _ in range(60):
        speed, deep = moving_colon.wall_speeds(np, own, now, grip), ((held - places()) * inwards).sum(-1)
        energies.append(float(moving_colon.energy(np, own, now.pose)[0]) + 0.5 * stiffness * float((deep**2).sum()))
        along = stiffness * deep - (damper - drag) * (speed * inwards).sum(-1)
        damping = np.broadcast_to([damper, drag], (*deep.shape, 2))
        now = moving_colon.step_axis(
            np, own, now, grip, along[..., None] * inwards - drag * speed, np.array(damping), _STEP
        )
    assert max(energies) == energies[0] > energies[-1]
    assert np.abs(now.speed[..., :3]).max() < 0.005


@pytest.mark.parametrize("steps", [600, pytest.param(300_000, marks=pytest.mark.thorough)])
def test_a_colon_that_is_let_go_gains_no_energy(steps: int) -> None:
    """Gathered, bent, twisted and with its weight on its side, it only loses energy, and comes to rest in the end."""
    random = np.random.default_rng(3)
    segments = (ColonSegment("rectum", 0.0, 0.06), ColonSegment("sigmoid", 0.06, 0.3))
    colon = replace(
        swept_colon(winding([(0.06, 0.0), (0.05, 1.4), (0.06, -1.2), (0.06, 0.0)]), name="s"), segments=segments
    )
    tables = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True, abdomen=Abdomen("left")).tables])
    own, walls = tables.mesentery, TableWalls(tables, 1, 1, radius=0.006)
    assert own is not None and walls.displacement is not None
    pose, count = walls.displacement.pose, own.nodes.shape[1]
    pose[0, :, :3] = -0.4 * (own.nodes[0] - own.nodes[0, :1]) + random.normal(size=(count, 3)) * 1e-3
    pose[0, :, 3:] = Rotation.from_rotvec(0.3 * random.normal(size=(count, 3))).as_quat(scalar_first=True)
    nothing = np.zeros((1, 0)), np.zeros((1, 0, 3)), np.zeros((1, 0, 3)), np.zeros((1, 0, 2))
    walls.move(np.zeros(1, int), nothing, _STEP)  # turns are brought along to where the axis goes in the first step
    energies = [float(moving_colon.energy(np, own, pose)[0])]
    for step in range(steps):
        walls.move(np.zeros(1, int), nothing, _STEP)
        if step < 40 or step % (steps // 60) == 0:
            energies.append(float(moving_colon.energy(np, own, pose)[0]))
    lost = energies[0] - energies[-1]
    assert lost > 1e-3
    assert np.diff(energies).max() < 1e-12 * lost + 1e-15
    assert steps < 300_000 or np.abs(walls.displacement.speed).max() < 1e-6


def test_a_clamped_tube_bends_like_a_beam() -> None:
    """F L^3 / 3 EI at the end of a cantilever, within 1 %: it begins half an edge before its second node."""
    count, rigidity = 16, 0.01
    clamped, bending = np.zeros(count), np.full(count, rigidity / 0.01)
    clamped[:2], bending[[0, -1]] = 1e6, 0.0
    own = _straight(0.15, hold=clamped, bending=bending, tension=np.full(count - 1, 1000.0))
    moved = _creep(own, _only(count, -1, [0.05, 0, 0]), 10000)[-1, 0]
    assert moved == pytest.approx(0.05 * 0.145**3 / (3 * rigidity), rel=0.01)


@pytest.mark.parametrize("over", [16.0, 100.0])
def test_no_pull_folds_a_tube_back_at_a_node(over: float) -> None:
    """An edge on a hinge B, pulled back by far more than B over its length: F x l = 2 B tan(t/2) (Bergou 2008)."""
    rigidity, length, steps = 0.01, 0.01, 1000
    held, bending = np.array([1e6, 1e6, 1e6, 0.0]), np.array([0.0, 0.0, rigidity, 0.0])
    thin = np.full(4, 1e-4)  # too thin for folds to meet on its inside
    own = _straight(0.03, hold=held, bending=bending, tension=np.full(3, 1e3), pleating=np.float64(1.0), widths=thin)
    force = over * rigidity / length * np.array([1e-3, 0.0, -1.0])
    moved = _creep(own, _only(4, -1, [*force]), steps)
    before, edge = np.diff(own.nodes[0] + moved, axis=0)[1:]
    angle = np.arccos(before @ edge / np.linalg.norm(before) / np.linalg.norm(edge))
    assert np.degrees(angle) < 175
    assert 2 * rigidity * np.tan(angle / 2) == pytest.approx(np.linalg.norm(np.cross(edge, force)), rel=1e-3)


def test_a_mesentery_is_slack_and_then_taut() -> None:
    """All nodes pushed alike: they move by the slack, and then by force over stiffness; a little support is felt."""
    count, force = 31, 0.3
    own = _straight(slack=np.full(count, 0.05), hold=np.full(count, 70.0), support=np.full(count, 1.0))
    moved = _creep(own, np.tile([force, 0, 0], (count, 1)), 1000)
    assert moved[:, 0] == pytest.approx((force + 70.0 * 0.05) / 71.0, rel=1e-3)
    assert np.abs(moved[:, 1:]).max() < 1e-9


def test_a_colon_that_turns_as_a_whole_stores_nothing_and_carries_its_wall_along() -> None:
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    field = lumen_table(colon, device_radius=0.006, with_mesentery=True)
    tables = pick(stack([field.tables]), np.array([0]))
    own = tables.mesentery
    assert own is not None
    free = own._replace(hold=0 * own.hold, support=0 * own.support, upright=0 * own.upright)
    turn, away = Rotation.from_rotvec([0.2, -0.5, 0.4]), np.array([0.02, 0.01, -0.03])
    place = turn.apply(own.nodes[0]) + away - own.nodes[0]
    quaternion = np.tile(turn.as_quat(scalar_first=True), (len(place), 1))
    pose = np.concatenate([place, quaternion], axis=1)[None]
    assert float(moving_colon.energy(np, free, pose)[0]) == pytest.approx(0.0, abs=1e-10)
    random = np.random.default_rng(0)
    arcs = random.uniform(0.02, 0.25, (1, 200))
    axis = np.array(
        [np.interp(arcs[0], field.tables.step * np.arange(len(field.tables.points)), c) for c in field.tables.points.T]
    ).T
    points = axis + random.normal(size=axis.shape) * 0.008
    to_current = moving_colon.to_current(np, tables, pose, points[None], arcs)[0]
    assert to_current == pytest.approx(turn.apply(points) + away, abs=2e-4)
    shape = moving_colon.shape_of(np, own, pose)
    back = moving_colon.to_reference(np, tables, pose, shape, to_current[None], arcs)
    assert np.abs(np.asarray(back)[0] - points).max() < 2e-6


def test_a_twisted_tube_turns_by_torque_over_stiffness() -> None:
    """T L / GJ, within 1 %: a friction couple at the wall, far from where the tube is held."""
    count, rigidity, couple = 31, 0.02, 0.004
    held = np.zeros(count)
    held[0] = 1e6
    own = _straight(torsion=np.full(count - 1, rigidity / 0.01), upright=held, hold=np.full(count, 1e6))
    arcs, lever = np.full((1, 2), 0.3), np.array([[[0.02, 0, 0], [-0.02, 0, 0]]])
    force = np.array([[[0, couple / 0.04, 0], [0, -couple / 0.04, 0]]])

    end, grip = moving_colon.at_rest(np, own, 1, float), AttachmentPoints(arcs, lever)
    for _ in range(500):
        end = moving_colon.step_axis(np, own, end, grip, force, np.zeros((1, 2, 2)), _STEP)
    turn = Rotation.from_quat(np.asarray(end.pose[0, :, 3:]), scalar_first=True).as_rotvec()
    assert turn[-1, 2] == pytest.approx(couple * 0.3 / rigidity, rel=0.01)
    assert turn[15, 2] == pytest.approx(couple * 0.15 / rigidity, rel=0.01)
    assert np.abs(turn[:, :2]).max() < 1e-9


def test_a_bend_that_closes_flattens_and_stays_one_to_one() -> None:
    """A tube 40 mm wide around ever tighter bends, down to a third of its radius: its inside never turns over."""
    own = _straight()
    arcs = np.linspace(0.02, 0.28, 53)
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    wall = 0.02 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(16)])
    for radius in (0.1, 0.03, 0.02, 0.01, 0.007):
        along = np.clip((np.asarray(own.nodes[0])[:, 2] - 0.15) / radius, -np.pi / 2, np.pi / 2)
        bent = np.column_stack([radius * (1 - np.cos(along)), 0 * along, radius * np.sin(along)])
        beyond = np.asarray(own.nodes[0])[:, 2] - 0.15 - radius * along
        bent += beyond[:, None] * np.column_stack([np.sin(along), 0 * along, np.cos(along)])
        pose = np.zeros((1, 31, 7))
        pose[0, :, :3], pose[0, :, 3] = bent - own.nodes[0], 1.0
        each, lever = np.repeat(arcs, 16)[None], np.tile(wall, (53, 1))[None]

        def at(change: list[float], pose: np.ndarray = pose, each: np.ndarray = each, lever: np.ndarray = lever) -> Any:
            further, step = each + change[2], np.array([*change[:2], 0.0])
            moved = moving_colon.axis_places(np, own, pose, further)
            return np.asarray(moved + moving_colon.directions(np, own, pose, further, lever + step))[0]

        slopes = [(at(step) - at([-part for part in step])) / 2e-6 for step in (1e-6 * np.eye(3)).tolist()]
        assert np.linalg.det(np.stack(slopes, axis=-1)).min() > 0, radius


def test_forces_on_the_wall_do_the_work_that_its_motion_says() -> None:
    """Power of random forces at random places of the wall, on the wall's own speed there, and of drag on the nodes."""
    count = 31
    own = _straight(tension=np.zeros(count - 1))
    random = np.random.default_rng(1)
    place = _poses(random.normal(size=(1, count, 3)) * 0.003, random)
    own = own._replace(widths=own.widths + 0.02)
    grip = AttachmentPoints(random.uniform(0.01, 0.29, (1, 50)), random.normal(size=(1, 50, 3)) * 0.015)
    force = random.normal(size=(1, 50, 3))
    own = own._replace(pleating=0 * own.pleating)
    moved = moving_colon.step_axis(
        np, own, AxisDisplacement(place, np.zeros((1, count, 4))), grip, force, np.zeros((1, 50, 2)), _STEP
    )
    felt = moving_colon.wall_speeds(np, own, AxisDisplacement(place, moved.speed), grip)
    lost = (own.drag[..., None] * moved.speed[..., :3] ** 2).sum() + (own.turn_drag * moved.speed[..., 3] ** 2).sum()
    assert float((force * felt).sum()) == pytest.approx(float(lost), rel=1e-9)


def _poses(place: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """With turns by up to a quarter of a radian, which nobody has brought along."""
    turns = Rotation.from_rotvec(random.uniform(-0.15, 0.15, (place.shape[1], 3))).as_quat(scalar_first=True)
    return np.concatenate([place, turns[None]], axis=-1)


def _random_bend(gathered: float = 1.0) -> tuple[Mesentery, np.ndarray, np.random.Generator]:
    """A bent colon, pulled about by up to its slack, and twisted; or gathered to about a share of its length."""
    random = np.random.default_rng(3)
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    tables = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    own = tables.mesentery
    assert own is not None
    own = own._replace(slack=0.5 * random.uniform(0, 0.01, own.slack.shape), widths=own.widths + 0.01)
    own = own._replace(load=random.normal(size=own.load.shape) * 0.1, pressure_lost=np.array([2000.0]))
    moved = random.normal(size=own.nodes.shape) * 0.004 * gathered
    return own, _poses(moved + (gathered - 1) * (own.nodes - own.nodes[:, :1]), random), random


def _settled(own: Mesentery, pose: np.ndarray) -> np.ndarray:
    """Pose of the colon, with its turns brought along."""
    shape = moving_colon.shape_of(np, own, pose)
    return np.concatenate([pose[..., :3], shape.turns], axis=-1)


def _changed(own: Mesentery, pose: np.ndarray, place: Any, angle: Any) -> Any:
    """The pose with its nodes elsewhere and then twisted about their tangents [rad]."""
    shape = moving_colon.shape_of(jnp, own, jnp.concatenate([place, pose[..., 3:]], axis=-1))
    turn = shape.turns[..., 0], tuple(shape.turns[..., 1 + i] for i in range(3))
    real, part = twisted(turn, tuple(shape.tangents[..., i] for i in range(3)), angle)
    return jnp.concatenate([place, real[..., None], jnp.stack(part, axis=-1)], axis=-1)


@cache
def _slopes() -> Any:
    """Slopes of the energy by places and angles, compiled once."""

    def energy(place: Any, angle: Any, own: Mesentery, pose: Any) -> Any:
        return moving_colon.energy(jnp, own, _changed(own, pose, place, angle)).sum()

    return jitted(jax.grad(energy, argnums=(0, 1)))


@cache
def _slopes_of_work() -> Any:
    """Those of the work of couples."""

    def work(place: Any, angle: Any, own: Mesentery, pose: Any, couples: Any) -> Any:
        shape = moving_colon.shape_of(jnp, own, _changed(own, pose, place, angle))
        section = shape.turns[..., 0], tuple(shape.turns[..., 1 + i] for i in range(3))
        section = *section, shape.flats, tuple(shape.acrosses[..., i] for i in range(3))
        images = [jnp.stack(carried(section, tuple(axis)), axis=-1) for axis in np.eye(3)]
        return (jnp.stack(images, axis=-1) * couples).sum()

    return jitted(jax.grad(work, argnums=(0, 1)))


@pytest.mark.parametrize("gathered", [1.0, 0.35])
def test_spring_forces_are_the_slope_of_the_energy_and_couples_that_of_their_work(gathered: float) -> None:
    """Against automatic differentiation: -dE/dx of the energy, and d/dx of sum f . R(x) v for forces on the wall."""
    own, pose, random = _random_bend(gathered)
    pose = _settled(own, pose)
    place, still = jnp.asarray(pose[..., :3]), jnp.zeros(pose.shape[:2])
    none = np.zeros((*pose.shape[:2], 3, 3))
    forces = moving_colon.spring_forces(np, own, pose, none)
    with unchecked():
        slopes = _slopes()(place, still, own, pose)
    for force, slope in zip(forces, slopes, strict=True):
        assert np.abs(force + np.asarray(slope)).max() < 1e-9 * np.abs(force).max()
    couples = random.normal(size=none.shape)

    with unchecked():
        expected = _slopes_of_work()(place, still, own, pose, couples)
    for with_them, without, slope in zip(
        moving_colon.spring_forces(np, own, pose, couples), forces, expected, strict=True
    ):
        assert np.abs(with_them - without - np.asarray(slope)).max() < 1e-9 * np.abs(slope).max()


def test_speeds_of_the_wall_are_the_rate_of_its_places() -> None:
    """Against automatic differentiation along the nodes' speeds."""
    own, pose, random = _random_bend()
    pose = _settled(own, pose)
    speed = random.normal(size=(*pose.shape[:2], 4)) * 0.01
    grip = AttachmentPoints(random.uniform(0.01, 0.25, (1, 40)), random.normal(size=(1, 40, 3)) * 0.015)
    found = moving_colon.wall_speeds(np, own, AxisDisplacement(pose, speed), grip)

    def places(place: Any, angle: Any) -> Any:
        now = _changed(own, pose, place, angle)
        moved = moving_colon.axis_places(jnp, own, now, grip.arcs)
        return moved + moving_colon.directions(jnp, own, now, grip.arcs, grip.lever)

    at = jnp.asarray(pose[..., :3]), jnp.zeros(pose.shape[:2])
    rates = jnp.asarray(speed[..., :3]), jnp.asarray(speed[..., 3])
    with unchecked():
        expected = jitted(lambda *about: jax.jvp(places, *about)[1])(at, rates)
    assert np.abs(found - np.asarray(expected)).max() < 1e-9 * np.abs(found).max()


def test_numpy_and_jax_step_alike() -> None:
    own, pose, random = _random_bend()
    grip = AttachmentPoints(random.uniform(-0.01, 0.25, (1, 40)), random.normal(size=(1, 40, 3)) * 0.015)
    displacement = AxisDisplacement(pose, random.normal(size=(*pose.shape[:2], 4)) * 0.01)
    force, damping = random.normal(size=(1, 40, 3)), random.uniform(0, 20, (1, 40, 2))
    stepped = jitted(
        lambda own, moved, grip, force, damping: moving_colon.step_axis(jnp, own, moved, grip, force, damping, _STEP)
    )
    with unchecked():
        one = moving_colon.step_axis(np, own, displacement, grip, force, damping, _STEP)
        other = stepped(own, displacement, grip, force, damping)
    for mine, theirs in zip(one, other, strict=True):
        assert np.abs(mine - np.asarray(theirs)).max() < 1e-12 + 1e-10 * np.abs(mine).max()


def test_compiled_loops_are_the_law() -> None:
    """Look-ups, wall speeds and a step of the axis, as in numpy to rounding."""
    random = np.random.default_rng(4)
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    stacked = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    assert stacked.mesentery is not None
    stacked = stacked._replace(mesentery=stacked.mesentery._replace(pressure_lost=np.array([2000.0])))
    walls = TableWalls(stacked, 1, 60, radius=0.006)
    world, tables, displacement = np.array([0]), pick(stacked, np.array([0])), walls.displacement
    own = tables.mesentery
    assert own is not None and displacement is not None
    arcs = np.linspace(-0.02, 0.3, 60)[None]
    points = axis_at(np, tables, arcs) + random.normal(size=(1, 60, 3)) * 0.008
    walls.begin(world, world, arcs)
    displacement.pose[:] = _poses(random.normal(size=(*displacement.pose.shape[:2], 3)) * 0.003, random)
    displacement.speed[:] = random.normal(size=displacement.speed.shape) * 0.01
    walls.look(world, points)
    found, grip = moving_colon.query(np, tables, displacement, points, arcs, np.full((1, 1), 0.006))
    speeds = moving_colon.wall_speeds(np, own, displacement, grip)
    for mine, theirs in zip((walls.arcs, walls.depth, walls.inwards, walls.wall_speed), (*found, speeds), strict=True):
        assert np.abs(mine - theirs).max() < 1e-12
    force, damping = random.normal(size=(1, 60, 3)), random.uniform(0, 20, (1, 60, 2))
    expected = moving_colon.step_axis(np, own, displacement, grip, force, damping, _STEP)
    walls.step_axis(world, force, damping, _STEP)
    assert np.abs(displacement.pose - expected.pose).max() < 1e-12
    assert np.abs(displacement.speed - expected.speed).max() < 1e-10
    fixed = TableWalls(stacked._replace(mesentery=None), 1, 60, radius=0.006)
    fixed.begin(world, world, arcs)
    fixed.look(world, points)
    still = query(np, tables, points, arcs)
    for mine, theirs in zip((fixed.arcs, fixed.depth, fixed.inwards), still, strict=True):
        assert np.abs(mine - theirs).max() < 1e-12


def test_the_solver_solves() -> None:
    random = np.random.default_rng(2)
    ties, more, right = random.uniform(0, 5, (3, 46)), random.uniform(0.1, 1, (3, 47)), random.normal(size=(3, 47, 3))
    below, above = np.pad(ties, ((0, 0), (1, 0))), np.pad(ties, ((0, 0), (0, 1)))
    with unchecked():
        found = jitted(partial(moving_colon.solve_tridiagonal, jnp))(-below, more + below + above, -above, right)
    for world in range(3):
        matrix = np.diag((more + below + above)[world]) - np.diag(ties[world], 1) - np.diag(ties[world], -1)
        assert np.asarray(found[world]) == pytest.approx(np.linalg.solve(matrix, right[world]), rel=1e-9, abs=1e-12)


def _bent_bank(**changed: Any) -> ScopeColonSet:
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.2, 0.0)]), name="bend")
    return build_bank([colon], named_design("adult"), replace(_OPTIONS, **changed))


def _pushed(bank: ScopeColonSet, tables: Tables, steps: int = 1200) -> LinearBackend:
    """A scope pushed in without friction, and then held."""
    backend, one = LinearBackend(bank.scene, tables, worlds=1, real=np.float64), np.ones(1)
    backend.reset(np.zeros(1, int), np.zeros(1, int), Conditions(0 * one, bank.scene.options.wall_stiffness * one, one))
    for rate in (0.03, 0.0):
        assert backend.step(Controls(rate * one, 0 * one, np.zeros((1, 4))), steps).all()
    return backend


@cache
def _pushed_in_a_fixed_colon() -> Readings:
    fixed = _bent_bank(mesentery=False)
    return _pushed(fixed, fixed.tables).read()


def test_a_colon_that_is_held_firmly_is_one_that_is_fixed() -> None:
    """Held by 1 N/um a node: tip within 0.2 mm and forces within 1 % of those in a colon fixed in space."""
    still, bank = _pushed_in_a_fixed_colon(), _bent_bank()
    own = bank.tables.mesentery
    assert own is not None
    seen = _pushed(bank, bank.tables._replace(mesentery=own._replace(hold=own.hold * 0 + 1e6))).read()
    assert np.linalg.norm(seen.tip - still.tip) < 2e-4
    assert seen.link_forces.sum() == pytest.approx(still.link_forces.sum(), rel=0.01)


def test_a_colon_at_rest_holds_what_the_scope_presses() -> None:
    """In balance, the mesentery's pull is the wall's force on the scope; a colon that gives way presses less."""
    bank = _bent_bank()
    backend = _pushed(bank, bank.tables)
    state, own = backend.state(), bank.tables.mesentery
    assert own is not None and state.displacement is not None
    place = state.displacement.pose[..., :3]
    moved = np.linalg.norm(place, axis=-1)
    pull = (own.hold * np.maximum(moved - own.slack, 0.0) / np.maximum(moved, 1e-9) + own.support)[..., None] * place
    # The handle and the anus hold the scope: its own balance is the wall's force on it.
    model, data = backend.world_data(0)
    spheres = data.geom_xpos[[model.geom(f"wall/sphere_{i:04d}").id for i in range(len(bank.scene.samples))]]
    tables, radius = pick(bank.tables, np.zeros(1, int)), np.full((1, 1), bank.scene.cable.radius)
    found, _ = moving_colon.query(np, tables, state.displacement, spheres[None], state.arcs[:, :-1], radius)
    on_scope = (state.normal[..., None] * found.inwards).sum(axis=1)[0]
    assert np.linalg.norm(on_scope) > 1.0
    assert pull.sum(axis=1)[0] == pytest.approx(-on_scope, abs=0.05 * float(np.linalg.norm(on_scope)))
    assert 0.001 < moved.max() < 0.05
    assert backend.read().link_forces.max() < _pushed_in_a_fixed_colon().link_forces.max()


def test_what_cannot_move_a_colon_says_so() -> None:
    with pytest.raises(InvalidOptionError, match="fixed in space"):
        SceneOptions(wall_law="planes", segment_stiffness=(("rectum", 2000.0),), mesentery=True)
    bank = build_bank([straight_tube()], named_design("adult"), _OPTIONS)
    still = build_bank([straight_tube()], named_design("adult"), replace(_OPTIONS, mesentery=False))
    with pytest.raises(UnsupportedSceneError, match="or none"):
        stack([bank.tables, still.tables])
