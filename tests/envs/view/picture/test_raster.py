"""Triangles cover the pixels they should, nearest first."""

from itertools import pairwise

import numpy as np
import pytest

from haustra.envs.view.picture.camera import Camera, looking
from haustra.envs.view.picture.raster import DepthBuffer, fragments, vertex_normals


@pytest.mark.parametrize("extent", [3.0, 17.3, 90.0])
def test_a_mesh_covers_its_area_without_holes(extent: float) -> None:
    """A square cut into triangles that share edges leaves no pixel of its inside out."""
    steps = np.linspace(5.0, 5.0 + extent, 4)
    squares = [(a, b, c, d) for a, c in pairwise(steps) for b, d in pairwise(steps)]
    corners = np.array([t for a, b, c, d in squares for t in ([[a, b], [c, b], [c, d]], [[a, b], [c, d], [a, d]])])
    pixels = np.concatenate([batch.pixel for batch in fragments(corners, width=100, height=100)])
    centres = np.arange(100) + 0.5
    inside = (centres >= 5.0) & (centres <= 5.0 + extent)
    assert set(pixels) == set(np.flatnonzero(inside[:, None] & inside[None, :]))


def test_weights_interpolate_linearly() -> None:
    corners = np.array([[[2.2, 3.1], [61.0, 8.3], [20.4, 55.9]]])
    for batch in fragments(corners, width=64, height=64):
        position = np.einsum("fk,kc->fc", batch.weights, corners[0])
        np.testing.assert_allclose(position[:, 0], batch.pixel % 64 + 0.5, atol=1e-9)
        np.testing.assert_allclose(position[:, 1], batch.pixel // 64 + 0.5, atol=1e-9)


def test_the_nearest_triangle_stays() -> None:
    square = np.array([[0.0, 0.0], [40.0, 0.0], [0.0, 40.0]])
    corners = np.stack([square, square, square])
    depths = np.array([3.0, 1.0, 2.0])
    buffer = DepthBuffer(width=20, height=20)
    for batch in fragments(corners, width=20, height=20):
        buffer.add(batch, depths[batch.triangle])
    covered = np.isfinite(buffer.depth)
    assert covered.all()
    assert set(buffer.triangle) == {1}


def test_triangles_outside_and_behind_are_left_out() -> None:
    corners = np.array([[[-9.0, 1.0], [-2.0, 1.0], [-5.0, 8.0]], [[np.nan, 1.0], [4.0, 1.0], [2.0, 8.0]]])
    assert sum(len(batch.pixel) for batch in fragments(corners, width=10, height=10)) == 0


def test_perspective_of_a_known_point() -> None:
    """tan(45 degrees) = 1: with a field of view of 90 degrees, equal height and distance reach the image's edge."""
    camera = Camera(np.zeros(3), looking(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])), 90.0)
    points = np.array([[2.0, 0.0, 0.0], [2.0, 0.0, 2.0], [2.0, -1.0, 0.0]])
    image, depth = camera.perspective(points, width=200, height=100)
    np.testing.assert_allclose(image, [[100, 50], [100, 0], [125, 50]], atol=1e-9)
    np.testing.assert_allclose(depth, 2.0)


def test_normals_of_a_sphere_are_radial() -> None:
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=3)
    normals = vertex_normals(np.asarray(sphere.vertices), np.asarray(sphere.faces))
    assert np.min(np.sum(normals * sphere.vertices, axis=1)) > 0.999
