"""The outside of one loop keeps out of its neighbour's lumen, and a wall says how far it does not."""

import numpy as np
import pytest
from manifold3d import Manifold, Mesh64

from haustra.errors import WallAccuracy
from haustra.models.wall.pieces import build
from haustra.models.wall.pieces.build import build_wall
from haustra.models.wall.pieces.clearing import Cleared, clear_neighbours
from haustra.models.wall.pieces.neighbours import Neighbours, deepest
from haustra.models.wall.pieces.rays import Caster
from haustra.models.wall.pieces.wall import WallPiece

OPTIONS = {"method": "prism", "tolerance": 0.0015, "rays": 1000, "workers": 2, "use_cache": False}


def _plate(*, low: float, high: float, start: float) -> WallPiece:
    """A plate between the hairpin's straights, 6 mm square, from `low` to `high` across, of a block of 20 mm."""
    x, y, z = np.meshgrid([0.012, 0.018], [low, high], [-0.003, 0.003], indexing="ij")
    return WallPiece(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), start, start + 0.02)


def _depth(colon, pieces) -> float:
    return deepest(Neighbours(colon).standing(pieces), Caster(colon.lumen))


def test_walls_of_loops_that_nestle_stay_out_of_each_other(nested_colon):
    """By the wall's own figure, and by exact solids where a plane parts the lumens of both straights.

    Without `clear_neighbours` pieces of one straight stand 1.4 mm in the other's bulge.
    """
    wall = build_wall(nested_colon, **OPTIONS)
    assert wall.error.neighbour_max_mm is not None
    assert wall.error.neighbour_max_mm < 0.02
    assert wall.error.leaks == 0
    assert wall.metadata["pieces_cut_back"]
    lumen = Manifold(Mesh64(nested_colon.lumen.vertices, nested_colon.lumen.faces.astype(np.uint64)))
    bulge = lumen ^ Manifold.cube((0.006, 0.020, 0.040)).translate((0.027, 0.018, -0.020))
    straight = [Manifold.hull_points(piece.vertices) for piece in wall.pieces if piece.end < 0.070]
    assert bulge.volume() > 1e-9
    assert sum((hull ^ bulge).volume() for hull in straight) < 1e-12


def test_a_wall_whose_loops_stand_in_each_other_is_refused(nested_colon, monkeypatch):
    monkeypatch.setattr(build, "clear_neighbours", lambda near, all_: Cleared(tuple(all_), 0, near.standing(all_)))
    with pytest.raises(WallAccuracy, match=r"stands up to 1\.\d\d mm in the lumen of another"):
        build_wall(nested_colon, **OPTIONS, max_error_mm=1.2)


def test_depth_is_how_far_a_plate_stands_in_the_next_loop(hairpin_colon):
    """The second straight begins 22 mm from the first one's axis, less up to 0.1 mm, as it has 32 sides."""
    assert _depth(hairpin_colon, [_plate(low=0.0205, high=0.0230, start=0.0)]) == pytest.approx(0.001, abs=1e-4)
    assert _depth(hairpin_colon, [_plate(low=0.0205, high=0.0215, start=0.0)]) == 0.0


def test_what_stands_in_its_own_lumen_is_no_neighbours(hairpin_colon):
    own = _plate(low=0.0190, high=0.0215, start=0.0)
    assert _depth(hairpin_colon, [own]) == 0.0
    assert clear_neighbours(Neighbours(hairpin_colon), [own]).pieces == (own,)


def test_a_plate_is_cut_back_to_the_next_loop_and_keeps_its_inner_side(hairpin_colon):
    found = clear_neighbours(Neighbours(hairpin_colon), [_plate(low=0.0205, high=0.0230, start=0.0)])
    assert found.cut == 1
    assert deepest(found.left, Caster(hairpin_colon.lumen)) < 2e-5
    corners = np.concatenate([piece.vertices for piece in found.pieces])
    assert corners[:, 1].min() == 0.0205
    hull = max((Manifold.hull_points(piece.vertices) for piece in found.pieces), key=lambda part: part.volume())
    assert hull.volume() > 0.9 * 0.006 * 0.006 * 0.0015
