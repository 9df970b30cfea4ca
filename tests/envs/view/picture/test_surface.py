"""A colon's surface as pictures take it: as wide as gas holds it."""

import numpy as np
import pytest

from haustra.envs.view.picture.surface import ColonSurface
from tests.tube_colon import straight_tube


def test_a_fixed_colon_is_as_wide_as_gas_holds_it() -> None:
    """Vertices stand off the centreline by the share that is told for their arc length."""
    tube = straight_tube(0.2)
    surface = ColonSurface(tube)
    surface.widen(np.array([0.5, 0.5, 1.0]))
    for stretch in range(surface.count):
        surface.bring(stretch)
    line = tube.centreline
    middle = np.column_stack([np.interp(surface.arcs, line.arc, line.points[:, axis]) for axis in range(3)])
    before, now = (np.linalg.norm(places - middle, axis=1) for places in (surface.rest, surface.vertices))
    half = surface.arcs <= line.length / 2
    assert now[half] == pytest.approx(before[half] / 2, abs=1e-9)
    last = surface.arcs >= line.length - 1e-9
    assert now[last] == pytest.approx(before[last], abs=1e-9)
