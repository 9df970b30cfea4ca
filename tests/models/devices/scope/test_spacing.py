"""Spacing after the simulator paper's eq. 2."""

import math

import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.cells import cut_into_cells
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.scope.spacing import adaptive_spacing, curvature_radii, splits


def test_a_rod_is_no_longer_than_the_chord_of_its_bend_on_the_outer_wall():
    for radius in (0.02, 0.05, 0.1):
        chord = (radius + 0.02) * math.sqrt(2 * (1 - math.cos(0.3)))
        n = splits(0.04, radius, 0.04, 0.3)
        assert 0.04 / 2**n <= chord < 2 * 0.04 / 2**n


def test_tight_or_narrow_places_split_wide_and_straight_ones_merge():
    assert splits(0.04, 0.02, 0.03, 0.35) > 0 > splits(0.04, 1.0, 0.05, 0.35)
    assert splits(0.04, 0.05, 0.02, 0.35) >= splits(0.04, 0.05, 0.06, 0.35)


def hook(radius: float = 0.04):
    """Straight for 0.4 m, half a turn, straight for 0.4 m."""
    turn = np.linspace(0, np.pi, 60)[1:-1]
    line = np.vstack(
        [
            np.stack([np.zeros(200), np.linspace(0, 0.4, 200)], axis=1),
            np.stack([radius - radius * np.cos(turn), 0.4 + radius * np.sin(turn)], axis=1),
            np.stack([np.full(200, 2 * radius), np.linspace(0.4, 0, 200)], axis=1),
        ]
    )
    points = np.column_stack([line, np.zeros(len(line))])
    arc = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return points, arc, np.full(len(arc), 0.04)


def test_curvature_is_that_of_the_axis():
    points, arc, width = hook()
    radii = curvature_radii(points, arc, width)
    assert np.median(radii[215:245]) == pytest.approx(0.04, rel=0.05)
    assert radii[100] > 1


def test_only_what_passes_the_bend_is_cut_fine():
    points, arc, width = hook()
    size = adaptive_spacing(points, arc, width, mean_length=0.04, largest_bend=0.35, shortest=0.0128)
    assert size(0.0) < 0.04 < size(arc[-1] - 0.2)
    design = named_design("adult")
    cells = cut_into_cells(design, shaft_cell=size, bending_cell=0.0125, length=0.9)
    assert cells[-1].start + cells[-1].length + design.tip.length == pytest.approx(0.9)
    lengths = np.array([cell.length for cell in cells if not cell.steerable])
    assert (np.diff(lengths) < 1e-9).all()
    uniform = cut_into_cells(design, shaft_cell=float(lengths.min()), bending_cell=0.0125, length=0.9)
    assert len(cells) < len(uniform)


def test_impossible_options_are_refused():
    with pytest.raises(InvalidOptionError, match="at most 180 degrees"):
        adaptive_spacing(*hook(), mean_length=0.04, largest_bend=4.0, shortest=0.01)
