"""The picture in colour: light by its formula, wall that reads as such, and the same everywhere."""

import numpy as np
import pytest
import trimesh

from haustra.envs.view.picture.appearance import Appearance, Residue
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import equidistant_lens, named_lens
from haustra.envs.view.picture.light import Light, Response
from haustra.envs.view.picture.mucosa import BLOOD
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import ColonSurface, LumenSurface, MovingSurface
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.scene import entry_of
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.models.wall.moving_colon import AT_REST, to_current
from tests.bent_colon import winding
from tests.models.wall.conftest import RADIUS, swept_colon

SIZE = 72


@pytest.fixture(scope="module")
def tube() -> Colon:
    return swept_colon(winding([(0.3, 0.0)]), name="straight")


@pytest.fixture(scope="module")
def scope(tube: Colon) -> Endoscope:
    return Endoscope(tube, equidistant_lens(140.0, SIZE), surface=ColonSurface(tube))


def inside(arc: float, up: float = 0.0) -> CameraPose:
    """Looking along the straight tube, which runs along x with its first normal along z."""
    return CameraPose(np.array([arc, 0.0, up]), looking(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])))


def test_light_falls_as_the_formula_says(tube: Colon) -> None:
    """Sum of exp(-mu (1 - cos)) / d^2 over three guides, within 2 %, on a wall of one colour at a known distance."""
    light, flat = Light(), []
    for half in (0.012, 0.03):
        box = trimesh.creation.box(extents=(2 * half, 2.0, 2.0))
        surface = LumenSurface(Surface(np.asarray(box.vertices), np.asarray(box.faces)))
        surface.arcs[:] = 1.0  # far from the anus
        looks = Appearance(tube, surface)
        looks.lattice[:] = 0.9  # no patterns
        looks.known[:], looks.landmarks, looks.wet = 0.0, np.zeros((0, 8)), 0.0
        scope = Endoscope(tube, equidistant_lens(140.0, SIZE), surface=surface, appearance=looks)
        view = scope.look(inside(0.0))
        seen = scope.radiance(view)
        places = np.where(view.triangle >= 0, view.distance, 1.0)[..., None] * view.lens.grid
        known = np.zeros((SIZE, SIZE))
        for guide in light.guides:
            way = places - np.array(guide)
            away = np.linalg.norm(way, axis=-1)
            cosine = -way[..., 2] / away
            known += np.exp(-light.spread * (1 - cosine)) / away**2 * (cosine + 0.15) / 1.15
        wall = (view.triangle >= 0) & (np.abs(places[..., 2] + half) < 1e-6) & (view.lens.grid[..., 2] < -0.4)
        flat.append((seen[..., 0] / known)[wall])
    both = np.concatenate(flat)
    assert len(both) > 2000
    np.testing.assert_allclose(both, np.median(both), rtol=0.02)


def test_the_depth_is_dark_and_mucosa_is_red(scope: Endoscope) -> None:
    picture = scope.picture(inside(0.05)).astype(float)
    rows, columns = np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2
    radius = np.hypot(rows, columns) / SIZE
    brightness = picture.max(axis=2)
    assert brightness[radius < 0.48].min() > 0, "a hole in the wall"
    assert brightness[radius > 0.51].max() == 0, "outside the lens"
    assert brightness[radius < 0.06].mean() < 0.5 * brightness[(radius > 0.3) & (radius < 0.4)].mean()
    assert (picture[..., 0] >= picture[..., 2]).mean() > 0.99


def test_a_wall_near_one_side_is_brighter(scope: Endoscope) -> None:
    light = scope.radiance(scope.look(inside(0.05, 0.010)))[..., 0]
    assert light[8:24, 30:42].mean() > 1.5 * light[48:64, 30:42].mean()


def test_a_tip_that_presses_the_wall_sees_red_from_inside(tube: Colon, scope: Endoscope) -> None:
    """Even 6 mm beyond where the wall was: it is drawn before the lens, and shines red."""
    assert isinstance(scope.surface, ColonSurface)
    outwards = np.array([0.0, 0.0, 1.0])
    place = np.array([0.1, 0.0, RADIUS + 0.006])
    pose = CameraPose(place, looking(outwards, np.array([1.0, 0.0, 0.0])))
    scope.surface.make_room(place, outwards, 0.1, 0.0065)
    view, lens = scope.look(pose), scope.renderer.lens
    picture = scope.develop(scope.radiance(view)).astype(float)
    middle = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2)) < SIZE / 6
    assert (view.triangle >= 0)[lens.within].all(), "it sees the colon from outside"
    assert view.distance[middle].max() < 0.0025
    assert picture[middle][:, 0].mean() > 2.5 * picture[middle][:, 1].mean()
    scope.surface.place(tube.lumen.vertices)


def test_the_same_picture_every_time_and_another_from_another_seed(tube: Colon, scope: Endoscope) -> None:
    again = Endoscope(tube, scope.renderer.lens, surface=scope.surface, threads=1)
    other = Endoscope(tube, scope.renderer.lens, surface=scope.surface, seed=1)
    np.testing.assert_array_equal(scope.picture(inside(0.06)), again.picture(inside(0.06)))
    assert np.abs(scope.picture(inside(0.06)).astype(int) - other.picture(inside(0.06))).max() > 10


def test_blood_is_red_and_stays_where_it_is(tube: Colon, scope: Endoscope) -> None:
    looks = Appearance(tube, scope.surface)
    bleeding = Endoscope(tube, scope.renderer.lens, surface=scope.surface, appearance=looks)
    looks.bleed(np.array([0.08, 0.0, RADIUS]), 0.02)
    view = scope.look(inside(0.06))
    changed = np.abs(bleeding.radiance(view) - scope.radiance(view)).max(axis=-1)
    blood = np.empty((len(looks.known), 1))
    blood[scope.surface.order] = looks.known[:, [BLOOD]]
    under = np.nan_to_num(view.interpolate(blood)[..., 0]) > 0
    assert changed[under].max() > 0 and under[: SIZE // 3].any()
    assert changed[~under].max() == 0, "where no blood is, the wall shines as before"


def test_mucus_and_stool_lie_where_the_seed_says(tube: Colon, scope: Endoscope) -> None:
    """None by default; more of each covers more, in the same places, and mucus hides vessels' red."""
    lens, surface, view = scope.renderer.lens, scope.surface, scope.look(inside(0.06))
    plain = scope.radiance(view)

    def covered(**residue: float) -> tuple[np.ndarray, np.ndarray]:
        looks = Appearance(tube, surface, residue=Residue(**residue))
        light = Endoscope(tube, lens, surface=surface, appearance=looks).radiance(view)
        return np.abs(light - plain).max(axis=-1) > 1e-3 * plain.max(axis=-1), light

    assert not covered()[0].any()
    for kind in ("mucus", "stool"):
        (some, light), (more, _) = covered(**{kind: 0.4}), covered(**{kind: 0.7})
        assert 0.01 < some.mean() < 0.95 and more.sum() > some.sum() and not (some & ~more).any()
        paler = (light[some][:, 2] / light[some][:, 0]) / (plain[some][:, 2] / plain[some][:, 0])
        assert np.median(paler) > 1.0 if kind == "mucus" else np.median(paler) < 1.05
        np.testing.assert_array_equal(light, covered(**{kind: 0.4})[1])


def test_noise_blur_and_a_fixed_gain_are_options(tube: Colon, scope: Endoscope) -> None:
    lens, surface = scope.renderer.lens, scope.surface
    plain = scope.picture(inside(0.06)).astype(float)
    noisy = Endoscope(tube, lens, surface=surface, response=Response(noise=0.03)).picture(inside(0.06)).astype(float)
    within = lens.within
    assert 1.0 < (noisy - plain)[within].std() < 20.0
    assert noisy[~within].max() == 0, "noise in the black mask"
    blurred = scope.picture(inside(0.064), inside(0.056)).astype(float)
    assert np.abs(np.diff(blurred, axis=0)).mean() < np.abs(np.diff(plain, axis=0)).mean()
    dim, bright = (Endoscope(tube, lens, surface=surface, response=Response(gain=gain)) for gain in (2e-5, 4e-5))
    assert bright.picture(inside(0.06)).mean() > 1.1 * dim.picture(inside(0.06)).mean()


def test_a_colon_that_moves_is_drawn_where_it_is() -> None:
    """Vertices as the wall's own law takes them along, and the picture's pattern with them."""
    bent = swept_colon(winding([(0.08, 0.0), (0.08, 0.6), (0.08, 0.0)]), name="bent")
    table = lumen_table(bent, device_radius=0.0064, with_mesentery=True)
    tables, (origin, axes) = stack([table.seen_from(*entry_of(bent))]), entry_of(bent)
    surface = MovingSurface(bent, tables, origin, axes)
    own = tables.mesentery
    assert own is not None
    count = own.nodes.shape[1]
    pose = np.tile(np.asarray(AT_REST), (count, 1))
    pose[:, 0] = 0.004 * np.sin(np.linspace(0, np.pi, count))
    surface.move(pose)
    for stretch in range(surface.count):
        surface.bring(stretch)
    rest = ((surface.rest - origin) @ axes)[None]
    known = to_current(np, tables, pose[None], rest, surface.arcs[None])[0] @ axes.T + origin
    np.testing.assert_allclose(surface.vertices, known, atol=1e-9)
    scope = Endoscope(bent, named_lens("cf-hq190l").at(SIZE, SIZE), surface=surface)
    at = surface.line[12]
    view = scope.look(CameraPose(at, looking(surface.line[20] - at, np.array([0.0, 0.0, 1.0]))))
    assert (view.triangle >= 0)[scope.renderer.lens.within].all()


def test_the_gain_of_a_film_waits_in_the_dark_and_comes_back_to_the_light() -> None:
    """A tip that presses into the wall sees nothing; what it sees next is exposed as what it saw before."""
    camera, dark, lit = Response(inertia=0.8), np.zeros((8, 8, 3)), np.full((8, 8, 3), 2e4)
    assert camera.gain_for(dark, 3e-5) == 3e-5
    gain = 1.0
    for _ in range(30):
        gain = camera.gain_for(lit, gain)
    assert gain == pytest.approx(camera.target / 2e4, rel=0.02)
