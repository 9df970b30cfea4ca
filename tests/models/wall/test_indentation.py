"""The surface that is saved has the device inside, however deep it stands in the wall."""

from dataclasses import replace

import numpy as np
import pytest
from manifold3d import Manifold, Mesh64

from haustra.envs.runs.measure.surface import surface_figures
from haustra.models.anatomy.colon import Surface
from haustra.models.wall.indentation import JUMP_COST, JUMP_FREE, SLOPE, TOP, along_device, indented
from haustra.models.wall.signed_distance import surface_arcs
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import square_tube

_RADIUS = 0.0065


@pytest.mark.parametrize("deep", [0.0, 0.004, 0.012, 0.03])
def test_a_device_that_leans_on_the_wall_is_inside_what_is_saved(deep: float) -> None:
    """Even where all of it stands outside the wall that nobody touches; and no triangle turns over."""
    tube = swept_colon(winding([(0.4, 0.0)]), name="straight")
    arcs, line = surface_arcs(tube), tube.centreline
    wide = float(np.median(tube.radius))
    across = line.frames[0][:, 0]
    bump = np.exp(-(((line.arc - 0.2) / 0.05) ** 2))
    path = (line.points + (wide - _RADIUS + deep) * bump[:, None] * across)[line.arc < 0.3]
    assert surface_figures(tube, tube, arcs, path).outside == pytest.approx(max(deep - _RADIUS, 0.0), abs=0.006)
    now = indented(tube, arcs, path, radius=_RADIUS)
    found = surface_figures(tube, now, arcs, path)
    assert found.outside == 0.0 and found.turned_over == 0.0
    moved = np.linalg.norm(now.lumen.vertices - tube.lumen.vertices, axis=1)
    assert deep - 0.001 < moved.max() < deep + 0.0045  # folds are 4 mm high
    edges = np.concatenate([tube.lumen.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    lengths = np.linalg.norm(tube.lumen.vertices[edges[:, 0]] - tube.lumen.vertices[edges[:, 1]], axis=1)
    out, before = (np.hypot(each.lumen.vertices[:, 1], each.lumen.vertices[:, 2]) for each in (now, tube))
    rise, was = (np.abs(np.diff(each[edges], axis=1))[:, 0] for each in (out, before))
    # Rays part with the distance from the axis, so that a tall tent is steeper across it.
    assert (rise <= was + 1.2 * (SLOPE + 2 * deep / wide) * lengths).all(), "a tent, not a cliff"


def test_a_device_between_corners_that_are_far_apart_is_inside_too() -> None:
    """Flat sides whose triangles are wider than the device: none of their corners is near it."""
    tube = square_tube(0.3)
    solid = Manifold(Mesh64(tube.lumen.vertices, tube.lumen.faces.astype(np.uint64))).refine_to_length(0.03).to_mesh64()
    lumen = Surface(np.asarray(solid.vert_properties)[:, :3], np.asarray(solid.tri_verts).astype(np.int64))
    tube = replace(tube, lumen=lumen)
    arcs, line = surface_arcs(tube), tube.centreline
    bump = 0.035 * np.exp(-(((line.arc - 0.15) / 0.03) ** 2))
    path = (line.points + bump[:, None] * np.array([1.0, 1.0, 0.0]) / np.sqrt(2))[line.arc < 0.2]
    assert surface_figures(tube, tube, arcs, path).outside > 0.01
    found = surface_figures(tube, indented(tube, arcs, path, radius=_RADIUS), arcs, path)
    assert found.outside < 1e-6 and found.turned_over == 0.0


def test_what_touches_nothing_changes_nothing() -> None:
    tube = swept_colon(winding([(0.4, 0.0)]), name="straight")
    now = indented(tube, surface_arcs(tube), tube.centreline.points[:100], radius=_RADIUS)
    assert np.array_equal(now.lumen.vertices, tube.lumen.vertices)


def test_places_are_beside_the_stations_that_cost_least_together() -> None:
    """No way along the stations is left out that would cost less: held to all of them, one jump to any a place."""
    random, jumped = np.random.default_rng(0), 0
    for _ in range(6):
        tangents = np.cumsum(random.normal(size=(150, 3)) * 0.2, axis=0) + np.eye(3)[0]
        line = np.cumsum(0.0021 * tangents / np.linalg.norm(tangents, axis=1, keepdims=True), axis=0)
        nodes = np.concatenate([[0], np.sort(random.choice(np.arange(1, 90), 4, replace=False))])
        path = line[nodes] + random.normal(size=(5, 3)) * 0.004
        places, beside, high = along_device(path, line, 0.0021 * np.arange(150), 0.002, _RADIUS)
        first = np.concatenate([[True], (np.diff(places, axis=0) != 0).any(axis=1)])
        each, found = places[first], beside[np.concatenate([np.flatnonzero(first)[1:], [len(beside)]]) - 1]
        apart = np.abs(np.subtract.outer(np.arange(150), np.arange(150)))
        jump = JUMP_COST * 0.0021 * np.maximum(apart - int(JUMP_FREE / 0.0021), 0)
        away = np.square(line[None] - each[:, None]).sum(axis=2)
        least = jump[0] + away[0]
        for here in away[1:]:
            least = (least[:, None] + jump).min(axis=0) + here
        own = jump[0, found[0]] + jump[found[:-1], found[1:]].sum() + away[np.arange(len(each)), found].sum()
        assert own == pytest.approx(least.min(), rel=1e-9)
        assert high == pytest.approx(np.linalg.norm(places - line[beside], axis=1) + TOP * _RADIUS)
        jumped += (jump[found[:-1], found[1:]] > 0).sum()
    assert jumped > 3
