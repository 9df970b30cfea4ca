"""The fisheye lens: where its middle and its rim look."""

import numpy as np
import pytest

from haustra.envs.view.picture.lens import lens_rays


def test_angles_from_the_axis_grow_evenly_to_half_the_field_of_view_at_the_rim():
    rays, within = lens_rays(140.0, 101)
    assert rays[50, 50] == pytest.approx([0.0, 0.0, 1.0])
    angle = np.degrees(np.arccos(rays[50, :, 2]))
    assert np.diff(angle[50:]) == pytest.approx(1.4, abs=0.02)
    assert angle[-1] == pytest.approx(70.0, abs=1.0)
    assert np.linalg.norm(rays, axis=-1) == pytest.approx(1.0)
    assert within[50].all() and not within[0, 0]


def test_wire_up_is_up_and_wire_left_is_left():
    rays, _ = lens_rays(140.0, 101)
    assert rays[0, 50, 0] > 0.9
    assert rays[50, 0, 1] > 0.9
