"""The program that shades pixels is the mucosa's law as numpy computes it."""

import functools

import numpy as np

from haustra.envs.view.picture import mucosa
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.light import Light, Response
from haustra.envs.view.picture.mucosa import WallPlace, masked, wall_looks
from haustra.envs.view.picture.numpy_shade import seen_pixels, shade_pixels
from haustra.envs.view.picture.renderer import CameraPose, SurfaceView
from tests.bent_colon import winding
from tests.models.wall.conftest import RADIUS, swept_colon

WIDTH, HEIGHT = 60, 51
"""No multiple of what is shaded at a time."""
WET, MUCUS = 0.8, 0.4


def shaded_by_numpy(scope: Endoscope, view: SurfaceView) -> np.ndarray:
    """Light of all pixels in double precision."""
    lens, seen = scope.renderer.lens, seen_pixels(scope.appearance, view, Light())
    # What a pixel sees in the middle of the picture: the angle between neighbours.
    row, column = (round(place) for place in lens.centre[::-1])
    beside = np.cross(lens.grid[row, column], lens.grid[row, column + 1])
    seen = seen._replace(scene=seen.scene._replace(pixel=float(np.linalg.norm(beside))))
    return np.where((view.own >= 0)[..., None], shade_pixels(seen), 0.0)


def test_the_program_shades_as_the_law_says() -> None:
    """Within a grey level at 99.9 % of the pixels, of all that a wall may have on it, near and far."""
    tube = swept_colon(winding([(0.3, 0.0)]), name="straight")
    lens = named_lens("endomapper").at(WIDTH, HEIGHT)
    scope = Endoscope(tube, lens, response=Response(gain=3e-4))
    looks: Appearance = scope.appearance
    random = np.random.default_rng(0)
    near = np.abs(scope.surface.arcs - 0.07) < 0.02
    looks.known[near] = random.uniform(0, 1, (near.sum(), 5)) * random.integers(0, 2, (near.sum(), 5))
    looks.wet, looks.mucus = WET, MUCUS
    along = (1.0, 0.0, 0.0)
    looks.landmarks = np.array([
        [mucosa.ORIFICE, 0.075, 0.0, RADIUS, 0.0035, *along],
        [mucosa.VALVE, 0.08, RADIUS, 0.0, 0.011, *along],
    ])  # fmt: skip
    seen = []
    for arc, aside in ((0.005, 0.0), (0.05, 0.0), (0.06, 0.6 * RADIUS), (0.07, RADIUS - 0.002)):
        pose = CameraPose(np.array([arc, 0.0, aside]), looking(np.array([1.0, 0.1, 0.3]), np.array([0.0, 0.0, 1.0])))
        view = scope.look(pose)
        light = scope.radiance(view)
        known = shaded_by_numpy(scope, view).astype(np.float32)
        assert np.isfinite(light).all() and (light[view.own < 0] == 0).all()
        off = np.abs(scope.develop(light).astype(int) - scope.develop(known)).max(axis=-1)
        seen.append(off[view.own >= 0])
    off = np.concatenate(seen)
    assert len(off) > 7000
    assert (off <= 1).mean() >= 0.999, np.bincount(off)


def test_bubbles_lie_in_mucus_and_are_seen_near_by() -> None:
    """They shine more than mucus does, in some places; neither a clean wall has them, nor one that is far away."""
    tube = swept_colon(winding([(0.1, 0.0)]), name="straight")
    scope = Endoscope(tube, named_lens("endomapper").at(WIDTH, HEIGHT))
    pose = CameraPose(np.array([0.05, 0.0, 0.0]), looking(np.array([1.0, 0.1, 0.3]), np.array([0.0, 0.0, 1.0])))
    seen = seen_pixels(scope.appearance, scope.look(pose), Light())
    away = np.random.default_rng(0).uniform(-0.03, 0.03, (3, 20_000))
    place = WallPlace((away[0], away[1], away[2]), np.full(20_000, 0.3), *np.zeros((5, 20_000)))

    def bubbles(mucus: float, size: float) -> float:
        scene = seen.scene._replace(mucus=mucus)
        looks = wall_looks(np, place, np.full(20_000, size), scene, functools.partial(masked, np))
        return float((np.asarray(looks.gloss) > 2.3).mean())

    assert 0.001 < bubbles(0.3, 1e-5) < bubbles(0.6, 1e-5) < 0.2
    assert bubbles(0.0, 1e-5) == bubbles(0.6, 1e-3) == 0.0
