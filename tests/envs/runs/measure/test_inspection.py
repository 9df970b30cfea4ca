"""Mucosa counts as seen when it was near, square on, lit and sharp for half a second; polyps and landmarks likewise."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.measure.inspection import Inspection, blind_spots, in_view
from haustra.models.anatomy.colon import ColonSegment, Lesion
from haustra.models.anatomy.surface_landmarks import LANDMARKS, landmark_of_triangles
from tests.tube_colon import RADIUS, straight_tube

STILL = np.zeros(4)


def test_what_is_far_oblique_dark_or_blurred_is_not_in_view():
    near = np.full(4, 0.02)
    assert in_view(near, np.ones(4), STILL).all()
    assert in_view(np.array([0.02, 0.07, np.inf, 0.02]), np.ones(4), STILL).tolist() == [True, False, False, True]
    assert in_view(near, np.array([1.0, 0.2, -1.0, 0.5]), STILL).tolist() == [True, False, False, True]
    assert in_view(near, np.ones(4), np.array([0.0, 0.1, 0.01, 0.0])).tolist() == [True, False, True, True]
    glare = np.array([0.003, 0.003, 0.003, 0.05])  # light falls with the square of distance: 1/278
    assert in_view(glare, np.ones(4), STILL).tolist() == [True, True, True, False]


@pytest.fixture(scope="module")
def tube():
    """Rings every 10 mm, so that a triangle is a small place."""
    tube = straight_tube(0.2)
    arcs, sides = np.linspace(0.0, 0.2, 21), 48
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.vstack([np.column_stack([ring, np.full(sides, arc)]) for arc in arcs])
    k, row = np.meshgrid(np.arange(sides), sides * np.arange(20))
    after = row + (k + 1) % sides
    faces = np.vstack([np.stack(t, -1).reshape(-1, 3) for t in ((row + k, after, row + k + sides),)])
    faces = np.vstack([faces, np.stack([after, after + sides, row + k + sides], -1).reshape(-1, 3)])
    segments = (ColonSegment("rectum", 0.0, 0.1), ColonSegment("sigmoid", 0.1, 0.2))
    polyp = Lesion("polyp", "sessile", "small", 0.02, 0.0001, "sigmoid", 0.15, 0.0, (RADIUS, 0.0, 0.15))
    lumen = replace(tube.lumen, vertices=vertices, faces=faces)
    return replace(tube, lumen=lumen, segments=segments, lesions=(polyp,))


def test_half_a_second_without_interruption_counts(tube):
    found = Inspection(tube, tube.lumen.vertices[:, 2])
    rectum = found.arcs < 0.1
    for visible in (rectum, ~rectum, rectum, ~rectum):
        found.look(visible, 0.3)
    assert not found.seen.any()
    for _ in range(3):
        found.look(rectum, 0.3)
    scores = found.scores()
    assert scores["mucosa_seen_by_site"] == {"rectum": pytest.approx(1.0), "sigmoid": 0.0}
    assert 0.3 < scores["mucosa_seen"] < 0.5  # the lid's neighbourhood at the anus is no mucosa
    assert scores["inspection_s"] == pytest.approx(2.1)
    assert scores["blind_spots"] == 1


def test_a_polyp_is_seen_when_enough_of_it_is(tube):
    found = Inspection(tube, tube.lumen.vertices[:, 2])
    own = np.linalg.norm(tube.lumen.vertices[tube.lumen.faces].mean(1) - [RADIUS, 0.0, 0.15], axis=1) < 0.009
    assert own.any()
    for _ in range(3):
        found.look(np.zeros(len(own), bool), 0.3)
    assert found.scores()["polyps_seen"] == 0
    for _ in range(3):
        found.look(np.linalg.norm(tube.lumen.vertices[tube.lumen.faces].mean(1)[:, :2], axis=1) > 0, 0.3)
    scores = found.scores()
    assert scores["polyps"] == 1 and scores["polyps_seen"] == 1
    assert scores["polyp_list"][0]["in_view_s"] == pytest.approx(0.6)


def test_a_landmark_in_view_is_named(tube):
    found = Inspection(tube, tube.lumen.vertices[:, 2])
    assert found.landmarks_in_view(found.arcs < 0.02) == ["anal_verge"]
    assert found.landmarks_in_view(found.arcs > 0.02) == []


def test_valve_and_orifice_lie_in_the_caecum_and_flexures_at_their_borders(tube):
    names = ("descending", "transverse", "ascending", "caecum")
    ends = [0.0, 0.05, 0.1, 0.15, 0.2]
    segments = tuple(ColonSegment(name, *pair) for name, *pair in zip(names, ends, ends[1:], strict=False))
    arcs = tube.lumen.vertices[:, 2]
    found = landmark_of_triangles(replace(tube, segments=segments), arcs)
    middles = arcs[tube.lumen.faces].mean(axis=1)
    for name, low, high in (
        ("splenic_flexure", 0.02, 0.08),
        ("hepatic_flexure", 0.07, 0.13),
        ("ileocaecal_valve", 0.13, 0.17),
        ("appendix_orifice", 0.18, 0.2),
    ):
        own = middles[found == LANDMARKS.index(name)]
        assert len(own), name
        assert low <= own.min() and own.max() <= high, name


def test_blind_spots_are_patches_that_may_go_round_the_colon():
    shown = np.ones((10, 8))
    shown[2:4, [0, 7]] = 0.0
    shown[7, 3] = 0.2
    shown[9, :] = np.nan
    assert [size for size, _ in blind_spots(shown)] == [4, 1]
    assert blind_spots(np.ones((4, 4))) == []
