"""What the renderer's rays meet, against rays that are followed one by one, and against known shapes."""

import numpy as np
import pytest
import trimesh

from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.renderer import CameraPose, RayRenderer
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon, Surface
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

SIZE = 72


@pytest.fixture(scope="module")
def bent() -> Colon:
    return swept_colon(winding([(0.04, 0.0), (0.06, 0.9), (0.04, 0.0)]), name="bent")


def pose_in(colon: Colon, arc: float, aside: float = 0.0) -> CameraPose:
    line = colon.centreline
    here = int(np.searchsorted(line.arc, arc))
    frame = line.frames[here]
    return CameraPose(line.points[here] + aside * frame[:, 0], looking(frame[:, 2] + 0.3 * frame[:, 1], frame[:, 0]))


def followed(surface: Surface, pose: CameraPose, rays: np.ndarray) -> np.ndarray:
    """Distances to the nearest triangle that is seen from inside, by Moller and Trumbore's test of every triangle."""
    a, b, c = (surface.vertices[surface.faces[:, corner]] for corner in range(3))
    first, second = b - a, c - a
    found = np.full(len(rays), np.inf)
    for n, ray in enumerate(rays @ pose.rotation.T):
        across = np.cross(ray, second)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1 / np.einsum("ti,ti->t", first, across)
            u = scale * np.einsum("ti,ti->t", pose.position - a, across)
            along = np.cross(pose.position - a, first)
            v, way = scale * (along @ ray), scale * np.einsum("ti,ti->t", second, along)
            facing = np.einsum("ti,i->t", np.cross(first, second), ray) > 0
            hit = facing & (u >= 0) & (v >= 0) & (u + v <= 1) & (way > 0)
        found[n] = way[hit].min(initial=np.inf)
    return found


@pytest.mark.parametrize(("lens", "aside"), [("cf-hq190l", 0.0147), ("endomapper", 0.0), ("equidistant", 0.0147)])
def test_distances_are_those_of_exact_rays(bent: Colon, lens: str, aside: float) -> None:
    """Within 0.05 mm; 1 mm from a wall with triangles of 4 mm, which are seen very wide, and on the centreline."""
    renderer = RayRenderer(bent.lumen, named_lens(lens).at(SIZE // 2, SIZE // 2))
    pose = pose_in(bent, 0.03, aside)
    view = renderer.look(pose)
    within = renderer.lens.within
    known = followed(bent.lumen, pose, renderer.lens.grid[within])
    assert np.isfinite(known).all()
    assert np.abs(view.distance[within] - known).max() < 5e-5
    assert (view.triangle[~within] == -1).all()
    assert np.isinf(view.depth[~within]).all()


def test_normals_places_and_weights_on_a_ball() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    surface = Surface(np.asarray(ball.vertices), np.asarray(ball.faces))
    renderer = RayRenderer(surface, named_lens("equidistant").at(SIZE, SIZE), threads=1)
    pose = CameraPose(np.array([0.01, -0.004, 0.006]), looking(np.array([0.2, 1.0, 0.1]), np.array([0.0, 0.0, 1.0])))
    view = renderer.look(pose)
    seen = view.triangle >= 0
    assert (seen == renderer.lens.within).all()
    places = view.points()[seen]
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 0.03, rtol=2e-3)
    np.testing.assert_allclose(view.interpolate(surface.vertices)[seen], places, atol=2e-7)
    radial = -places / np.linalg.norm(places, axis=1, keepdims=True)
    off = np.linalg.norm(view.normals[seen] @ pose.rotation.T - radial, axis=1)
    assert np.degrees(off).max() < 0.5
    along = -(places - pose.position) @ pose.rotation[:, 2]
    np.testing.assert_allclose(view.depth[seen], along, atol=1e-7)


def test_a_surface_that_moves_is_seen_where_it_is(bent: Colon) -> None:
    renderer = RayRenderer(bent.lumen, named_lens("cf-hq190l").at(SIZE, SIZE))
    pose, shift = pose_in(bent, 0.03), np.array([0.004, -0.002, 0.003])
    before = renderer.look(pose).distance
    renderer.place(bent.lumen.vertices + shift)
    within = renderer.lens.within
    assert np.abs(renderer.look(pose).distance[within] - before[within]).max() > 1e-3
    after = renderer.look(CameraPose(pose.position + shift, pose.rotation)).distance
    np.testing.assert_allclose(after, before, atol=1e-6)


def test_threads_change_nothing(bent: Colon) -> None:
    views = [RayRenderer(bent.lumen, named_lens("endomapper").at(60, 50), threads=n) for n in (1, 2)]
    one, two = (renderer.look(pose_in(bent, 0.05)) for renderer in views)
    for part in ("distance", "triangle", "weights", "normals"):
        np.testing.assert_array_equal(getattr(one, part), getattr(two, part))


def test_pictures_are_as_small_as_they_may_be(bent: Colon) -> None:
    """Whose rows are as long as what is worked out at a time, and no shorter."""
    pose, large = pose_in(bent, 0.03), named_lens("equidistant").at(8, 8)
    view = RayRenderer(bent.lumen, large).look(pose)
    known = followed(bent.lumen, pose, large.grid[large.within])
    assert np.abs(view.distance[large.within] - known).max() < 5e-5
    with pytest.raises(InvalidOptionError, match="at least 8"):
        RayRenderer(bent.lumen, named_lens("equidistant").at(7, 9))
