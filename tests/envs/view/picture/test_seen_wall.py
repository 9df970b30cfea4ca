"""Which side of the wall a camera sees."""

import numpy as np

from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.seen_wall import WallCheck
from tests.tube_colon import RADIUS, straight_tube

_ALONG, _UP = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def test_within_the_lumen_all_is_mucosa_and_beside_it_the_wall_is_seen_from_outside() -> None:
    tube = straight_tube(0.3)
    check = WallCheck(tube, named_lens("cf-hq190l").at(32, 32))

    def seen(aside: float, ahead: np.ndarray = _ALONG):
        place = np.array([aside, 0.0, 0.1])
        return check.look(tube.lumen.vertices, CameraPose(place, looking(ahead, np.cross(ahead, [0.0, 1.0, 0.0]))))

    assert seen(0.0) == (1.0, 0.0)
    assert seen(0.9 * RADIUS) == (1.0, 0.0)
    beside = seen(1.2 * RADIUS, -_UP)  # looks back at the tube it has left
    assert beside.outer > 0.9 and beside.inner == 0.0
    assert seen(1.2 * RADIUS, _UP) == (0.0, 0.0)  # looks away, at nothing


def test_a_wall_that_was_moved_is_looked_at_where_it_is() -> None:
    tube = straight_tube(0.3)
    check = WallCheck(tube, named_lens("cf-hq190l").at(32, 32))
    pose = CameraPose(np.array([0.0, 0.0, 0.1]), looking(_ALONG, _UP))
    assert check.look(tube.lumen.vertices + np.array([2 * RADIUS, 0, 0]), pose).outer > 0.1
    assert check.look(tube.lumen.vertices, pose) == (1.0, 0.0)
