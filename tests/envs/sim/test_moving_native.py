"""A colon on its mesentery does the same by every way to step it: in one scene, in a batch, and on MuJoCo Warp."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.growing import GrowingEngine
from haustra.envs.sim.load import load_backend
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.models.wall.moving_planes import MovingPlaneWall
from haustra.models.wall.table_wall import TableWall
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

OPTIONS = SceneOptions(
    wall_law="table",
    mesentery=True,
    softening=False,
    insertion_limit=0.35,
    shaft_cell=0.0625,
    bending_cell=0.034,
    twist_hinges=2,
)
DESIGN = named_design("adult")
LAWS = ("planes", "table")


@pytest.fixture(scope="module")
def colon() -> Colon:
    """A bend that hangs on a sigmoid's mesentery."""
    bend = swept_colon(winding([(0.1, 0.0), (0.1, 1.2), (0.2, 0.0)]), name="bent tube")
    return _with_segments(bend, bend.centreline.length - 0.05)


def _with_segments(colon: Colon, end: float) -> Colon:
    """A colon whose sigmoid ends there [m]."""
    ends = (0.05, end, colon.centreline.length)
    names = ("rectum", "sigmoid", "descending")
    parts = [ColonSegment(n, start, end) for n, start, end in zip(names, (0.0, *ends), ends, strict=False)]
    return replace(colon, segments=tuple(parts))


def _scene(colon: Colon, **changed) -> Scene:
    return build_scene(colon, None, DESIGN, replace(OPTIONS, **changed), show_lumen=False)


def _inputs(instant: int) -> Controls:
    return Controls(0.04, 0.1, np.array([0.0, 6.0 * min(1.0, instant / 100), 0.0, 0.0]))


def _driven(engine, instants: int = 350) -> tuple[list, list]:
    forces, seen = [], []
    for instant in range(instants):
        assert engine.step(_inputs(instant), 4)
        seen.append(engine.read())
        forces.append(seen[-1].link_forces.sum())
    return forces, seen


def _moved(colon: Colon, way: np.ndarray) -> float:
    return float(np.linalg.norm(way - colon.centreline.points, axis=1).max())


def test_one_scene_goes_as_in_linear_time(colon) -> None:
    """One script run both ways: tips within 1 % of the length inside, mean wall force within 8 %, colon moved alike.

    Contacts act at the scope's surface natively as in linear time.
    """
    from haustra.envs.sim.linear.single import LinearSingle

    scene = _scene(colon)
    (mine, one), (theirs, other) = _driven(NativeEngine(scene)), _driven(LinearSingle(scene))
    for a, b in zip(one[::50], other[::50], strict=True):
        assert np.linalg.norm(a.tip - b.tip) < 0.01 * b.insertion
    assert np.mean(mine) == pytest.approx(np.mean(theirs), rel=0.08)
    assert _moved(colon, one[-1].way) == pytest.approx(_moved(colon, other[-1].way), rel=0.08)
    assert _moved(colon, one[-1].way) > 0.005


@pytest.mark.parametrize(
    "around",
    [
        pytest.param(Abdomen(posture="left"), marks=pytest.mark.thorough),  # as "mobile" and "adhesions" lie, too
        Abdomen(pressed="sigmoid", hand=10.0),
        Abdomen(posture="prone", mobile=("descending",)),
        Abdomen(posture="right", adhesions=("sigmoid",)),
        Abdomen(pressed="sigmoid", hand=60.0, envelope=True, breathing=True),
        Abdomen(pressed="sigmoid", hand=20.0, loops_touch=True),
        Abdomen(pressed="sigmoid", hand=60.0, rooted=True),
    ],
    ids=["posture", "hand", "mobile", "adhesions", "surroundings", "loops", "roots"],
)
def test_what_the_colon_lies_in_moves_it_alike_on_all_backends(colon, around) -> None:
    """The scope at rest: the axis sags or gives way to the hand, within 0.1 mm alike natively and in linear time."""
    from haustra.envs.sim.linear.single import LinearSingle

    if around.loops_touch:
        colon = _with_segments(swept_colon(winding([(0.12, 0.0), (0.08, np.pi), (0.12, 0.0)]), name="hairpin"), 0.12)
    scene, still = _scene(colon, abdomen=around), Controls(0.0, 0.0, np.zeros(4))
    table = lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True, abdomen=around)
    batch = NativeBackend(scene, stack([table.seen_from(*entry_of(colon))]), worlds=1)
    one, other = NativeEngine(scene), LinearSingle(scene)
    for _ in range(60):
        assert one.step(still, 4) and other.step(still, 4)
        assert batch.step(Controls(np.zeros(1), np.zeros(1), np.zeros((1, 4))), 4).all()
    mine, theirs = one.read().displacement, other.read().displacement
    assert np.linalg.norm(mine[:, :3], axis=1).max() > 0.001 and batch.displacement is not None
    assert mine[:, :3] == pytest.approx(theirs[:, :3], abs=1e-4)
    assert np.linalg.norm(batch.displacement[0, :, :3], axis=1) == pytest.approx(
        np.linalg.norm(mine[:, :3], axis=1), abs=1e-4
    )


@pytest.mark.parametrize("stiffness", [pytest.param(1500.0, marks=pytest.mark.thorough), 2400.0])
def test_a_batch_goes_as_one_scene(colon, stiffness) -> None:
    """Two worlds of a batch against one scene; what it reads is one step older. A stiff wall makes nothing rock."""
    scene = _scene(colon, wall_stiffness=stiffness)
    single = NativeEngine(scene)
    tables = stack(
        [lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True).seen_from(*entry_of(colon))]
    )
    batch = NativeBackend(scene, tables, worlds=2, threads=2)
    both = np.arange(2)
    numbers = (np.full(2, float(value)) for value in (OPTIONS.friction, stiffness, 1.0))
    batch.reset(both, np.zeros(2, int), Conditions(*numbers))
    mine, theirs = [], []
    for instant in range(280):
        asked = _inputs(instant)
        assert single.step(asked, 4)
        rates = (np.full(2, asked.push_rate), np.full(2, asked.roll_rate))
        assert batch.step(Controls(*rates, np.tile(asked.pulls, (2, 1))), 4).all()
        mine.append(single.read().link_forces.sum())
        theirs.append(batch.read().link_forces.sum(axis=1))
    found, seen = batch.read(), single.read()
    origin, axes = entry_of(colon)
    assert np.linalg.norm(found.tip @ axes.T + origin - seen.tip, axis=1).max() < 0.01 * seen.insertion
    assert np.mean(theirs, axis=0) == pytest.approx(np.mean(mine), rel=0.015)
    assert batch.displacement is not None and seen.way is not None
    assert np.linalg.norm(batch.displacement[..., :3], axis=2).max() == pytest.approx(
        _moved(colon, seen.way), rel=0.015
    )
    assert np.array_equal(batch.displacement[0], batch.displacement[1])
    batch.reset(np.array([1]), np.zeros(1, int), Conditions(*(np.full(1, value) for value in (0.1, 1500.0, 1.0))))
    assert not batch.displacement[1, :, :3].any() and batch.displacement[0, :, :3].any()


def test_mujoco_warp_goes_as_one_scene(colon) -> None:
    """Contacts push the colon on alike: largest displacement within 1 %, tips within 1 mm, forces within 5 %."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    scene = _scene(colon)
    single = NativeEngine(scene)
    tables = lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True).seen_from(*entry_of(colon))
    many = load_backend("warp", scene, stack([tables]), worlds=2)
    mine, theirs = [], []
    for instant in range(200):
        asked = _inputs(instant)
        assert single.step(asked, 4)
        rates = np.array([asked.push_rate, 0.0]), np.array([asked.roll_rate, 0.0])
        assert many.step(Controls(*rates, np.array([asked.pulls, np.zeros(4)])), 4).all()
        mine.append(single.read().link_forces.sum())
        theirs.append(many.read().link_forces[0].sum())
    found, seen = many.read(), single.read()
    origin, axes = entry_of(colon)
    assert np.linalg.norm(axes @ found.tip[0] + origin - seen.tip) < 0.001
    assert np.mean(theirs) == pytest.approx(np.mean(mine), rel=0.05)
    assert many.displacement is not None and seen.way is not None
    moved = np.linalg.norm(np.asarray(many.displacement)[..., :3], axis=2).max(axis=1)
    assert moved[0] == pytest.approx(_moved(colon, seen.way), rel=0.01)
    assert moved[0] > 0.005 > 1e-4 > moved[1]  # a scope that waits at the anus moves nothing
    many.reset(np.zeros(1, int), np.zeros(1, int), Conditions(*(np.full(1, value) for value in (0.1, 1500.0, 1.0))))
    assert not np.asarray(many.displacement)[0, :, :3].any()


def test_a_world_that_is_put_back_bears_nothing_of_the_loop_that_it_was_kept_in(colon) -> None:
    """States of MuJoCo hold forces from outside: those of threads are of the instant, not of the place."""
    scene = _scene(colon, friction=1e-4)
    tables = lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True).seen_from(*entry_of(colon))
    many = load_backend("native", scene, stack([tables]), worlds=1)
    assert isinstance(many, NativeBackend)
    law = (np.full(1, float(value)) for value in (scene.options.friction, scene.options.wall_stiffness, 1.0))
    many.reset(np.zeros(1, int), np.zeros(1, int), Conditions(*law))
    borne = vars(vars(vars(many)["_shards"][0])["_wall"])["_threads"]
    borne[0] = 1.0
    kept = many.snapshot(0)
    many.restore(0, kept)
    assert not borne.any()


@pytest.mark.parametrize("name", ["native", "warp"])
def test_a_loop_that_a_shaft_has_missed_is_drawn_to_it_alike(colon, name) -> None:
    """Spheres of the further half are put 8 cm on: axis and scope go as in one scene, within 10 % of their way."""
    if name == "warp":
        pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    scene = _scene(colon, friction=1e-4)
    tables = lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True).seen_from(*entry_of(colon))
    many, single = load_backend(name, scene, stack([tables]), worlds=1), NativeEngine(scene)
    law = (np.full(1, float(value)) for value in (scene.options.friction, scene.options.wall_stiffness, 1.0))
    many.reset(np.zeros(1, int), np.zeros(1, int), Conditions(*law))
    still, begun = np.zeros(1), None if isinstance(many, NativeBackend) else vars(many)["_state"]
    for instant in range(30):
        assert many.step(Controls(still + 0.1 * (instant < 15), still, np.zeros((1, 4))), 20).all()
    if isinstance(many, NativeBackend):
        here = many.snapshot(0)
        arcs = here.arcs + np.where(here.arcs > 0.07, 0.08, 0.0)
        many.restore(0, replace(here, arcs=arcs))
    else:
        now = vars(many)["_state"]
        arcs = np.asarray(now.arcs)[0]
        arcs = arcs + np.where(arcs > 0.07, 0.08, 0.0)
        at_rest = {"qvel": 0 * now.qvel, "displacement": begun and begun.displacement}
        vars(many)["_state"] = now._replace(arcs=now.arcs.at[0].set(arcs), **at_rest)
    single.put(np.asarray(many.positions(), float)[0])
    assert isinstance(single._wall, TableWall)
    single._wall._walls.arcs[0] = arcs[: single._wall.arcs.size]
    before, rest = single.read().tip, np.asarray(many.read().tip, float)[0]
    assert single.step(Controls(0.0, 0.0, np.zeros(4)), 6)
    assert many.step(Controls(still, still, np.zeros((1, 4))), 6 + (name == "native")).all()
    mine, theirs = single.read(), many.read()
    _, axes = entry_of(colon)
    assert mine.displacement is not None
    moved = mine.displacement[:, :3] @ axes
    assert np.linalg.norm(moved, axis=1).max() > 0.003
    assert np.abs(moved - np.asarray(many.displacement)[0, :, :3]).max() < 0.1 * np.abs(moved).max()
    way, other = (mine.tip - before) @ axes, np.asarray(theirs.tip)[0] - rest
    assert 0.005 < np.linalg.norm(way) > 10 * np.linalg.norm(way - other)


def test_tangent_planes_go_with_the_colon_as_the_table_does(colon) -> None:
    """One surface by its triangles and by its table: tips 1.5 mm apart, mean force and the colon's way within 5 %.

    Later the tip catches on an edge of this tube, whose rings are 28 mm apart, and slips at another moment.
    """
    (forces, seen), (other_forces, other) = (_driven(NativeEngine(_scene(colon, wall_law=law)), 190) for law in LAWS)
    for a, b in zip(seen[::10], other[::10], strict=True):
        assert np.linalg.norm(a.tip - b.tip) < 0.0015
    assert np.mean(forces) == pytest.approx(np.mean(other_forces), rel=0.05)
    assert _moved(colon, seen[-1].way) > 0.002
    assert _moved(colon, seen[-1].way) == pytest.approx(_moved(colon, other[-1].way), rel=0.05)
    assert seen[-1].displacement is not None


def test_a_scope_that_rests_is_next_to_the_wall_that_moves_past_it(colon) -> None:
    """Within 1 mm of the nearest of all triangles round about, once the colon has sagged by some millimetres."""
    engine = NativeEngine(_scene(colon, wall_law="planes", abdomen=Abdomen(posture="left"), start_depth=0.12))
    still = Controls(0.0, 0.0, np.zeros(4))
    for _ in range(60):
        assert engine.step(still, 4)
    wall = engine._wall
    assert isinstance(wall, MovingPlaneWall)
    assert _moved(colon, engine.read().way) > 0.003
    inside = wall.arcs > 0.02
    centres = engine.data.geom_xpos[wall.spheres]
    told = wall.update(engine.data)[inside].copy()
    fresh = wall._lumen.candidates(centres, np.maximum(wall.arcs, 0.0))
    assert np.abs(wall._lumen.nearest_of(centres, fresh).outside[inside] - told).max() < 1e-3


@pytest.mark.parametrize("law", LAWS)
def test_shaft_is_added_while_the_colon_goes_on_moving(colon, law: str) -> None:
    """Added shaft changes nothing: tip and colon are where they are with all of it from the start, within 1 %."""
    whole = _scene(colon, softening=True, insertion_limit=0.7, wall_law=law, start_depth=0.1)

    def build(inside: float) -> Scene:
        return build_scene(colon, None, DESIGN, whole.options, show_lumen=False, deepest=inside, to_save=False)

    growing, at_once = GrowingEngine(whole, build=build, stride=0.03), NativeEngine(whole)
    for instant in range(78):
        assert growing.step(_inputs(instant), 4) and at_once.step(_inputs(instant), 4)
    one, other = growing.read(), at_once.read()
    assert growing.added
    assert one.way is not None and other.way is not None
    assert np.linalg.norm(one.tip - other.tip) < 0.01 * other.insertion
    assert _moved(colon, one.way) > 0.001
    assert _moved(colon, one.way) == pytest.approx(_moved(colon, other.way), rel=0.02)
    assert growing.colon().centreline.points == pytest.approx(one.way)


@pytest.mark.parametrize("change", [{"gravity": (0.0, 0.0, -9.81)}, {"friction": 0.0}])
def test_what_is_in_the_scene_counts(colon, change) -> None:
    """Gravity, in the colon's own frame, and no friction change what the same script does to the colon."""
    usual, other = NativeEngine(_scene(colon)), NativeEngine(_scene(colon, **change))
    for instant in range(250):
        assert usual.step(_inputs(instant), 4) and other.step(_inputs(instant), 4)
    ways = usual.read().way, other.read().way
    assert ways[0] is not None and ways[1] is not None
    assert np.abs(ways[0] - ways[1]).max() > 1e-4
