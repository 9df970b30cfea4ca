import numpy as np
import pytest

from haustra.envs.runs.measure.containment import Containment, LumenWidths, most_skipped, outside, stack_widths
from haustra.envs.runs.outcome import EMPTY_LOOP, ENDINGS, Outcome, ending
from haustra.models.wall.sections import SHORTEST
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import RADIUS, straight_tube

SCOPE = 0.0064
BEHIND = np.array([0.2, 0.1, 0.0])


def along(offsets) -> np.ndarray:
    return np.column_stack([offsets, np.zeros(3), 0.4 - BEHIND])


def test_a_scope_on_the_axis_has_all_the_room_there_is():
    outside = Containment(straight_tube(), radius=SCOPE).outside(along([0.0, 0.0, 0.0]), BEHIND, 0.4)
    assert outside == pytest.approx(-(RADIUS - SCOPE))


def test_the_node_that_is_furthest_out_counts():
    outside = Containment(straight_tube(), radius=SCOPE).outside(along([0.0, 0.05, 0.01]), BEHIND, 0.4)
    assert outside == pytest.approx(0.05 + SCOPE - RADIUS, abs=1e-6)


def test_being_inside_another_loop_is_no_excuse():
    # The tip is beside the beginning of the tube, which is inside, but far from where it has got to.
    nodes = np.array([[0.0, 0.0, 0.02]])
    assert Containment(straight_tube(), radius=SCOPE).outside(nodes, np.zeros(1), 0.4) > 0.3


@pytest.mark.parametrize("moves", [False, True])
def test_a_tip_that_is_folded_back_in_the_lumen_has_not_left_it(moves):
    """The bend lies further in than the tip."""
    behind = np.linspace(0.2, 0.0, 41)
    fold = 0.01 * np.pi  # half a turn of 1 cm radius, 4 cm behind the tip
    turn = np.clip((0.04 + fold - behind) / fold, 0.0, 1.0) * np.pi
    straight = np.where(behind > 0.04 + fold, 0.04 + fold - behind, 0.0)
    back = np.where(behind < 0.04, 0.04 - behind, 0.0)
    nodes = np.column_stack([-0.01 * np.cos(turn), 0 * turn, 0.4 + straight + 0.01 * np.sin(turn) - back])
    line = straight_tube()
    way = line.centreline.points if moves else None
    assert Containment(line, radius=SCOPE).outside(nodes, behind, 0.36, way) < 0


def test_many_worlds_are_judged_as_one_is():
    """Stations every centimetre instead of every two millimetres: no more than a millimetre apart, outside or in."""
    colons = [straight_tube(), swept_colon(winding([(0.1, 0.0), (0.12, 1.2), (0.1, 0.0)]), name="bend")]
    widths = stack_widths(colons)
    random = np.random.default_rng(0)
    for row, colon in enumerate(colons):
        own = LumenWidths(*(part[row] for part in widths))
        line = colon.centreline
        stations = np.column_stack([np.interp(own.arcs, line.arc, line.points[:, axis]) for axis in range(3)])
        for away in (0.0, 0.02, 0.045, 0.06):
            rows = np.searchsorted(line.arc, 0.25 - BEHIND)
            nodes = line.points[rows] + away * line.frames[rows, :, 0] + random.normal(0, 0.001, (3, 3))
            known = Containment(colon, radius=SCOPE).outside(nodes, BEHIND, 0.25)
            found = outside(
                np,
                own,
                stations,
                nodes,
                behind=BEHIND,
                inside=np.ones(3, bool),
                tip_arc=np.float64(0.25),
                radius=SCOPE,
                moves=False,
            )
            assert found == pytest.approx(known, abs=0.001 if away > 0.03 else 0.003)


def test_colon_that_a_scope_has_left_out_is_what_cannot_be_gathered_between_two_of_its_links():
    behind, inside = np.array([0.2, 0.15, 0.1, 0.05, 0.0]), np.array([False, True, True, True, True])
    sound = np.array([0.0, 0.3, 0.42, 0.5])  # 0.12 m of colon on 0.05 m of shaft: gathered
    assert most_skipped(np, sound, behind, inside) == 0.0
    left = np.array([0.0, 0.3, 0.55, 0.6])
    assert most_skipped(np, left, behind, inside) == pytest.approx(0.25 - 0.05 / SHORTEST)
    outside = np.array([-0.3, 0.3, 0.35, 0.4])  # what is not past the anus has left nothing out
    assert most_skipped(np, outside, behind, inside) == 0.0


def test_a_scope_that_leaves_a_loop_of_the_colon_empty_has_escaped():
    where = {"outside": 0.0, "arc": 0.6, "length": 1.5, "insertion": 0.4, "modelled": 1.7}
    assert ENDINGS[int(ending(np, skipped=EMPTY_LOOP / 2, **where))] is None
    assert ENDINGS[int(ending(np, skipped=2 * EMPTY_LOOP, **where))] is Outcome.ESCAPED
