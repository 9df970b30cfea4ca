"""A colon that moves on its mesentery: rods, springs and balances that are known."""

from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.scope_bank import ScopeBank, build_bank
from haustra.envs.sim.state import Controls, Readings
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions
from haustra.models.wall import mesentery, moving_colon
from haustra.models.wall.lumen_table import Tables, axis_at, lumen_table, pick, query, stack
from haustra.models.wall.mesentery import Mesentery, hang
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement
from haustra.models.wall.table_wall import TableWalls
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
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
    own = mesentery.stack([own._replace(**free | changed)])
    return Mesentery(*(jnp.asarray(part, jnp.float64) for part in own))


def _creep(own: Mesentery, force: np.ndarray, steps: int) -> np.ndarray:
    """Displacements after steps under forces on the nodes (nodes, 3) [N]."""
    arcs = jnp.arange(own.nodes.shape[1])[None] * own.spacing[:, None]
    # A force right at the anus counts as before it.
    grip = AttachmentPoints(jnp.maximum(arcs, 1e-9), jnp.zeros_like(own.nodes))
    none = jnp.zeros_like(arcs)

    def step(_: int, displacement: AxisDisplacement) -> AxisDisplacement:
        return moving_colon.step_axis(jnp, own, displacement, grip, jnp.asarray(force)[None], none, _STEP)

    return np.asarray(jax.lax.fori_loop(0, steps, step, moving_colon.at_rest(jnp, own, 1, jnp.float64)).place[0])


def _only(count: int, node: int, force: list[float]) -> np.ndarray:
    forces = np.zeros((count, 3))
    forces[node] = force
    return forces


@pytest.fixture(autouse=True)
def _double_precision():
    with jax.enable_x64(True):
        yield


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


def test_a_clamped_tube_bends_like_a_beam() -> None:
    """F L^3 / 3 EI at the end of a cantilever, within 1 %: it begins half an edge before its second node."""
    count, rigidity = 31, 0.01
    clamped, bending = np.zeros(count), np.full(count, rigidity / 0.01)
    clamped[:2], bending[[0, -1]] = 1e6, 0.0
    own = _straight(hold=clamped, bending=bending, tension=np.full(count - 1, 1000.0))
    moved = _creep(own, _only(count, -1, [0.02, 0, 0]), 40000)[-1, 0]
    assert moved == pytest.approx(0.02 * 0.295**3 / (3 * rigidity), rel=0.01)


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
    free = own._replace(hold=0 * own.hold, support=0 * own.support)
    turn, away = Rotation.from_rotvec([0.2, -0.5, 0.4]), np.array([0.02, 0.01, -0.03])
    place = turn.apply(own.nodes[0]) + away - own.nodes[0]
    assert float(moving_colon.energy(jnp, free, jnp.asarray(place)[None])[0]) == pytest.approx(0.0, abs=1e-10)
    random = np.random.default_rng(0)
    arcs = random.uniform(0.02, 0.25, (1, 200))
    axis = np.array(
        [np.interp(arcs[0], field.tables.step * np.arange(len(field.tables.points)), c) for c in field.tables.points.T]
    ).T
    points = axis + random.normal(size=axis.shape) * 0.008
    to_current = np.asarray(moving_colon.to_current(jnp, tables, jnp.asarray(place)[None], points[None], arcs))[0]
    # The shortest turn of a cross-section leaves out what the whole turned about the axis itself.
    tangents = np.array(
        [
            np.interp(arcs[0], np.linspace(0, float(own.spacing[0]) * (len(place) - 1), len(place)), t)
            for t in own.tangents[0].T
        ]
    ).T
    along = np.einsum("pi,pi->p", points - axis, tangents / np.linalg.norm(tangents, axis=1)[:, None])
    now = np.einsum(
        "pi,pi->p",
        to_current - turn.apply(axis) - away,
        turn.apply(tangents / np.linalg.norm(tangents, axis=1)[:, None]),
    )
    assert np.linalg.norm(to_current - turn.apply(axis) - away, axis=1) == pytest.approx(
        np.linalg.norm(points - axis, axis=1), rel=0.02
    )
    assert now == pytest.approx(along, abs=3e-4)
    shape = moving_colon.shape_of(jnp, own, jnp.asarray(place)[None])
    back = moving_colon.to_reference(jnp, tables, jnp.asarray(place)[None], shape, jnp.asarray(to_current)[None], arcs)
    assert np.abs(np.asarray(back)[0] - points).max() < 2e-4


def test_forces_on_the_wall_do_the_work_that_its_motion_says() -> None:
    """Power of random forces at random places of the wall, on the wall's own speed there, and of drag on the nodes."""
    count = 31
    own = _straight(tension=np.zeros(count - 1))
    random = np.random.default_rng(1)
    place = jnp.asarray(random.normal(size=(1, count, 3)) * 0.003)
    grip = AttachmentPoints(
        jnp.asarray(random.uniform(0.01, 0.29, (1, 50))), jnp.asarray(random.normal(size=(1, 50, 3)) * 0.015)
    )
    force = jnp.asarray(random.normal(size=(1, 50, 3)))
    own = own._replace(pleating=0 * own.pleating)
    moved = moving_colon.step_axis(jnp, own, AxisDisplacement(place, 0 * place), grip, force, jnp.zeros((1, 50)), _STEP)
    felt = moving_colon.wall_speeds(jnp, own, AxisDisplacement(place, moved.speed), grip)
    assert float((force * felt).sum()) == pytest.approx(float((own.drag[..., None] * moved.speed**2).sum()), rel=1e-9)


def _random_bend() -> tuple[Mesentery, np.ndarray, np.random.Generator]:
    """A bent colon, pulled about by up to its slack."""
    random = np.random.default_rng(3)
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    tables = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    own = tables.mesentery
    assert own is not None
    own = own._replace(slack=0.5 * random.uniform(0, 0.01, own.slack.shape))
    return own, random.normal(size=own.nodes.shape) * 0.004, random


def test_spring_forces_are_the_slope_of_the_energy_and_couples_that_of_their_work() -> None:
    """Against automatic differentiation: -dE/dx of the energy, and d/dx of sum f . R(x) v for forces on the wall."""
    own, place, random = _random_bend()
    none = np.zeros((*place.shape, 3))
    forces = moving_colon.spring_forces(np, own, place, none)
    slope = jax.grad(lambda place: moving_colon.energy(jnp, own, place).sum())(jnp.asarray(place))
    assert np.abs(forces + np.asarray(slope)).max() < 1e-10 * np.abs(forces).max()
    couples = random.normal(size=none.shape)

    def work(place: Any) -> Any:
        shape = moving_colon.shape_of(jnp, own, place)
        turns = jnp.stack([_turned(shape, axis) for axis in np.eye(3)], axis=-1)
        return (turns * couples).sum()

    turning = moving_colon.spring_forces(np, own, place, couples) - forces
    expected = np.asarray(jax.grad(work)(jnp.asarray(place)))
    assert np.abs(turning - expected).max() < 1e-10 * np.abs(expected).max()


def _turned(shape: moving_colon.AxisShape, v: np.ndarray) -> Any:
    axes = tuple(shape.axes[..., i] for i in range(3))
    return jnp.stack(moving_colon.turned(jnp, shape.cosines, axes, tuple(v)), axis=-1)


def test_speeds_of_the_wall_are_the_rate_of_its_places() -> None:
    """Against automatic differentiation along the nodes' speeds."""
    own, place, random = _random_bend()
    speed = random.normal(size=place.shape) * 0.01
    grip = AttachmentPoints(random.uniform(0.01, 0.25, (1, 40)), random.normal(size=(1, 40, 3)) * 0.015)
    found = moving_colon.wall_speeds(np, own, AxisDisplacement(place, speed), grip)

    def places(place: Any) -> Any:
        at, share = moving_colon.node_cell(np, own.spacing[:, None], place.shape[1], grip.arcs)
        moved = place[0][at] + share[..., None] * (place[0][at + 1] - place[0][at])
        return moved + moving_colon.directions(jnp, own, place, grip.arcs, grip.lever)

    expected = jax.jvp(places, (jnp.asarray(place),), (jnp.asarray(speed),))[1]
    assert np.abs(found - np.asarray(expected)).max() < 1e-10 * np.abs(found).max()


def test_numpy_and_jax_step_alike() -> None:
    own, place, random = _random_bend()
    grip = AttachmentPoints(random.uniform(-0.01, 0.25, (1, 40)), random.normal(size=(1, 40, 3)) * 0.015)
    displacement = AxisDisplacement(place, random.normal(size=place.shape) * 0.01)
    force, damping = random.normal(size=(1, 40, 3)), random.uniform(0, 20, (1, 40))
    one, other = (moving_colon.step_axis(xp, own, displacement, grip, force, damping, _STEP) for xp in (np, jnp))
    for mine, theirs in zip(one, other, strict=True):
        assert np.abs(mine - np.asarray(theirs)).max() < 1e-12 + 1e-10 * np.abs(mine).max()


def test_compiled_loops_are_the_law() -> None:
    """Look-ups, wall speeds and a step of the axis, as in numpy to rounding."""
    random = np.random.default_rng(4)
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    stacked = stack([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    walls = TableWalls(stacked, 1, 60, radius=0.006)
    world, tables, displacement = np.array([0]), pick(stacked, np.array([0])), walls.displacement
    own = tables.mesentery
    assert own is not None and displacement is not None
    arcs = np.linspace(-0.02, 0.3, 60)[None]
    points = axis_at(np, tables, arcs) + random.normal(size=(1, 60, 3)) * 0.008
    walls.begin(world, world, arcs)
    displacement.place[:], displacement.speed[:] = (
        random.normal(size=displacement.place.shape) * size for size in (0.003, 0.01)
    )
    walls.look(world, points)
    found, grip = moving_colon.query(np, tables, displacement, points, arcs, np.full(1, 0.006))
    speeds = moving_colon.wall_speeds(np, own, displacement, grip)
    for mine, theirs in zip((walls.arcs, walls.depth, walls.inwards, walls.wall_speed), (*found, speeds), strict=True):
        assert np.abs(mine - theirs).max() < 1e-12
    force, damping = random.normal(size=(1, 60, 3)), random.uniform(0, 20, (1, 60))
    expected = moving_colon.step_axis(np, own, displacement, grip, force, damping, _STEP)
    walls.give_way(world, force, damping, _STEP)
    assert np.abs(displacement.place - expected.place).max() < 1e-12
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
    found = moving_colon.solve_tridiagonal(
        jnp, *(jnp.asarray(part) for part in (-below, more + below + above, -above, right))
    )
    for world in range(3):
        matrix = np.diag((more + below + above)[world]) - np.diag(ties[world], 1) - np.diag(ties[world], -1)
        assert np.asarray(found[world]) == pytest.approx(np.linalg.solve(matrix, right[world]), rel=1e-9, abs=1e-12)


def _bent_bank(**changed: Any) -> ScopeBank:
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.2, 0.0)]), name="bend")
    return build_bank([colon], named_design("adult"), replace(_OPTIONS, **changed))


def _pushed(bank: ScopeBank, tables: Tables, steps: int = 1200) -> LinearBackend:
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
    place = state.displacement.place
    moved = np.linalg.norm(place, axis=-1)
    pull = (own.hold * np.maximum(moved - own.slack, 0.0) / np.maximum(moved, 1e-9) + own.support)[..., None] * place
    # The handle and the anus hold the scope: its own balance is the wall's force on it.
    model, data = backend.world_data(0)
    spheres = data.geom_xpos[[model.geom(f"wall/sphere_{i:04d}").id for i in range(len(bank.scene.samples))]]
    tables, radius = pick(bank.tables, np.zeros(1, int)), np.full(1, bank.scene.cable.radius)
    found, _ = moving_colon.query(np, tables, state.displacement, spheres[None], state.arcs[:, :-1], radius)
    on_scope = (state.normal[..., None] * found.inwards).sum(axis=1)[0]
    assert np.linalg.norm(on_scope) > 1.0
    assert pull.sum(axis=1)[0] == pytest.approx(-on_scope, abs=0.05 * float(np.linalg.norm(on_scope)))
    assert 0.001 < moved.max() < 0.05
    assert backend.read().link_forces.max() < _pushed_in_a_fixed_colon().link_forces.max()


def test_what_cannot_move_a_colon_says_so() -> None:
    with pytest.raises(InvalidOptionError, match="needs wall law 'table'"):
        SceneOptions(wall_law="planes", mesentery=True)
    bank = build_bank([straight_tube()], named_design("adult"), _OPTIONS)
    still = build_bank([straight_tube()], named_design("adult"), replace(_OPTIONS, mesentery=False))
    with pytest.raises(UnsupportedSceneError, match="or none"):
        stack([bank.tables, still.tables])
