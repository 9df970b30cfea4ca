"""Depth pictures by MuJoCo Warp against those by the table of the lumen, and against a tube of known radius."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the extra warp is not installed")

from haustra.envs.tasks.pictures import Pictures, in_bytes
from haustra.envs.tasks.sight import RANGE, Sight
from haustra.envs.view.picture.lens import lens_rays
from haustra.envs.view.picture.warp_cameras import WarpCameras
from tests.task_bank import short_bank

SIZE, VIEW = 32, 140.0
ARCS = np.array([0.05, 0.1, 0.04, 0.15])
CASES = np.array([0, 1, 1, 0])
INSIDE = np.zeros((4, 3))


@pytest.fixture(scope="module")
def cameras() -> WarpCameras:
    colons = [case.colon() for case in short_bank().cases]
    return WarpCameras(colons, worlds=4, size=SIZE, field_of_view_deg=VIEW, reach=RANGE, device="cpu")


def eyes() -> tuple[np.ndarray, np.ndarray]:
    cases = [short_bank().cases[case] for case in CASES]
    stations = [round(arc / case.step) for arc, case in zip(ARCS, cases, strict=True)]
    places = [(case.points[at], case.frames[at]) for case, at in zip(cases, stations, strict=True)]
    return np.array([place for place, _ in places]), np.array([frame for _, frame in places])


def test_both_ways_to_look_see_the_same(cameras: WarpCameras):
    """Each world in its own colon. The table knows no overhangs, so that only most pixels can agree."""
    place, frame = eyes()
    bank = short_bank()
    known = in_bytes(Pictures(bank, Sight(bank.cases), VIEW).depth(CASES, place, frame, ARCS, SIZE))
    off = np.abs(cameras.depth(CASES, place, frame, INSIDE).astype(float) - known)
    assert np.median(off) <= 1
    assert np.percentile(off, 95) <= 8  # of 255: 4 mm


def test_a_tube_is_as_far_as_it_is(cameras: WarpCameras):
    place, frame = eyes()
    found = cameras.depth(CASES, place, frame, INSIDE)[2] * (RANGE / 255)  # between two folds
    rays, within = lens_rays(VIEW, SIZE)
    rim = within & (rays[..., 2] < np.cos(np.radians(60)))
    aside = np.hypot(rays[..., 0], rays[..., 1])
    assert (found * aside)[rim] == pytest.approx(0.02, rel=0.05)
    assert (found[~within] == 0).all()


@pytest.mark.parametrize("turned", [False, True], ids=["along the colon", "at the wall"])
def test_from_a_little_way_inside_the_wall_it_sees_wall_there_and_the_lumen_behind(cameras: WarpCameras, turned: bool):
    """2.5 mm beyond the wall, as the table of the lumen has it too, which holds what was pressed in for hit at once."""
    place, frame = eyes()
    sight = Sight(short_bank().cases)
    pressed = place + 0.0225 * frame[..., 0]
    beyond = sight.beyond(CASES, pressed, ARCS)
    assert np.einsum("wi,wi->w", beyond, frame[..., 0]).min() > 0.9
    if turned:
        frame = np.stack([-frame[..., 2], frame[..., 1], frame[..., 0]], axis=-1)
    found = cameras.depth(CASES, pressed, frame, beyond)
    known = in_bytes(Pictures(short_bank(), sight, VIEW).depth(CASES, pressed, frame, ARCS, SIZE))
    rays, within = lens_rays(VIEW, SIZE)
    outwards = np.einsum("hwi,cij,cj->chw", rays, frame.swapaxes(-1, -2), beyond) > 0
    assert found[within & outwards].max() == 0
    assert known[within & outwards].max() <= 20
    if turned:
        assert (outwards | ~within).mean() > 0.95
    else:
        assert found[within & ~outwards].max() > 100
    assert not sight.beyond(CASES, place, ARCS).any()
