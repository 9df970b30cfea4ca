import numpy as np
import pytest
import trimesh

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.repair import genus, is_watertight, repair, signed_volume


def as_surface(mesh: trimesh.Trimesh) -> Surface:
    return Surface(vertices=np.asarray(mesh.vertices, dtype=float), faces=np.asarray(mesh.faces, dtype=np.int64))


def soup(surface: Surface) -> Surface:
    """Every triangle with its own corners, as STL has them."""
    return Surface(surface.vertices[surface.faces].reshape(-1, 3), np.arange(3 * len(surface.faces)).reshape(-1, 3))


@pytest.fixture
def ball() -> Surface:
    return as_surface(trimesh.creation.icosphere(subdivisions=3, radius=0.03))


def test_triangle_soup_is_welded_without_a_note(ball: Surface):
    repaired = repair(soup(ball))
    assert repaired.notes == ()
    assert len(repaired.surface.vertices) == len(ball.vertices)
    assert is_watertight(repaired.surface.faces)


def test_inverted_surface_is_turned_outwards(ball: Surface):
    repaired = repair(Surface(ball.vertices, ball.faces[:, ::-1].copy()))
    assert signed_volume(repaired.surface.vertices, repaired.surface.faces) > 0
    assert any("outwards" in note for note in repaired.notes)


def test_holes_get_lids_and_crumbs_go(ball: Surface):
    crumb = as_surface(trimesh.creation.box(extents=(0.002,) * 3))
    holed = ball.faces[np.linalg.norm(ball.vertices[ball.faces].mean(1) - [0, 0, 0.03], axis=1) > 0.008]
    both = Surface(
        np.concatenate([ball.vertices, crumb.vertices + 0.1]), np.concatenate([holed, crumb.faces + len(ball.vertices)])
    )
    repaired = repair(both)
    assert is_watertight(repaired.surface.faces)
    assert any("1 openings" in note for note in repaired.notes)
    assert any("largest of 2" in note for note in repaired.notes)
    volume = signed_volume(repaired.surface.vertices, repaired.surface.faces)
    assert volume == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=0.03)


def test_a_missing_wall_is_refused(ball: Surface):
    large = Surface(ball.vertices * 5, ball.faces[ball.vertices[ball.faces].mean(1)[:, 2] > 0])
    with pytest.raises(InvalidMeshError, match="part of the wall is missing"):
        repair(large)


def test_a_fin_on_the_surface_is_taken_off(ball: Surface):
    vertices = np.concatenate([ball.vertices, [[0.0, 0.0, 0.05]]])
    fin = [[ball.faces[0, 0], ball.faces[0, 1], len(ball.vertices)]]
    repaired = repair(Surface(vertices, np.concatenate([ball.faces, fin])))
    assert is_watertight(repaired.surface.faces)
    assert len(repaired.surface.faces) == len(ball.faces)
    assert any("more than two" in note for note in repaired.notes)


def test_triangles_wound_at_random_are_turned_to_agree(ball: Surface):
    turned = np.random.default_rng(0).random(len(ball.faces)) < 0.3
    faces = np.where(turned[:, None], ball.faces[:, ::-1], ball.faces)
    repaired = repair(Surface(ball.vertices, faces))
    volume = signed_volume(repaired.surface.vertices, repaired.surface.faces)
    assert volume == pytest.approx(signed_volume(ball.vertices, ball.faces))
    assert any(f"Turned {turned.sum()} triangles" in note for note in repaired.notes)


def test_two_boxes_that_touch_along_an_edge_part_there():
    # Four faces meet at the common edge. Were the wrong two joined, the boxes would be one body.
    one, two = (as_surface(trimesh.creation.box(bounds=[[x, x, 0], [x + 0.1, x + 0.1, 0.1]])) for x in (0.0, 0.1))
    both = Surface(
        np.concatenate([one.vertices, two.vertices]), np.concatenate([one.faces, two.faces + len(one.vertices)])
    )
    repaired = repair(both)
    assert any("largest of 2" in note for note in repaired.notes)
    assert signed_volume(repaired.surface.vertices, repaired.surface.faces) == pytest.approx(1e-3)


def test_genus_counts_handles(ball: Surface):
    torus = trimesh.creation.torus(major_radius=0.05, minor_radius=0.01)
    assert genus(ball.faces) == 0
    assert genus(np.asarray(torus.faces)) == 1


def test_a_point_is_no_surface():
    with pytest.raises(InvalidMeshError, match="no size"):
        repair(Surface(np.ones((3, 3)), np.array([[0, 1, 2]])))
