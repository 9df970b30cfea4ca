import numpy as np
import pytest
import trimesh
from bent_tube import bent_tube, hairpin

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.lumen_grid import lumen_graph, surface_samples
from haustra.models.anatomy.rays import LumenRays
from haustra.models.anatomy.repair import signed_volume


def ball(radius: float = 0.05) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Surface(vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))


def test_points_fill_a_ball_and_know_their_distance_to_its_surface():
    graph = lumen_graph(ball(), volume=4 / 3 * np.pi * 0.05**3, inside_points=20_000)
    depth = 0.05 - np.linalg.norm(graph.points, axis=1)
    assert depth.min() > 0
    assert len(graph.points) * graph.spacing**3 == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.01)
    np.testing.assert_allclose(graph.clearance, depth, atol=2 * graph.spacing)
    assert np.abs(graph.clearance - depth).mean() < 0.15 * graph.spacing


def test_no_link_crosses_a_wall_thinner_than_the_grid():
    surface = bent_tube(hairpin(leg=0.15, apart=0.0405), 0.02)  # 0.5 mm between the legs
    graph = lumen_graph(surface, volume=signed_volume(surface.vertices, surface.faces), inside_points=20_000)
    assert graph.spacing > 0.0025
    start, end = graph.points[graph.links[:, 0]], graph.points[graph.links[:, 1]]
    assert LumenRays(surface).clear(start, end).all()


def test_an_inward_wound_surface_has_no_inside():
    inverted = ball()
    with pytest.raises(InvalidMeshError, match="orientation"):
        lumen_graph(Surface(inverted.vertices, inverted.faces[:, ::-1].copy()), volume=5e-4, inside_points=1000)


def test_samples_lie_on_the_surface_within_the_spacing():
    surface = ball()
    samples = surface_samples(surface, 0.002)
    assert np.linalg.norm(samples, axis=1) == pytest.approx(0.05, rel=0.01)
