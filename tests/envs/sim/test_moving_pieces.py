"""Pieces of a wall ride on a colon that moves on its mesentery, and what presses on them moves it."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.envs.sim.growing import GrowingEngine
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.pieces.wall import Wall
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.ring_wall import ring_wall

OPTIONS = SceneOptions(
    mesentery=True, insertion_limit=0.35, shaft_cell=0.0625, bending_cell=0.034, twist_hinges=2, softening=False
)
DESIGN = named_design("adult")


@pytest.fixture(scope="module")
def place() -> tuple[Colon, Wall]:
    """A bend that hangs on a sigmoid's mesentery, and its wall."""
    bend = swept_colon(winding([(0.1, 0.0), (0.1, 1.2), (0.2, 0.0)]), name="bent tube")
    ends = (0.05, bend.centreline.length - 0.05, bend.centreline.length)
    names = ("rectum", "sigmoid", "descending")
    parts = [ColonSegment(n, start, end) for n, start, end in zip(names, (0.0, *ends), ends, strict=False)]
    return replace(bend, segments=tuple(parts)), ring_wall(bend, sectors=24, thickness=0.02)


def _scene(place: tuple[Colon, Wall], **changed) -> Scene:
    return build_scene(*place, DESIGN, replace(OPTIONS, **changed), show_lumen=False)


def _inputs(instant: int) -> Controls:
    return Controls(0.04, 0.1, np.array([0.0, 6.0 * min(1.0, instant / 100), 0.0, 0.0]))


def _driven(engine, instants: int = 220) -> tuple[float, list]:
    forces, seen = [], []
    for instant in range(instants):
        assert engine.step(_inputs(instant), 4)
        seen.append(engine.read())
        forces.append(seen[-1].link_forces.sum())
    return float(np.mean(forces)), seen


def _moved(colon: Colon, way: np.ndarray) -> float:
    return float(np.linalg.norm(way - colon.centreline.points, axis=1).max())


def test_a_scope_moves_a_colon_of_pieces_as_one_of_the_table(place) -> None:
    """One law, two descriptions of one surface: tips 2 % of the length inside apart, forces 15 %, the colon's way 10 %.

    Links are said to be at the same places of the colon, within 5 mm: perforation and pain are told by them.
    Rings are flat between their corners, 0.1 mm in the lumen. Later the tip slips, here a little sooner than there.
    """
    (force, seen), (other_force, other) = (
        _driven(NativeEngine(_scene(place, wall_law=w))) for w in ("pieces", "table")
    )
    for a, b in zip(seen[::50], other[::50], strict=True):
        assert np.linalg.norm(a.tip - b.tip) < 0.02 * b.insertion
    assert force == pytest.approx(other_force, rel=0.15)
    np.testing.assert_allclose(seen[-1].link_arcs, other[-1].link_arcs, atol=5e-3)
    assert seen[-1].link_arcs[-1] > 0.1
    assert _moved(place[0], seen[-1].way) > 0.005
    assert _moved(place[0], seen[-1].way) == pytest.approx(_moved(place[0], other[-1].way), rel=0.1)


def test_stock_mujoco_replays_a_run_from_its_scene(place, tmp_path: Path) -> None:
    """Mocap poses and controls of each record, held for its steps: within 1 mm at the tip over 2 s.

    Stock MuJoCo counts each piece that presses on a place, and sees neither the speed of the wall nor where it is
    between records.
    """
    scene = _scene(place)
    engine, records = NativeEngine(scene), []
    for instant in range(100):
        assert engine.step(_inputs(instant), 4)
        records.append((engine.ctrl, *engine.mocap(scene.blocks), engine.read().tip))
    model = mujoco.MjModel.from_xml_path(str(scene.save(tmp_path / "scene.xml")))
    data, off = mujoco.MjData(model), []
    for data.ctrl[:], data.mocap_pos[:], data.mocap_quat[:], tip in records:
        mujoco.mj_step(model, data, 4)
        mujoco.mj_kinematics(model, data)
        off.append(np.linalg.norm(data.site("scope/tip").xpos - tip))
    assert max(off) < 0.001
    assert np.linalg.norm(records[-1][1] - records[0][1], axis=1).max() > 0.001


def test_shaft_is_added_while_pieces_go_on_moving(place) -> None:
    """Added shaft changes nothing: tip and pieces are where they are with all of it from the start, within 1 %."""
    whole = _scene(place, softening=True, insertion_limit=0.7, start_depth=0.1)

    def build(inside: float) -> Scene:
        colon, wall = place
        return build_scene(colon, wall, DESIGN, whole.options, show_lumen=False, deepest=inside, to_save=False)

    growing, at_once = GrowingEngine(whole, build=build, stride=0.05), NativeEngine(whole)
    for instant in range(90):
        assert growing.step(_inputs(instant), 4) and at_once.step(_inputs(instant), 4)
    one, other = growing.read(), at_once.read()
    assert growing.added
    assert np.linalg.norm(one.tip - other.tip) < 0.01 * other.insertion
    (place, turn), (other_place, other_turn) = growing.mocap(whole.blocks), at_once.mocap(whole.blocks)
    assert place == pytest.approx(other_place, abs=1e-3)
    assert np.linalg.norm(place - whole.blocks.places, axis=1).max() > 0.0015
    # A shaft that is rolled twists the colon by friction, which lets go a moment earlier or later: half a degree.
    assert turn == pytest.approx(other_turn, abs=4e-3)


def test_beside_a_table_pieces_go_where_the_colon_goes(place) -> None:
    """The saved scene's wall follows the axis: its poses are those of the wall that is touched, at the same axis."""
    scene = _scene(place, wall_law="table")
    engine = NativeEngine(scene)
    places, turns = engine.mocap(scene.blocks)
    assert places == pytest.approx(scene.blocks.places) and turns == pytest.approx(np.eye(4)[np.zeros(len(turns), int)])
    _driven(engine, 250)
    places, _ = engine.mocap(scene.blocks)
    way, arcs = engine.read().way, place[0].centreline.arc
    now = np.column_stack([np.interp(scene.blocks.arcs, arcs, way[:, axis]) for axis in range(3)])
    assert places == pytest.approx(now, abs=2e-4)
    assert np.abs(places - scene.blocks.places).max() > 0.003
