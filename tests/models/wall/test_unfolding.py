"""No triangle of a surface that has moved faces its axis the other way than at rest."""

from dataclasses import replace

import numpy as np

from haustra.models.anatomy.colon import Surface
from haustra.models.wall.mesentery import axis_nodes
from haustra.models.wall.signed_distance import surface_arcs
from haustra.models.wall.unfolding import STRIDE, facing_out, unfolded
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


def test_wall_that_was_drawn_past_its_neighbours_is_spread_again() -> None:
    """A patch of vertices is pushed 6 mm along the colon, past those beside it, which stay."""
    tube = swept_colon(winding([(0.1, 0.0), (0.1, 1.2), (0.1, 0.0)]), name="bend")
    arcs, along = surface_arcs(tube), tube.centreline.frames[0][:, 2]
    vertices = tube.lumen.vertices.copy()
    patch = np.linalg.norm(vertices - vertices[np.abs(arcs - 0.05).argmin()], axis=1) < 0.006
    vertices[patch] += 0.006 * along
    torn = replace(tube, lumen=Surface(vertices, tube.lumen.faces))
    assert (facing_out(tube, arcs) & ~facing_out(torn, arcs)).sum() > 3
    mended = unfolded(tube, torn, arcs)
    assert not (facing_out(tube, arcs) & ~facing_out(mended, arcs)).any()
    moved = np.linalg.norm(mended.lumen.vertices - vertices, axis=1)
    assert 0 < (moved > 0).mean() < 0.02 and moved.max() < 5 * STRIDE
    assert np.array_equal(unfolded(tube, tube, arcs).lumen.vertices, tube.lumen.vertices)


def test_vertices_stand_in_the_sections_that_take_them_along() -> None:
    """Offsets from the axis are across it; where they were not, bends that open turned triangles over."""
    tube = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.1, 0.0)]), name="bend")
    line, arcs = tube.centreline, surface_arcs(tube)
    at, _, tangents = axis_nodes(line.points, line.arc)
    middle, tangent = (
        np.column_stack([np.interp(arcs, own, values[:, axis]) for axis in range(3)])
        for own, values in ((line.arc, line.points), (at, tangents))
    )
    inside = (arcs > 0.01) & (arcs < line.length - 0.01)
    ahead = np.einsum("vi,vi->v", tube.lumen.vertices - middle, tangent)[inside]
    assert np.abs(ahead).max() < 1e-5
