"""The tabulated wall against the exact one, and against circles where depth and normal are known."""

import numpy as np
import pytest

from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Surface
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.tube import tube
from haustra.models.wall import vectors
from haustra.models.wall.lumen_table import (
    depth_bound,
    least_radius,
    lumen_table,
    pick,
    query,
    stack,
    table_between,
)
from haustra.provenance import Provenance

_LUMEN, _DEVICE = 0.02, 0.006


def _bent_tube(bend_radius: float) -> Colon:
    """A round tube along a quarter of a circle, with 0.1 m of straight tube before and behind."""
    angle = np.linspace(0, np.pi / 2, 60)[1:]
    straight = np.linspace(0, 0.1, 40)[:, None] * [0.0, 0.0, 1.0]
    arc = [0, 0, 0.1] + bend_radius * np.column_stack([1 - np.cos(angle), 0 * angle, np.sin(angle)])
    after = arc[-1] + np.linspace(0, 0.1, 40)[1:, None] * [1.0, 0.0, 0.0]
    line = centreline_through(np.vstack([straight, arc, after]), 0.002)
    lumen: Surface = tube(line.points, line.frames, np.full((len(line.points), 48), _LUMEN))
    return _colon(lumen, line)


def _colon(lumen: Surface, line: Centreline) -> Colon:
    return Colon(
        name="tube",
        lumen=lumen,
        centreline=line,
        radius=np.full((len(line.points), 64), _LUMEN),
        segments=(ColonSegment("rectum", 0.0, line.length),),
        provenance=Provenance(inputs={}, configuration={}),
    )


def test_depth_and_normal_in_a_straight_stretch() -> None:
    field = lumen_table(_bent_tube(0.06), device_radius=_DEVICE)
    points = np.array([[0.015, 0, 0.05], [0.0, -0.012, 0.05], [0.0, 0.016, 0.051]])
    found = query(np, field.tables, points, np.full(3, 0.05))
    # The surface is a polygon of 48 corners: its sides are 0.2 % nearer than its corners.
    np.testing.assert_allclose(found.depth, [0.001, -0.002, 0.002], atol=6e-5)
    # Half the angle between two sides is 3.75 degrees.
    np.testing.assert_allclose(found.inwards, [[-1, 0, 0], [0, 1, 0], [0, -1, 0]], atol=0.066)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_depth_in_a_bend_on_either_side(side: float) -> None:
    """Across a bend, depth is the distance from the circle of the tube's wall."""
    field = lumen_table(_bent_tube(0.06), device_radius=_DEVICE)
    middle = np.array([0.06, 0, 0.1])
    outward = np.array([-1.0, 0, 1.0]) / np.sqrt(2)
    point = middle + (0.06 + side * 0.015) * outward
    found = query(np, field.tables, point[None], np.array([0.1 + 0.06 * np.pi / 4]))
    assert found.depth[0] == pytest.approx(0.001, abs=1e-4)
    assert found.inwards[0] @ (-side * outward) > np.cos(np.radians(3.8))


def test_arc_follows_a_point_that_moves_along() -> None:
    colon = _bent_tube(0.06)
    field = lumen_table(colon, device_radius=_DEVICE)
    line = colon.centreline
    arcs = np.array([line.arc[5]])
    for point in line.points[5::3]:
        arcs = query(np, field.tables, point[None], arcs).arcs
    assert arcs[0] == pytest.approx(line.length, abs=0.006)


def test_error_against_the_surface_of_a_grown_colon() -> None:
    """Folds and haustra included: depths to 0.3 mm, which is less than the pieces' own 0.7 mm."""
    error = lumen_table(grow_colon(seed=1), device_radius=0.0064).error
    assert error.probes > 1000
    assert error.depth_p95 < 3e-4
    assert abs(error.depth_mean) < 5e-5


def test_stacked_tables_are_those_of_each_colon() -> None:
    fields = [lumen_table(_bent_tube(radius), device_radius=_DEVICE) for radius in (0.05, 0.08)]
    points = np.array([[0.015, 0.001, 0.12], [0.01, 0.012, 0.11]])
    arcs = np.array([0.12, 0.11])
    together = query(
        np, pick(stack([f.tables for f in fields]), np.array([1, 0])), np.stack([points] * 2), np.stack([arcs] * 2)
    )
    for world, colon in enumerate((1, 0)):
        alone = query(np, fields[colon].tables, points, arcs)
        np.testing.assert_array_equal(together.depth[world], alone.depth)
        np.testing.assert_array_equal(together.inwards[world], alone.inwards)


def test_a_table_between_two_radii_is_as_good_as_one_of_its_own() -> None:
    """In the middle between tables 1 mm apart, places of first touch are 30 um off at most in 95 of 100 rays."""
    colon, radius = grow_colon(seed=1), 0.00575
    first, last, own = (lumen_table(colon, device_radius=radius + shift).tables for shift in (-5e-4, 5e-4, 0.0))
    found = table_between(first, last, radius)
    assert float(found.device_radius) == radius
    off = np.abs(found.wall[..., 0] - own.wall[..., 0])
    assert np.percentile(off, 50) < 2e-6 and np.percentile(off, 95) < 3e-5
    assert table_between(own, own, radius).wall == pytest.approx(own.wall, abs=0)


def test_a_table_is_read_from_the_cache_and_made_again_where_that_is_broken(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path))
    colon = _bent_tube(0.06)
    fresh = lumen_table(colon, device_radius=_DEVICE)
    (kept,) = tmp_path.rglob("*.npz")
    again = lumen_table(colon, device_radius=_DEVICE)
    assert (again.tables.wall == fresh.tables.wall).all() and again.error == fresh.error
    kept.write_bytes(b"PK, but no archive")
    assert (lumen_table(colon, device_radius=_DEVICE).tables.wall == fresh.tables.wall).all()


def test_no_point_is_deeper_than_its_bound():
    """Most points between centreline and wall are kept clear by it, so that nothing more of them is looked up."""
    own = lumen_table(_bent_tube(0.06), device_radius=_DEVICE).tables
    random = np.random.default_rng(0)
    rows = random.integers(2, len(own.points) - 2, 400)
    out = random.normal(size=(400, 3)) * [0.007, 0.007, 0.001]
    points = own.points[rows] + np.einsum("pij,pj->pi", own.frames[rows], out)
    found = query(np, own, points, own.step * rows)
    beside = own._replace(points=np.column_stack([own.points, least_radius(own.wall)]))
    colon = own.step, own.first, own.count
    bound = depth_bound(np, beside, *colon, vectors.of(points), found.arcs)
    assert (bound >= found.depth).all()
    assert ((bound > 0) == (found.depth > 0)).mean() > 0.9
    assert (bound < 0).any()
    assert (bound > 0).any()
