"""A polyp that is cut off is gone from the surface, and no more than it and a rim is."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.models.anatomy.colon import Lesion, Surface
from haustra.models.anatomy.lesion_shapes import cut_open
from haustra.models.anatomy.lesion_surface import lesion_of_triangles
from haustra.models.anatomy.repair import signed_volume
from haustra.models.anatomy.resection import bitten, resected
from tests.tube_colon import RADIUS, straight_tube

WIDTH = 0.008


@pytest.fixture(scope="module")
def tube():
    return straight_tube(0.2)


@pytest.fixture(scope="module", params=["sessile", "pedunculated", "flat"])
def colon(request, tube):
    """A straight tube with one polyp, cut into it as colons are grown."""
    import manifold3d

    from haustra.models.anatomy import lesion_shapes

    height = {"sessile": WIDTH / 2, "flat": 0.002, "pedunculated": 1.7 * WIDTH}[request.param]
    polyp = Lesion("polyp", request.param, "small", WIDTH, height, "sigmoid", 0.15, 0.0, (RADIUS, 0.0, 0.15))
    solid = lesion_shapes._solid(tube.lumen)
    outline, foot, axis = lesion_shapes.lesion_outline(polyp), np.array(polyp.position), np.array([-1.0, 0.0, 0.0])
    cut = solid - lesion_shapes._placed(outline, foot, axis)
    assert isinstance(cut, manifold3d.Manifold)
    return replace(tube, lumen=lesion_shapes._surface(cut), lesions=(polyp,))


def volume(surface: Surface) -> float:
    return signed_volume(surface.vertices, surface.faces)


def test_its_triangles_are_known(colon):
    """A dome has the area of a half ball; a head on a stalk nearly that of a whole one."""
    own = lesion_of_triangles(colon) == 0
    corners = colon.lumen.vertices[colon.lumen.faces[own]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    ball = np.pi * WIDTH**2
    low, high = {"sessile": (0.45, 0.55), "flat": (0.25, 0.45), "pedunculated": (0.95, 1.4)}[colon.lesions[0].type]
    assert low * ball < area < high * ball


def test_a_snare_takes_the_polyp_and_leaves_a_shallow_wound(colon, tube):
    after = resected(colon, 0, margin=0.001, depth=0.0005)
    assert after.lesions == ()
    polyp = volume(tube.lumen) - volume(colon.lumen)
    wound = volume(after.lumen) - volume(tube.lumen)
    assert polyp > 2e-8
    half = (WIDTH if colon.lesions[0].type != "pedunculated" else 0.35 * WIDTH) / 2 + 0.001
    deep = 0.0005 + half**2 / (8 * RADIUS)  # below the foot, and where the round wall rises beside it, on average
    assert wound == pytest.approx(np.pi * half**2 * deep, rel=0.1)
    assert np.abs(after.lumen.vertices[:, 0]).max() < RADIUS + 0.0006
    edges = np.sort(after.lumen.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_forceps_take_a_bite(colon):
    """Half a ball at most is left open at the top, as deep as its radius."""
    polyp, after = colon.lesions[0], bitten(colon, 0, size=0.0024)
    assert 0 < volume(after.lumen) - volume(colon.lumen) < np.pi / 12 * 0.0024**3 * 1.05
    top = np.array(polyp.position) + polyp.extent * np.array([-1.0, 0.0, 0.0])
    away = after.lumen.vertices - top
    bottom = away[np.hypot(away[:, 1], away[:, 2]) < 1e-5]
    assert bottom[:, 0].max() == pytest.approx(0.0012, abs=1e-5)
    assert np.linalg.norm(away, axis=1).min() > 0.0011


def test_what_would_open_into_another_wall_is_refused(tube):
    outline = np.array([[0.0, -0.001], [0.005, -0.001], [0.005, 0.3], [0.0, 0.3]])
    outside = cut_open(tube.lumen, outline, np.array([0.1, 0.0, 0.1]), np.array([0.0, 0.0, 1.0]))
    assert outside is None  # an island beside the lumen
