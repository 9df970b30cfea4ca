"""An instrument takes what lies in its way, within reach, not too oblique and not too wide."""

import numpy as np
import pytest

from haustra.models.anatomy.colon import Lesion
from haustra.models.devices.scope.instrument import PolypPose, channel_mouth, cut_width, out_of_reach

AHEAD = np.array([0.0, 0.0, 1.0])


def polyp(size: float = 0.006, kind: str = "sessile", *, at: float = 0.02, aside: float = 0.0, lean: float = 0.0):
    """A polyp ahead, seen from the top, or leaning so many degrees."""
    down = np.array([np.sin(np.radians(lean)), 0.0, np.cos(np.radians(lean))])
    middle = np.array([aside, 0.0, at])
    lesion = Lesion("polyp", kind, "small", size, size / 2, "sigmoid", 0.3, 0.0, (0.0, 0.0, 0.0))
    return PolypPose(top=middle - down * size / 4, foot=middle + down * size / 4, lesion=lesion)


@pytest.mark.parametrize(
    ("why", "own"),
    [
        (None, {}),
        ("too far", {"at": 0.05}),
        ("too near", {"at": 0.001}),
        ("beside the instrument's way", {"aside": 0.006}),
        ("at too wide an angle", {"lean": 130.0}),
        ("12 mm of tissue are too wide for a cold snare", {"size": 0.012}),
        (None, {"size": 0.012, "kind": "pedunculated"}),
        ("wider than the loop", {"size": 0.018, "kind": "pedunculated"}),
    ],
)
def test_a_snare_says_why_it_does_not_reach(why, own):
    assert out_of_reach("snare", np.zeros(3), AHEAD, polyp(**own)) == why


def test_forceps_need_not_go_round_but_must_touch():
    assert out_of_reach("forceps", np.zeros(3), AHEAD, polyp(0.02)) is None
    assert out_of_reach("forceps", np.zeros(3), AHEAD, polyp(0.004, aside=0.003)) == "beside the instrument's way"


def test_a_stalk_is_what_a_snare_goes_through():
    assert cut_width(polyp(0.012, "pedunculated").lesion) == pytest.approx(0.0042)
    assert cut_width(polyp(0.012).lesion) == 0.012


def test_the_channel_opens_below_the_axis():
    mouth = channel_mouth(np.zeros(3), np.eye(3))
    assert mouth[0] < -0.001 and not mouth[1:].any()
