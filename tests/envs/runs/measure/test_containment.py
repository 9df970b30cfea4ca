import numpy as np
import pytest

from haustra.envs.runs.measure.containment import Containment
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
