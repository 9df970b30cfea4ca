"""Loops of a colon that press on each other: forces against energies, a balance that is known, and no way through."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from runtime_types import unchecked

from haustra.assets import asset
from haustra.models.wall import loops, moving_colon
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import lumen_table, pick, stack
from haustra.models.wall.mesentery import Mesentery, hang
from haustra.models.wall.mesentery import stack as stacked
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement
from haustra.models.wall.table_wall import TableWalls
from haustra.quantity import load_quantities
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.models.wall.quickly import jitted

_RADIUS, _WALL = 0.02, 0.0016
_STIFFNESS = load_quantities(asset("numbers/mesentery.toml"))["mesentery.touch"].value
_AROUND = Abdomen(loops_touch=True)


@pytest.fixture(autouse=True)
def _double_precision():
    with jax.enable_x64(True):
        yield


def _curve(points: list[tuple[float, float, float]], **changed: Any) -> Mesentery:
    """A colon along straight pieces between points, every node of which is free but for what is changed; a world."""
    corners = np.array(points)
    arcs = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    fine = np.linspace(0.0, arcs[-1], 2000)
    line = np.column_stack([np.interp(fine, arcs, column) for column in corners.T])
    own = hang(line, fine, np.full(2000, _RADIUS), (), abdomen=_AROUND)
    count = len(own.nodes)
    free = {name: np.zeros(count) for name in ("hold", "support", "upright", "bending")}
    edges = {name: np.zeros(count - 1) for name in ("tension", "torsion")}
    return stacked([own._replace(**{**free, **edges, **changed})])


def _step(xp: Any, own: Mesentery, now: AxisDisplacement, found: Any, h: float) -> AxisDisplacement:
    grip, none = AttachmentPoints(np.zeros((1, 1)), np.zeros((1, 1, 3))), np.zeros((1, 1, 3))
    with unchecked():
        step = partial(moving_colon.step_axis, xp, found=found)
        return (step if xp is np else jitted(step))(own, now, grip, none, none[..., :2], h)


def _driven(own: Mesentery, steps: int, h: float) -> np.ndarray:
    """Places of the nodes after steps in which partners are looked for as steppers do [m]."""
    now, found, way = moving_colon.at_rest(np, own, 1, float), np.zeros((1, 0), int), np.inf
    for _ in range(steps):
        if way >= loops.MARGIN:
            found, way = loops.partners(own, now.pose), 0.0
        now = _step(np, own, now, found, h)
        way += loops.nearer(np.linalg.norm(now.speed[..., :3], axis=-1).max(), h)
    return own.nodes[0] + now.pose[0, :, :3]


def _hairpin(width: float, **changed: Any) -> Mesentery:
    """Two legs along z so far apart, and the way from one to the other."""
    return _curve([(0, 0, 0), (0, 0, 0.3), (0, 0.2, 0.3), (width, 0.2, 0.3), (width, 0, 0.3), (width, 0, 0)], **changed)


def _legs(own: Mesentery) -> tuple[np.ndarray, np.ndarray]:
    """Middles of both legs."""
    x, y, z = own.nodes[0].T
    inside = (np.abs(y) < 1e-9) & (z > 0.05) & (z < 0.2)
    return inside & (x < 1e-9), inside & (x > 1e-9)


def _crossing(random: np.random.Generator) -> tuple[Mesentery, np.ndarray]:
    """Legs 40 mm apart that touch at 43 mm, as they were imaged further apart, pulled about by some millimetres."""
    own = _hairpin(0.06)
    pose = np.zeros((1, own.nodes.shape[1], 7))
    pose[..., 3] = 1.0
    pose[..., :3] = random.normal(size=own.nodes.shape) * 0.002
    pose[0, _legs(own)[1], 0] -= 0.04
    return own, pose


def test_forces_are_the_slope_of_the_energy_and_opposite_and_equal() -> None:
    """Against automatic differentiation to 1e-9, also where loops are nearly flat; their sum is nothing to rounding."""
    own, pose = _crossing(np.random.default_rng(1))
    found = loops.partners(own, pose)
    forces, _, _ = loops.touching(np, own, pose, found)

    def energy(place: Any) -> Any:
        return loops.touching(jnp, own, jnp.concatenate([place, pose[..., 3:]], axis=-1), found)[2].sum()

    with unchecked():
        slope = jitted(jax.grad(energy))(jnp.asarray(pose[..., :3]))
    assert np.abs(forces).max() > 1.0 and (found >= 0).sum() > 20
    assert np.abs(forces + np.asarray(slope)).max() < 1e-9 * np.abs(forces).max()
    assert np.abs(forces.sum(axis=1)).max() < 1e-12 * np.abs(forces).sum()
    turning = np.cross(own.nodes + pose[..., :3], forces).sum(axis=1)
    assert np.abs(turning).max() < 1e-9 * np.abs(forces).sum()


def test_two_loops_that_are_pushed_together_come_to_rest_where_they_bear_it() -> None:
    """F = K d to 1 %, by the stiffness per length of two walls, d counted from where they touch.

    Something weak around the legs keeps them from giving way sideways, and bears what it bears.
    """
    force, weak = 100.0, 30.0
    own = _hairpin(0.06)
    own = own._replace(support=np.full_like(own.support, weak))
    left, right = _legs(own)
    load = np.zeros((1, *own.nodes.shape[1:]))
    load[0, left, 0], load[0, right, 0] = force * own.spacing[0], -force * own.spacing[0]
    places = _driven(own._replace(load=load), 400, 0.002)
    inner = [np.flatnonzero(leg)[6:-6] for leg in (left, right)]
    apart = places[inner[1], 0].mean() - places[inner[0], 0].mean()
    borne = force - weak / own.spacing[0] * places[inner[0], 0].mean()
    assert borne > 0.3 * force
    assert 2 * (_RADIUS + _WALL) - apart == pytest.approx(borne / _STIFFNESS, rel=0.01)


def test_loops_that_lie_against_each_other_at_rest_are_in_balance() -> None:
    for width in (0.02, 0.035, 0.043):
        own = _hairpin(width)
        assert np.abs(_driven(own, 40, 0.02) - own.nodes[0]).max() < 1e-9
        thin = np.median(own.girth[0, _legs(own)[0]])
        assert thin == pytest.approx(min(width / 2, _RADIUS + _WALL), rel=0.02)


@pytest.mark.parametrize("force", [pytest.param(10.0, marks=pytest.mark.thorough), 60.0])
def test_a_loop_that_is_driven_across_another_never_comes_through(force: float) -> None:
    """More than a hand pushes with, on 5 cm of it: the loop below is held as what has grown to the back wall is."""
    corners = [(0, -0.15, 0), (0, 0.15, 0), (0, 0.3, 0.1), (0.07, 0.3, 0.3), (0.07, 0, 0.3), (0.07, 0, -0.15)]
    own = _curve(corners)
    x, y, z = own.nodes[0].T
    below, above = (x < 1e-9) & (z < 1e-9), (x > 0.0699) & (np.abs(y) < 1e-3) & (z < 0.25)
    pushed, held = above & (np.abs(z) < 0.026), above & (np.abs(z) > 0.13)
    hold, load = np.zeros(len(x)), np.zeros((len(x), 3))
    hold[below | held], load[pushed, 0] = 20_000.0 * own.spacing[0], -force / pushed.sum()
    tight = np.full((1, len(x) - 1), 500.0)  # so that what is pushed does not slip aside
    places = _driven(own._replace(hold=hold[None], load=load[None], tension=tight), 700, 0.004)
    ways = places[above][None] - places[below][:, None]
    nearest = ways.reshape(-1, 3)[np.linalg.norm(ways, axis=2).argmin()]
    assert nearest[0] > 0.5 * np.linalg.norm(nearest) > 0.0025, "it is still above"
    assert places[pushed][:, 0].mean() < 0.06, "it was moved"


def test_a_colon_that_is_gathered_does_not_touch_itself_along_the_axis() -> None:
    own = _curve([(0, 0, 0), (0, 0, 0.6)])
    pose = np.zeros((1, own.nodes.shape[1], 7))
    pose[..., 2] = -0.6 * own.nodes[..., 2]
    assert (loops.partners(own, pose) == -1).all() or not loops.touching(np, own, pose, loops.partners(own, pose))[
        0
    ].any()


def test_numpy_jax_and_compiled_loops_step_alike() -> None:
    colon = swept_colon(winding([(0.15, 0.0), (0.08, np.pi), (0.15, 0.0)]), name="hairpin")
    tables = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True, abdomen=_AROUND).tables])
    own = pick(tables, np.array([0])).mesentery
    assert own is not None and own.touching
    own = own._replace(girth=own.girth + 0.01)
    walls = TableWalls(tables._replace(mesentery=own), 1, 1, radius=0.006)
    now = walls.displacement
    assert now is not None
    now.pose[..., :3] += np.random.default_rng(4).normal(size=now.pose[..., :3].shape) * 0.002
    start, found = AxisDisplacement(now.pose.copy(), now.speed.copy()), loops.partners(own, now.pose)
    assert (found >= 0).sum() > 10
    one, other = (_step(xp, own, start, found, 0.004) for xp in (np, jnp))
    bare = _step(np, own, start, None, 0.004)
    walls.step_axis(np.array([0]), np.zeros((1, 1, 3)), np.zeros((1, 1, 2)), 0.004)
    assert np.abs(one.pose - bare.pose).max() > 1e-5
    for mine, theirs, compiled in zip(one, other, now, strict=True):
        assert np.abs(mine - np.asarray(theirs)).max() < 1e-10
        assert np.abs(mine - compiled).max() < 1e-10
