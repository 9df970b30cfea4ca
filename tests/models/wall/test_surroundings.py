"""An envelope and breath around a colon that moves: forces against energies, and balances that are known."""

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runtime_types import unchecked
from scipy.spatial.transform import Rotation

from haustra.assets import asset
from haustra.envs.sim.linear.layout import AXIS
from haustra.envs.sim.linear.pack import pack_axis
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.injury.pain import axis_tensions
from haustra.models.wall import moving_colon
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import lumen_table, pick, stack
from haustra.models.wall.mesentery import Mesentery, hang, seen_from
from haustra.models.wall.mesentery import stack as stacked
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement
from haustra.models.wall.surroundings import SIDES
from haustra.models.wall.table_wall import TableWalls
from haustra.quantity import load_quantities
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.models.wall.quickly import jitted

_BOTH = Abdomen(envelope=True, breathing=True)
_ROOTED = Abdomen(envelope=True, breathing=True, rooted=True)
_NUMBERS = {name: each.value for name, each in load_quantities(asset("numbers/mesentery.toml")).items()}
_MARGIN, _WHOLE = _NUMBERS["mesentery.envelope.margin"], 0.5 / _NUMBERS["mesentery.breath.rate"]
"""Margin of the envelope [m], and when a whole breath is in [s]."""


@pytest.fixture(autouse=True)
def _double_precision():
    with jax.enable_x64(True):
        yield


def _bow(abdomen: Abdomen = _BOTH) -> Mesentery:
    """A colon in a bow from the anus to the left, whose middle hangs on a sigmoid's mesentery."""
    turns = np.linspace(0.0, np.pi, 400)
    points = 0.12 * np.column_stack([1 - np.cos(turns), 0.1 * turns, np.sin(turns)])
    arcs = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    parts = [ColonSegment("rectum", 0.0, 0.1), ColonSegment("sigmoid", 0.1, 0.3), ColonSegment("descending", 0.3, 0.4)]
    return hang(points, arcs, np.full(400, 0.02), parts, abdomen=abdomen)


def _about(own: Mesentery) -> tuple[np.ndarray, np.ndarray]:
    """Poses that press on every side of the envelope, and turns between them."""
    random = np.random.default_rng(5)
    away = random.uniform(-1, 1, (1, len(own.nodes), 3)) * (own.room[:, 3:] + own.room[:, :3])
    away = away @ own.body
    assert all(((along * away[0] @ own.body.T) > own.room[:, side:][:, :3]).any() for side, along in ((0, -1), (3, 1)))
    return np.concatenate([away, np.ones((1, len(own.nodes), 1)), np.zeros((1, len(own.nodes), 3))], axis=2), away


def _step(xp: Any, own: Mesentery, now: AxisDisplacement, time: float, h: float = 0.02) -> AxisDisplacement:
    grip, none = AttachmentPoints(np.zeros((1, 1)), np.zeros((1, 1, 3))), np.zeros((1, 1, 3))
    with unchecked():
        step = partial(moving_colon.step_axis, xp)
        return (step if xp is np else jitted(step))(own, now, grip, none, none[..., :2], h, time=np.full(1, time))


def _settled(own: Mesentery, *, time: float, steps: int = 40) -> np.ndarray:
    """Displacements of the nodes once nothing moves, with the breath held as it is at a time [m]."""
    many = stacked([own])
    now = moving_colon.at_rest(np, many, 1, float)
    for _ in range(steps):
        now = _step(np, many, now, time, 1.0)  # balance does not depend on the step
    return now.pose[0, :, :3]


def test_forces_are_the_slope_of_the_energy_in_any_coordinates() -> None:
    """Against automatic differentiation to 1e-9, half-way through a breath, with every side of the envelope pressed."""
    turn = Rotation.from_rotvec([0.4, -1.0, 0.7]).as_matrix()

    def energy(place: Any, own: Mesentery, pose: Any, time: Any) -> Any:
        return moving_colon.energy(jnp, own, jnp.concatenate([place, pose[..., 3:]], axis=-1), time).sum()

    slope_of = jitted(jax.grad(energy))
    for own in (_bow(), _bow(_ROOTED), seen_from(_bow(_ROOTED), np.array([0.1, 0.2, 0.3]), turn)):
        pose, _ = _about(own)
        own, time = stacked([own]), np.full(1, 0.4 * _WHOLE)
        plain = own._replace(tension=0 * own.tension, bending=0 * own.bending, torsion=0 * own.torsion)
        plain = plain._replace(upright=0 * own.upright)  # the axis' own springs have their test
        none = np.zeros((*pose.shape[:2], 3, 3))
        forces, _ = moving_colon.spring_forces(np, plain, pose, none, time)
        ring = _ring_force(plain, pose)
        with unchecked():
            slope = -np.asarray(slope_of(jnp.asarray(pose[..., :3]), plain, pose, time))
        assert np.abs(forces - slope).max() < 1e-9 * np.abs(forces).max()
        assert np.abs(forces - ring).max() > 1.0


def _ring_force(own: Mesentery, pose: np.ndarray) -> np.ndarray:
    """Forces without surroundings."""
    return moving_colon.spring_forces(np, own, pose, np.zeros((*pose.shape[:2], 3, 3)))[0]


def test_a_colon_at_rest_has_room_and_stays_there_until_it_breathes() -> None:
    own = _bow()
    assert own.surrounded and not _bow(Abdomen()).surrounded
    assert own.room.min() == pytest.approx(_MARGIN) and own.room.shape[1] == len(SIDES)
    assert np.abs(_settled(own, time=0.0, steps=20)).max() < 1e-9


def test_a_loop_that_is_pressed_comes_to_rest_where_the_wall_bears_it() -> None:
    """F = K d within 1 %, with K of the wall that is pressed: room to it, and then F / K."""
    for side, name in enumerate(SIDES):
        own = _bow(Abdomen(envelope=True))
        count, front = len(own.nodes), "front" if name == "front" else "firm"
        way = (-1.0 if side < 3 else 1.0) * np.eye(3)[side % 3]
        free = np.zeros(count)
        own = own._replace(hold=free, support=free, upright=free, bending=free, load=np.tile(0.5 * way, (count, 1)))
        own = own._replace(tension=np.zeros(count - 1), torsion=np.zeros(count - 1))
        stiffness = _NUMBERS[f"mesentery.envelope.{front}"] * float(own.spacing)
        found = _settled(own, time=0.0, steps=60) @ way
        assert found == pytest.approx(own.room[:, side] + 0.5 / stiffness, rel=0.01), name


def test_breath_takes_a_colon_that_is_held_along_most_below_the_diaphragm() -> None:
    """A colon that has grown to what moves goes with it: the excursion at its highest node, nothing at the anus."""
    turns = np.linspace(0.0, np.pi / 2, 400)
    points = 0.3 * np.column_stack([1 - np.cos(turns), 0 * turns, np.sin(turns)])
    own = hang(points, 0.3 * turns, np.full(400, 0.02), (), abdomen=Abdomen(breathing=True))
    soft = np.zeros(len(own.nodes) - 1)
    own = own._replace(tension=soft, bending=0 * own.bending, support=0 * own.support, torsion=soft)
    moved = _settled(own, time=_WHOLE)
    share = (own.nodes[:, 2] - own.nodes[0, 2]) / np.ptp(own.nodes[:, 2])
    assert moved == pytest.approx(-_NUMBERS["mesentery.breath.excursion"] * np.outer(share, [0, 0, 1]), abs=1e-5)
    assert np.abs(_settled(own, time=2 * _WHOLE)).max() < 1e-9


def test_a_mesentery_that_breath_moves_hurts_by_how_far_it_is_drawn_from_there() -> None:
    own, radius = _bow(), np.full(len(_bow().nodes), 0.02)
    still = np.zeros((1, len(own.nodes), 7))
    along = -own.sway[None, :, None] * own.body[2]
    taken = np.concatenate([along, still[..., 3:]], axis=2)
    _, held = axis_tensions(np, own, taken, radius, np.full(1, _WHOLE))
    assert held.max() < 1e-3 < axis_tensions(np, own, still, radius, np.full(1, _WHOLE))[1].max()
    assert axis_tensions(np, own, still, radius)[1].max() < 1e-3


def test_programs_that_began_without_refuse_surroundings_roots_and_loops_that_touch() -> None:
    assert pack_axis(stacked([_bow(Abdomen())]), AXIS).shape[1] == len(AXIS)
    for around in (Abdomen(envelope=True), Abdomen(breathing=True), Abdomen(rooted=True), Abdomen(loops_touch=True)):
        with pytest.raises(InvalidOptionError, match="begin with them"):
            pack_axis(stacked([_bow(around)]), AXIS)


@pytest.mark.parametrize("around", [_BOTH, _ROOTED], ids=["imaged", "rooted"])
def test_numpy_jax_and_compiled_loops_step_alike(around: Abdomen) -> None:
    random = np.random.default_rng(4)
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    colon = replace(colon, segments=(ColonSegment("sigmoid", 0.05, colon.centreline.length),))
    tables = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True, abdomen=around).tables])
    own = pick(tables, np.array([0])).mesentery
    assert own is not None and own.rooted == around.rooted
    walls = TableWalls(tables, 1, 1, radius=0.006)
    now = walls.displacement
    assert now is not None
    now.pose[..., :3] += random.normal(size=now.pose[..., :3].shape) * 0.02
    now.speed[:] = random.normal(size=now.speed.shape) * 0.01
    walls.time[:] = 0.3 * _WHOLE
    start = AxisDisplacement(now.pose.copy(), now.speed.copy())
    one, other = (_step(xp, own, start, 0.3 * _WHOLE, 0.004) for xp in (np, jnp))
    walls.step_axis(np.array([0]), np.zeros((1, 1, 3)), np.zeros((1, 1, 2)), 0.004)
    bare = _step(np, own._replace(walls=0 * own.walls, breaths=0 * own.breaths, sway=0 * own.sway), start, 0.0, 0.004)
    assert walls.time[0] == pytest.approx(0.3 * _WHOLE + 0.004)
    assert np.abs(one.pose - bare.pose).max() > 1e-5
    for mine, theirs, compiled in zip(one, other, now, strict=True):
        assert np.abs(mine - np.asarray(theirs)).max() < 1e-10
        assert np.abs(mine - compiled).max() < 1e-10
