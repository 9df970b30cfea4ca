import numpy as np
import pytest

from haustra.envs.runs.measure.containment import Containment, LumenWidths, outside, stack_widths
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
