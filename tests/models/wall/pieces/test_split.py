"""Cutting a block gives convex parts that cover it and stand no deeper in the lumen than allowed."""

import numpy as np
import pytest
from manifold3d import Manifold

from haustra.models.wall.pieces.blocks import Block
from haustra.models.wall.pieces.cells import Site
from haustra.models.wall.pieces.split import convex_parts, intrusion, is_convex

CUBE = tuple(
    (sign * np.eye(3)[axis], 0.01 + (0.01 if axis == 0 else 0.0) * sign) for axis in range(3) for sign in (1.0, -1.0)
)
"""Half-spaces of a cube of 20 mm that begins at x = 0 and lies about the x axis."""
CUTS = (CUBE[0], *CUBE[2:])
"""Its faces but the one towards x = 0, which is lumen surface."""


def _block(groove: Manifold) -> Block:
    solid = Manifold.cube((0.02, 0.02, 0.02), True).translate((0.01, 0.0, 0.0)) - groove
    site = Site(0.0, 0.02, np.array([-0.02, 0.0, 0.0]), np.eye(3), 0.02, 0.02)
    return Block(solid, CUTS, site)


@pytest.fixture
def grooved() -> Block:
    """A square groove, 6 mm wide and 5 mm deep, along z."""
    return _block(Manifold.cube((0.01, 0.006, 0.04), True))


def test_depth_of_a_groove_is_its_depth(grooved):
    found = intrusion(grooved.solid, grooved.solid.hull(), grooved.planes)
    assert found.depth == pytest.approx(0.005, rel=1e-6)
    assert found.deepest[0] == pytest.approx(0.005)
    assert not is_convex(grooved, tolerance=0.004)
    assert is_convex(grooved, tolerance=0.0051)


def test_parts_cover_the_block_and_leave_the_groove_free(grooved):
    parts = list(convex_parts(grooved, tolerance=1e-4))
    assert 3 <= len(parts) <= 10
    union = Manifold.batch_boolean(parts, _add())
    assert (grooved.solid - union).volume() < 1e-12
    assert union.volume() == pytest.approx(grooved.solid.volume(), rel=1e-6)


def test_a_convex_block_is_one_part():
    block = _block(Manifold.cube((0.01, 0.1, 0.1), True))
    assert len(list(convex_parts(block, tolerance=1e-4))) == 1


def test_a_thin_slice_that_spans_the_lumen_is_not_taken_for_shallow():
    """A slice of 1 mm with a deep notch: its surface is everywhere within 1 mm of a cut, its hull plugs the notch."""
    slab = Manifold.cube((0.02, 0.02, 0.001), True).translate((0.01, 0.0, 0.0))
    notch = Manifold.cylinder(0.1, 0.006, 0.007, 64, True)
    planes = (*CUTS[:3], (np.array([0.0, 0.0, 1.0]), 0.0005), (np.array([0.0, 0.0, -1.0]), 0.0005))
    block = Block(slab - notch, planes, Site(0.0, 0.02, np.array([-0.02, 0.0, 0.0]), np.eye(3), 0.02, 0.02))
    assert not is_convex(block, tolerance=0.0015)


def _add():
    from manifold3d import OpType

    return OpType.Add
