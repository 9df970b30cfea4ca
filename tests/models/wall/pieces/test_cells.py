"""Power cells fill space without overlap, and each holds its own stretch of the centreline."""

from itertools import pairwise

import numpy as np

from haustra.models.wall.pieces.cells import place_sites, power_cells


def test_cells_do_not_overlap_and_hold_their_sites(hairpin_colon):
    cells = list(power_cells(place_sites(hairpin_colon, spacing=0.02), thickness=0.03))
    assert len(cells) >= 8
    for number, cell in enumerate(cells):
        for normal, offset in cell.planes:
            assert normal @ cell.site.point <= offset + 1e-9
        for other in cells[number + 1 :]:
            assert (cell.region ^ other.region).volume() < 1e-12


def test_every_point_near_the_centreline_is_in_a_cell(hairpin_colon):
    sites = place_sites(hairpin_colon, spacing=0.02)
    cells = list(power_cells(sites, thickness=0.03))
    rng = np.random.default_rng(0)
    line = hairpin_colon.centreline
    inner = line.points[(line.arc > 0.02) & (line.arc < line.length - 0.02)]
    points = inner[rng.integers(len(inner), size=500)] + rng.uniform(-0.02, 0.02, (500, 3))
    held = np.zeros(len(points), bool)
    for cell in cells:
        held |= np.all([points @ normal <= offset + 1e-9 for normal, offset in cell.planes], axis=0)
    assert held.all()


def test_sites_share_the_centreline_without_gaps(tube_colon):
    sites = place_sites(tube_colon, spacing=0.02)
    assert sites[0].start == 0.0
    assert sites[-1].end == tube_colon.centreline.length
    assert all(a.end == b.start for a, b in pairwise(sites))
