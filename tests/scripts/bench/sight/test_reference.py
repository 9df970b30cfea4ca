"""A picture's scene for a path tracer, and what the tracer finds in it against theory."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import ColonSurface
from haustra.models.anatomy.colon import Colon
from haustra.scripts.bench.pages.reference_figure import draw_reference
from haustra.scripts.bench.sight.mitsuba_light import MitsubaScene, has_mitsuba
from haustra.scripts.bench.sight.reference import compare_place, differences
from haustra.scripts.bench.sight.traced_scene import TracedScene, traced_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import RADIUS, swept_colon

SIZE = 24
needs_mitsuba = pytest.mark.skipif(not has_mitsuba(), reason="Mitsuba is not installed (extra 'mitsuba')")


@pytest.fixture(scope="module")
def tube() -> Colon:
    return swept_colon(winding([(0.3, 0.0)]), name="straight")


@pytest.fixture(scope="module")
def pressing(tube: Colon) -> tuple[Endoscope, CameraPose]:
    """Along the tube, which runs along x, 2 mm beyond where its upper wall was."""
    place = np.array([0.1, 0.0, RADIUS + 0.002])
    pose = CameraPose(place, looking(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])))
    surface = ColonSurface(tube)
    surface.make_room(place, np.array([1.0, 0.0, 0.0]), 0.1, 0.0064)
    return Endoscope(tube, named_lens("cf-hq190l").at(SIZE, SIZE), surface=surface, threads=1), pose


def test_a_scene_is_in_millimetres_before_the_camera(pressing: tuple[Endoscope, CameraPose], tube: Colon) -> None:
    """The tube's axis lies below the camera, ahead is -z, faces turn inwards, and the tip has room."""
    scope, pose = pressing
    scene = traced_scene(scope, pose, Light(), size=1e-3)
    assert scene.vertices.shape == tube.lumen.vertices.shape and scene.faces.shape == tube.lumen.faces.shape
    assert np.ptp(scene.vertices[:, 2]) == pytest.approx(306, abs=0.1)
    far = scene.vertices[:, 2] < -60
    below = -1e3 * pose.position[2]
    np.testing.assert_allclose(scene.vertices[far][:, :2].mean(axis=0), (0.0, below), atol=0.5)
    sides = scene.normals[far] * (1, 1, 0)
    inwards = (0.0, below, 0.0) - scene.vertices[far] * (1, 1, 0)
    assert ((sides * inwards).sum(axis=1) > 0).mean() > 0.99
    a, b, c = (scene.vertices[scene.faces[:, corner]] for corner in range(3))
    assert np.einsum("ti,ti->", np.cross(b - a, c - a), scene.normals[scene.faces[:, 0]]) > 0
    assert np.linalg.norm(scene.vertices, axis=1).min() > 4.0, "the wall is drawn through the tip"
    np.testing.assert_allclose(np.linalg.norm(scene.rays, axis=1), 1.0, atol=1e-6)
    assert scene.rays[SIZE // 2 * SIZE + SIZE // 2, 2] < -0.99
    np.testing.assert_allclose(scene.guides[0], (3.24, 0.55, 0.0))
    assert ((scene.reflectance > 0) & (scene.reflectance < 1)).all()
    assert scene.reflectance[:, 0].mean() > 1.5 * scene.reflectance[:, 1].mean()


def test_a_scene_says_the_light_of_a_wall_that_stands_before_the_guides(
    pressing: tuple[Endoscope, CameraPose],
) -> None:
    """At 1 m straight ahead one unit of light comes back of what is sent, as the shader has it: 1 / d^2 in metres."""
    scene = traced_scene(*pressing, Light(guides=((0.0, 0.0, 0.0),)), size=1e-3)
    towards = np.array([[0.0, 0.0, 1.0]] * 2)
    np.testing.assert_allclose(scene.irradiance(np.array([[0.0, 0.0, -1000.0], [0.0, 0.0, -20.0]]), towards), (1, 2500))


@needs_mitsuba
def test_light_in_a_sphere_is_what_theory_says() -> None:
    """In a matt sphere of reflectance r all places get the same from the wall: r / (1 - r) of the mean direct light.

    (Integrating spheres; every part of a sphere sees every other alike.)
    """
    ball, radius, sent = trimesh.creation.icosphere(subdivisions=4, radius=20.0), 20.0, (0.7, 0.4, 0.2)
    inwards = -np.asarray(ball.vertices) / radius
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rays = np.stack([np.cos(turns), np.sin(turns), np.zeros(12)], axis=1)
    scene = TracedScene(
        vertices=np.asarray(ball.vertices, float),
        faces=np.asarray(ball.faces)[:, ::-1],
        normals=inwards,
        reflectance=np.tile(sent, (len(inwards), 1)),
        rays=rays,
        guides=np.zeros((1, 3)),
        power=1.0,
        spread=2.767,
    )
    tracer = MitsubaScene(scene)
    found = tracer.rays()
    assert found.met.all() and found.distance == pytest.approx(radius, rel=0.005)
    direct, all_light = tracer.direct(), tracer.light(depth=60, samples=200)
    np.testing.assert_allclose(direct[:, 0], 0.7 * scene.irradiance(radius * rays, -rays), rtol=0.01)
    # The mean of exp(-mu (1 - cos)) over all directions is (1 - exp(-2 mu)) / (2 mu).
    mean = (1 - np.exp(-2 * scene.spread)) / (2 * scene.spread) / radius**2 / np.pi
    from_wall = (all_light - direct).mean(axis=0)
    np.testing.assert_allclose(from_wall, [mean * share**2 / (1 - share) for share in sent], rtol=0.15)


@needs_mitsuba
def test_rays_and_the_guides_light_are_mitsubas(pressing: tuple[Endoscope, CameraPose], tmp_path: Path) -> None:
    """Where the tip presses the wall: the same wall, the same normals, and the formula's light where nothing shades."""
    found = compare_place(*pressing, samples=4)
    row = differences(found)
    assert draw_reference(tmp_path / "reference.webp", [("tube", found)]).stat().st_size > 1000
    assert row["met_alike"] > 0.995
    assert row["distance_largest_mm"] < 0.001 and row["normals_largest_deg"] < 0.1
    assert row["formula"] < 1e-5
    assert 0.05 < row["from_wall_red"] < 0.9 and row["from_wall_red"] > row["from_wall_green"]
