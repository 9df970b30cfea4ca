import numpy as np
import trimesh

from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.crossings import crossing_triangles


def surface(*meshes: trimesh.Trimesh) -> Surface:
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Surface(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, before, strict=False)]),
    )


def test_a_sphere_does_not_cross_itself_and_two_that_overlap_do():
    ball = trimesh.creation.icosphere(subdivisions=3)
    away, near = ball.copy(), ball.copy()
    away.apply_translation([2.1, 0, 0])
    near.apply_translation([1.5, 0.01, 0.02])
    assert len(crossing_triangles(surface(ball))) == 0
    assert len(crossing_triangles(surface(ball, away))) == 0
    assert len(crossing_triangles(surface(ball, near))) > 10


def test_a_vertex_pulled_through_the_other_side_is_found():
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.array(ball.vertices)
    vertices[0] *= -1.3
    assert len(crossing_triangles(Surface(vertices=vertices, faces=np.asarray(ball.faces)))) > 0


def test_a_fan_folded_through_its_own_neighbour_is_found():
    """Two triangles that share one vertex, the far edge of one passing through the other."""
    vertices = np.array([[0, 0, 0], [2, -1, 0], [2, 1, 0], [1, 0, -1], [1, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 3, 4]])
    assert len(crossing_triangles(Surface(vertices=vertices, faces=faces))) == 1
