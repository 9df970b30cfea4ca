"""A shaft that is threaded through a colon that moves: forces against an energy, none in passing, loops that close."""

import ctypes
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from llvmlite import ir
from runtime_types import unchecked

from haustra.envs.sim.linear.compile import engine_of
from haustra.envs.sim.linear.layout import THREAD_ROOM, Layout
from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.sweep import NodeNumbers
from haustra.envs.sim.linear.threads import Threads
from haustra.envs.sim.linear.trace import Program
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall import moving_colon, threads, vectors
from haustra.models.wall.compiled import loops
from haustra.models.wall.loops import beside
from haustra.models.wall.lumen_table import lumen_table, pick
from haustra.models.wall.lumen_table import stack as stack_tables
from haustra.models.wall.mesentery import Mesentery, hang, stack
from haustra.models.wall.moving_colon import AxisDisplacement, AxisShape
from haustra.models.wall.moving_planes import MovingPlaneWall
from haustra.models.wall.piece_wall import PieceWall
from haustra.models.wall.table_wall import TableWall, TableWalls
from haustra.models.wall.threads import INDENTED
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.models.wall.quickly import jitted
from tests.ring_wall import ring_wall

_RADIUS, _FAR = 0.02, 0.15


@pytest.fixture(autouse=True)
def _double_precision():
    with jax.enable_x64(True):
        yield


def _hairpin_line() -> tuple[np.ndarray, np.ndarray]:
    """Points along z, aside by `_FAR`, back across 40 mm, and on along z, and their arc lengths; corners are round.

    Each corner is a mean over 30 mm of the way: in one of no radius the wall on the inside would have no length.
    """
    corners = np.array([(0, 0, 0), (0, 0, 0.2), (0, _FAR, 0.2), (0, _FAR, 0.24), (0, 0, 0.24), (0, 0, 0.44)])
    arcs = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    fine, half = np.linspace(0.0, arcs[-1], 2000), 40
    sharp = np.column_stack([np.interp(fine, arcs, column) for column in corners.T])
    line = sharp.copy()
    line[half:-half] = np.lib.stride_tricks.sliding_window_view(sharp, 2 * half + 1, axis=0).mean(axis=-1)
    return line, np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))


def _hairpin(**changed: Any) -> Mesentery:
    """A colon of one world along `_hairpin_line`; what is changed is the same at all nodes."""
    line, arcs = _hairpin_line()
    own = hang(line, arcs, np.full(2000, _RADIUS), ())
    return stack([own._replace(**{name: np.full(len(own.nodes), value) for name, value in changed.items()})])


def _taut() -> tuple[np.ndarray, np.ndarray]:
    """Spheres of a straight shaft that cuts the hairpin off, every 10 mm, and the arc lengths where they are."""
    z = np.linspace(0.0, 0.44, 45)
    points, aside = np.stack([0 * z, 0 * z, z], axis=1)[None], _hairpin_line()[1][-1] - z[-1]
    return points, np.where(z < 0.215, z, z + aside)[None]


def _drawn(xp: Any, own: Mesentery, pose: Any, points: Any, arcs: Any) -> threads.Drawn:
    with unchecked():
        return threads.drawn(xp, own, pose, points, arcs)


def test_forces_are_the_slope_of_an_energy_on_nodes_and_on_the_shaft() -> None:
    """To 1e-9: a piece of shaft moves with the link of its further sphere, so that the nearer one turns about it."""
    own, random = _hairpin(), np.random.default_rng(0)
    points, arcs = _taut()
    points = points + random.normal(size=points.shape) * 0.003
    pose = np.zeros((1, own.nodes.shape[1], 7))
    pose[..., :3] = random.normal(size=pose[..., :3].shape) * 0.003
    along = own.spacing[0] * np.arange(pose.shape[1])
    sphere = np.searchsorted(arcs[0], along)
    held = np.flatnonzero(sphere > 0)
    radius = threads.lumen_radius(np, own.drag[0], own.turn_drag[0])

    def energy(places: Any, shaft: Any) -> Any:
        ends = vectors.of(shaft[sphere[held] - 1]), vectors.of(shaft[sphere[held]])
        _, away = beside(jnp, vectors.of(places[held]), *ends)
        return threads.thread_energy(jnp, vectors.norm(jnp, away), radius[held]).sum()

    places = own.nodes[0] + pose[0, :, :3]
    on_nodes, on_spheres = map(np.asarray, jax.grad(energy, argnums=(0, 1))(places, points[0]))
    found = _drawn(np, own, pose, points, arcs)
    assert np.abs(found.force).max() > 1.0
    np.testing.assert_allclose(found.force[0], -on_nodes, atol=1e-9)
    np.testing.assert_allclose(found.borne[0].sum(axis=0), -on_spheres.sum(axis=0), atol=1e-9)
    at = int(np.abs(found.borne[0]).sum(axis=1).argmax())
    np.testing.assert_allclose(found.borne[0, at], -(on_spheres[at] + on_spheres[at - 1]), atol=1e-9)
    turned = -np.cross(points[0, at - 1] - points[0, at], on_spheres[at - 1])
    np.testing.assert_allclose(found.moment[0, at], turned, atol=1e-9)


def test_what_nodes_and_links_do_is_what_the_energy_loses() -> None:
    """Virtual work to 1e-8, of nodes and links that move at random; without the moments it would be off by far more."""
    own, random = _hairpin(), np.random.default_rng(1)
    points, arcs = _taut()
    points = points + random.normal(size=points.shape) * 0.003
    pose = np.zeros((1, own.nodes.shape[1], 7))
    pose[..., :3] = random.normal(size=pose[..., :3].shape) * 0.003
    sphere = np.searchsorted(arcs[0], own.spacing[0] * np.arange(pose.shape[1]))
    held = np.flatnonzero(sphere > 0)
    last, radius = sphere[held], threads.lumen_radius(np, own.drag[0], own.turn_drag[0])[held]
    node, link, turn = random.normal(size=own.nodes[0].shape), *random.normal(size=(2, *points[0].shape))

    def energy(time: Any) -> Any:
        """A piece of shaft goes along with the link of its further sphere."""
        after, before = jnp.asarray(points[0, last]), jnp.asarray(points[0, last - 1])
        along = before + time * (link[last] + np.cross(turn[last], before - after))
        ends = vectors.of(along), vectors.of(after + time * link[last])
        _, away = beside(jnp, vectors.of((own.nodes[0] + pose[0, :, :3] + time * node)[held]), *ends)
        return threads.thread_energy(jnp, vectors.norm(jnp, away), radius).sum()

    lost = -float(jax.jvp(energy, (0.0,), (1.0,))[1])
    found = _drawn(np, own, pose, points, arcs)
    moved, turned = (found.force[0] * node).sum() + (found.borne[0] * link).sum(), (found.moment[0] * turn).sum()
    assert moved + turned == pytest.approx(lost, rel=1e-8)
    assert abs(turned) > 1e-4 * abs(lost) > 1e-4


def test_compiled_loops_and_jax_are_the_law() -> None:
    own, (points, arcs) = _hairpin(), _taut()
    pose = np.zeros((1, own.nodes.shape[1], 7))
    arcs[0, :3] = -0.01, 0.03, 0.02  # spheres before the anus, and one that is folded back
    want = _drawn(np, own, pose, points, arcs)
    nodes, borne = np.ones((1, pose.shape[1], 4)), np.ones((1, points.shape[1], 6))
    assert loops().thread(own, np.zeros(1, int), pose, points, arcs, nodes, borne)
    np.testing.assert_allclose(nodes, np.concatenate([want.force, want.stiffness[..., None]], axis=2), atol=1e-12)
    np.testing.assert_allclose(borne, np.concatenate([want.borne, want.moment], axis=2), atol=1e-12)
    for one, other in zip(_drawn(jnp, own, jnp.asarray(pose), jnp.asarray(points), arcs), want, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_nothing_is_drawn_to_a_shaft_that_its_spheres_hold() -> None:
    """Anywhere in the lumen, and as deep in the wall as 5 mm, the law is exactly none."""
    own, (points, _) = _hairpin(), _taut()
    line = np.linspace(0.0, 0.19, points.shape[1])
    points = np.stack([np.full_like(line, _RADIUS + 0.9 * INDENTED), 0 * line, line], axis=1)[None]
    found = _drawn(np, own, np.zeros((1, own.nodes.shape[1], 7)), points, line[None])
    assert all((np.asarray(part) == 0).all() for part in found)


@pytest.mark.parametrize("steps", [2000, pytest.param(100_000, marks=pytest.mark.thorough)])
def test_a_loop_closes_on_a_shaft_that_is_taut_across_it(steps: int) -> None:
    """It ends inside the cross-section of every node, as far as packed folds let it; no energy is gained."""
    own = _hairpin(slack=1.0, hold=1e-3)
    nodes = own.nodes.shape[1]
    points, arcs = _taut()
    now = moving_colon.at_rest(np, own, 1, float)
    sphere = np.searchsorted(arcs[0], own.spacing[0] * np.arange(nodes))
    held = np.flatnonzero(sphere > 0)

    def out_and_energy(now: AxisDisplacement) -> tuple[float, float]:
        places = (own.nodes[0] + now.pose[0, :, :3])[held]
        ends = vectors.of(points[0, sphere[held] - 1]), vectors.of(points[0, sphere[held]])
        off = vectors.norm(np, beside(np, vectors.of(places), *ends)[1])
        radius = threads.lumen_radius(np, own.drag[0], own.turn_drag[0])[held]
        with unchecked():
            stored = moving_colon.energy(np, own, now.pose)[0]
        return float((off - radius).max()), float(stored + threads.thread_energy(np, off, radius).sum())

    (first, before), passed, world = out_and_energy(now), [], np.zeros(1, int)
    drawn, borne = np.zeros((1, nodes, 4)), np.zeros((1, points.shape[1], 6))
    edges = nodes - 1
    sizes = (edges, 3), (edges,), (nodes, 3), (nodes,), (nodes, 4), (edges, 3), (nodes,), (nodes, 3)
    shape = AxisShape(*(np.zeros((1, *size)) for size in sizes))
    nothing = np.zeros((1, 0)), np.zeros((1, 0, 3)), np.zeros((1, 0, 3)), np.zeros((1, 0, 2))
    around = np.zeros(1), np.full((1, nodes), -1), np.zeros(1), drawn
    for step in range(steps):
        loops().thread(own, world, now.pose, points, arcs, drawn, borne)
        loops().step_axis(own, world, *now, shape, *nothing, 0.005, *around)
        if step % (steps // 2000) == 0:
            passed.append(out_and_energy(now)[1])
    out, _ = out_and_energy(now)
    assert first > 0.12 and out < INDENTED + 0.01
    assert (np.diff([before, *passed]) < 1e-12).all()


@pytest.mark.parametrize("threaded", [False, True])
def test_a_shaft_that_is_pulled_taut_across_a_loop_does_not_leave_it(threaded: bool) -> None:
    """No sphere is looked up further beyond the one before it than folds can be packed; else one stays beyond the loop.

    It would stand in the wall there and hold the shaft as a hook does, however hard that is pulled.
    """
    colon = swept_colon(winding([(0.1, 0.0), (0.12, np.pi), (0.1, 0.0)]), name="hairpin")
    tables = stack_tables([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    aside, along = 2 * 0.12 / np.pi, np.arange(0.0, 0.05, 0.01)
    across = np.linspace(0.0, aside, 9)
    x, y = np.concatenate([along, np.full(9, 0.05), along[::-1]]), np.repeat([0.0, aside], 5)
    y = np.concatenate([y[:5], across, y[5:]])
    points = np.column_stack([x, y, np.zeros(19)])[None]
    arcs = np.where(y < aside / 2, x, 0.32 - x)[None]
    apart, world = np.linalg.norm(np.diff(points[0], axis=0), axis=1), np.zeros(1, int)
    walls = TableWalls(tables, 1, 19, radius=0.006, threaded=threaded)
    walls.begin(world, world, arcs)
    picked = pick(tables, world)
    assert picked.mesentery is not None
    still = moving_colon.at_rest(np, picked.mesentery, 1, float)
    query = jitted(partial(moving_colon.query, jnp, threaded=19 * threaded))
    for _ in range(20):
        with unchecked():
            about = picked, still, points, arcs, np.full((1, 1), 0.006)
            law, _ = moving_colon.query(np, *about, threaded=19 * threaded)
            same, _ = query(*about)
        walls.look(world, points)
        np.testing.assert_allclose(walls.arcs, law.arcs, atol=1e-12)
        np.testing.assert_allclose(same.arcs, law.arcs, atol=1e-9)
        np.testing.assert_allclose(walls.depth, law.depth, atol=1e-12)
        bound = arcs[0, :-1] + threads.PACKED * apart
        assert (law.arcs[0, 1:] <= bound + 1e-8).all() == threaded
        arcs = law.arcs


def test_a_tip_is_looked_up_no_further_beyond_the_last_sphere_than_folds_can_be_packed() -> None:
    """Taken for one beside it in the other leg of a bend, it is back in its own; by itself it stays there."""
    colon = swept_colon(winding([(0.1, 0.0), (0.08, np.pi), (0.1, 0.0)]), name="hairpin")
    tables = stack_tables([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    x = np.linspace(0.0, 0.06, 7)
    points = np.column_stack([x, 0 * x, 0 * x])[None]
    walls = TableWalls(tables, 1, 7, radius=0.006, threaded=True)
    walls.begin(np.zeros(1, int), np.zeros(1, int), x[None])
    walls.look(np.zeros(1, int), points)
    tip = points[:, -1:] + np.array([0.005, 0.0, 0.0])
    taken = np.full((1, 1), 0.28 - 0.065)
    assert walls.arcs_of(tip, taken)[0, 0] > 0.2
    found = walls.arcs_of(tip, taken, beyond=points[:, -1])
    assert found[0, 0] == pytest.approx(walls.arcs[0, -1] + threads.PACKED * 0.005)


def test_spheres_ahead_of_where_they_are_looked_up_hold_on_to_the_section_there() -> None:
    """In a colon packed to 0.3 they are, by 35 mm at rest: no lever goes there, and walls turn by their radius.

    Else sections that turn pass by the shaft at a metre a second, and contacts pinch it by tens of newtons.
    """
    colon = swept_colon(winding([(0.5, 0.0)]), name="tube")
    tables = stack_tables([lumen_table(colon, device_radius=0.006, with_mesentery=True).tables])
    x, world = 0.02 + 0.008 * np.arange(12), np.zeros(1, int)
    points = np.column_stack([x, 0 * x, 0 * x])[None]
    walls = TableWalls(tables, 1, 12, radius=0.006, threaded=True)
    walls.begin(world, world, x[None] / 0.3)
    picked, moved = pick(tables, world), walls.displacement
    assert moved is not None and picked.mesentery is not None
    moved.pose[0, :, 0] = -0.7 * picked.mesentery.nodes[0, :, 0]
    moved.speed[0, :, 1] = 5.0 * 0.3 * picked.mesentery.nodes[0, :, 0]  # the axis turns by 5 rad/s about z
    query = jitted(partial(moving_colon.query, jnp, threaded=12))
    levers: list[Any] = []
    for _ in range(20):
        with unchecked():
            about = picked, moved, points, walls.arcs, np.full((1, 1), 0.006)
            levers = [each.lever for _, each in (moving_colon.query(np, *about, threaded=12), query(*about))]
        walls.look(world, points)
    ahead = points[0, :, 0] - 0.3 * walls.arcs[0]
    assert 0.3 * 0.035 < ahead[-1] < 0.3 * 0.05
    for lever in (*levers, walls.lever):
        assert np.abs(lever[0, :, 0]).max() < 0.006  # no further than the sphere's own surface is
    turning = np.abs(walls.wall_speed[0, :, 0]).max()
    assert 0 < turning < 5.5 * 0.02
    np.testing.assert_allclose(walls.wall_speed[0, :, 1], 5.0 * 0.3 * walls.arcs[0], atol=5.0 * 0.006)


def test_what_is_pressed_through_the_caecum_stays_at_the_colons_end() -> None:
    """Beside a longer colon too: nodes that fill up the shorter one's axis lie metres away, and are no colon."""
    parts = [[(0.1, 0.0), (0.1, 0.5), (0.1, 0.0)], [(0.1, 0.0), (0.1, 0.5), (0.2, 0.0)]]
    colons = [swept_colon(winding(each), name=f"bend {number}") for number, each in enumerate(parts)]
    made = [lumen_table(colon, device_radius=0.006, with_mesentery=True).tables for colon in colons]
    walls, world = TableWalls(stack_tables(made), 1, 1, radius=0.006), np.zeros(1, int)
    line = colons[0].centreline
    assert line.length < 0.31 and walls.displacement is not None
    walls.begin(world, world, np.full((1, 1), line.length - 0.01))
    walls.displacement.pose[0, 31:, :3] = 0.003  # these have moved along with the end, or not
    for beyond in np.linspace(-0.01, 0.02, 40):
        walls.look(world, (line.points[-1] + beyond * line.frames[-1, :, 2])[None, None])
        assert line.length - 0.02 < walls.arcs[0, 0] <= line.length + 1e-6
        assert abs(walls.depth[0, 0]) < 0.03
    for beyond in np.linspace(0.02, -0.01, 40):
        walls.look(world, (line.points[-1] + beyond * line.frames[-1, :, 2])[None, None])
    assert walls.arcs[0, 0] == pytest.approx(line.length - 0.01, abs=2e-3)


@pytest.mark.parametrize("law", ["table", "planes", "pieces"])
def test_links_bear_what_nodes_are_drawn_by(law: Any) -> None:
    """Natively, against any wall: generalised forces are the law's, by MuJoCo's Jacobians, and nodes give way."""
    colon = swept_colon(winding([(0.15, 0.0), (0.1, 0.2), (0.1, 0.0)]), name="bent tube")
    options = SceneOptions(wall_law=law, mesentery=True, insertion_limit=0.3, shaft_cell=0.05, bending_cell=0.03)
    pieces = ring_wall(colon, sectors=24, thickness=0.02) if law == "pieces" else None
    engine = NativeEngine(build_scene(colon, pieces, named_design("adult"), replace(options, softening=False)))
    for _ in range(10):
        assert engine.step(Controls(0.2, 0.0, np.zeros(4)), 20)
    wall, data, model = engine._wall, engine.data, engine.model
    assert isinstance(wall, TableWall | MovingPlaneWall | PieceWall)
    walls = wall._walls if isinstance(wall, TableWall) else wall._look._walls
    moved, own = walls.displacement, walls._own
    assert own is not None and moved is not None
    walls.arcs[0, walls.arcs[0] > 0.1] += _FAR / 2
    wall.update(data)
    points = data.geom_xpos[wall.spheres][None]
    found = _drawn(np, own, moved.pose, points, walls.arcs[None, 0])
    assert np.abs(found.borne).max() > 1.0
    want, jacobians = np.zeros(model.nv), np.zeros((2, 3, model.nv))
    for sphere, geom in enumerate(wall.spheres):
        mujoco.mj_jac(model, data, *jacobians, points[0, sphere], int(model.geom_bodyid[geom]))
        want += jacobians[0].T @ found.borne[0, sphere] + jacobians[1].T @ found.moment[0, sphere]
    np.testing.assert_allclose(data.qfrc_applied, want, atol=1e-10)
    drawn = np.linalg.norm(found.force[0], axis=1) > 0.5
    along = found.force[0, drawn]
    wall.step(data)
    assert (np.einsum("ni,ni->n", moved.speed[0, drawn, :3], along) > 0).mean() > 0.9
    walls.arcs[0, walls.arcs[0] > 0.1] -= _FAR / 2  # the loop has closed: links bear nothing any more
    wall.update(data)
    assert (data.qfrc_applied == 0).all() == (not _drawn(np, own, moved.pose, points, walls.arcs[None, 0]).borne.any())


@pytest.mark.parametrize("lanes", [1, 4])
def test_a_program_draws_the_nodes_that_numpy_draws_from_the_first_sphere_on(lanes: int) -> None:
    """Also of a shaft whose first sphere lies beyond some nodes: nothing is drawn to where it may have come from."""
    own, (points, arcs) = _hairpin(), _taut()
    own = own._replace(nodes=own.nodes[..., [2, 0, 1]])  # along x, so that no node lies straight behind in z
    points, arcs = points[:, 15:, [2, 0, 1]], arcs[:, 15:]
    pose = np.zeros((1, own.nodes.shape[1], 7))
    known = _drawn(np, own, pose, points, arcs)
    assert arcs[0, 0] > 2 * own.spacing[0] and np.any(known.force)
    found = _in_a_program(own, points[0], arcs[0], lanes)
    np.testing.assert_allclose(found, known.force[0], atol=1e-9)


def _in_a_program(own: Mesentery, points: np.ndarray, arcs: np.ndarray, lanes: int) -> np.ndarray:
    """Forces on the nodes as a program finds them, all lanes alike."""
    nodes, spheres = own.nodes.shape[1], len(points)
    rest = np.column_stack([own.nodes[0], own.drag[0], own.turn_drag[0]])
    given = np.concatenate([rest.ravel(), np.column_stack([points, arcs]).ravel()])
    pointer = ir.PointerType()
    program = Program("advance", [pointer, pointer], lanes=lanes, real=np.dtype(float))
    source, room = (Lanes(program, argument, lanes) for argument in program.function.args)
    layout = Layout(dofs=0, bodies=0, spheres=0, nodes=program.index(nodes), moving=True)
    columns = {"x": 0, "y": 1, "z": 2, "drag": 3, "turn_drag": 4}
    drawn = NodeNumbers(room, lambda number: program.index(number), THREAD_ROOM)

    def row(node: Any, name: str) -> Any:
        return source.gather(node * 5, program.index(columns[name]))

    threaded = Threads(
        program, layout, drawn, lambda at: (row(at.within, "x"), row(at.within, "y"), row(at.within, "z")), row
    )
    threaded.begin()
    with program.loop(0, program.index(spheres)) as sphere:
        place = nodes * 5 + sphere * 4
        own_place = source.load(place), source.load(place + 1), source.load(place + 2)
        threaded.meet(own_place, source.load(place + 3), program.constant(float(own.spacing[0])), lambda *_: None)
    engine = engine_of(program.finish())
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(engine.get_function_address("advance"))
    asked = np.ascontiguousarray(np.repeat(given[:, None], lanes, axis=1))
    found = np.zeros((nodes * THREAD_ROOM, lanes))
    call(asked.ctypes.data, found.ctypes.data)
    assert np.ptp(found, axis=1).max() == 0
    return found[:, 0].reshape(nodes, THREAD_ROOM)
