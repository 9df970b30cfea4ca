"""Lenses: rays of the published calibrations, and back."""

import tomllib

import numpy as np
import pytest

from haustra.assets import asset
from haustra.envs.view.picture.lens import lens_rays, named_lens
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.design import LENSES

MOST_DEG = 0.5


def off_deg(rays: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Angles between directions [degrees], without the cosine's loss of digits where they are small."""
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(rays - known, axis=-1) / 2, 1.0)))


def middles(width: int, height: int) -> np.ndarray:
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)


def test_every_pixel_of_the_cf_hq190l_looks_where_c3vd_says() -> None:
    """The loader of C3VD's owners: uv = A^-1 (p - c), ray (u, v, a0 + a2 r2 + a3 r3 + a4 r4), y down, z ahead."""
    at = middles(1350, 1080) - [678.544839263292, 542.975887548343]
    u, v = np.moveaxis(at @ np.linalg.inv([[0.99998688225, 0.00288273829525], [-0.0029631651343, 1.0]]).T, -1, 0)
    r = np.hypot(u, v)
    z = 769.243600037458 - 0.000812770624150226 * r**2 + 6.25674244578925e-07 * r**3 - 1.1966218214428e-09 * r**4
    known = np.stack([u, -v, -z], axis=-1)
    known /= np.linalg.norm(known, axis=-1, keepdims=True)
    assert off_deg(named_lens("cf-hq190l").grid, known).max() < 1e-6 < MOST_DEG


def test_every_pixel_of_the_endomapper_looks_where_its_calibration_says() -> None:
    """Kannala and Brandt: a ray at an angle t from the axis is seen at f (t + k0 t3 + k1 t5 + k2 t7 + k3 t9)."""
    lens = named_lens("endomapper")
    rays = lens.rays(np, middles(720, 540))
    t = np.arccos(-rays[..., 2])
    k = (-0.1389272, -0.001239606, 9.125824e-4, -4.071615e-5)
    radius = t + sum(each * t ** (3 + 2 * order) for order, each in enumerate(k))
    azimuth = np.arctan2(-rays[..., 1], rays[..., 0])
    seen = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1) * radius[..., None]
    seen = seen * [358.6052, 358.7408] + [367.6783, 276.3991]
    # A pixel is some 0.2 degrees wide.
    known = np.isfinite(t)
    assert known[lens.within].all() and known.mean() > 0.9, "none but in corners that no angle reaches"
    assert np.abs(seen - middles(720, 540))[known].max() < 1e-4 * MOST_DEG


@pytest.mark.parametrize("name", LENSES)
def test_from_pixels_to_rays_and_back(name: str) -> None:
    lens = named_lens(name).at(96, 80)
    pixels = middles(96, 80) + 0.3
    rays = lens.rays(np, pixels)
    seen = np.isfinite(rays).all(axis=-1)
    assert seen[lens.within].all()
    np.testing.assert_allclose(lens.pixels(np, 0.07 * rays)[seen], pixels[seen], atol=1e-8)
    assert np.isnan(lens.pixels(np, np.array([0.0, 0.1, 1.0]))).all(), "behind the camera"


def test_another_size_of_the_picture_keeps_the_rays() -> None:
    """Half as many pixels: each one's ray is that of the middle of four."""
    lens = named_lens("cf-hq190l")
    half = lens.at(675, 540)
    four = lens.rays(np, 2 * middles(675, 540) + 0.5)
    assert off_deg(half.grid, four).max() < 1e-6
    square = lens.at(100, 100)
    assert square.within.mean() > 0.75
    assert not square.within[[0, 0, -1, -1], [0, -1, 0, -1]].any(), "corners of the mask"


def test_jax_sees_as_numpy_does() -> None:
    jax = pytest.importorskip("jax")
    lens, pixels = named_lens("cf-hq190l").at(32, 32), middles(32, 32)
    rays = np.asarray(lens.rays(jax.numpy, jax.numpy.asarray(pixels)))
    assert off_deg(rays, lens.rays(np, pixels)).max() < 1e-3


def test_a_lens_that_is_not_known_is_refused_and_those_that_are_have_sources() -> None:
    with pytest.raises(InvalidOptionError, match=r"Lens 'gopro' is not known. Known: cf-hq190l"):
        named_lens("gopro")
    for name in LENSES[:2]:
        assert len(tomllib.loads(asset(f"lenses/{name}.toml").read_text(encoding="utf-8"))["source"]) > 40


def test_angles_from_the_axis_grow_evenly_to_half_the_field_of_view_at_the_rim():
    rays, within = lens_rays(140.0, 101)
    assert rays[50, 50] == pytest.approx([0.0, 0.0, 1.0])
    angle = np.degrees(np.arccos(rays[50, :, 2]))
    assert np.diff(angle[50:]) == pytest.approx(1.4, abs=0.02)
    assert angle[-1] == pytest.approx(70.0, abs=1.0)
    assert np.linalg.norm(rays, axis=-1) == pytest.approx(1.0)
    assert within[50].all() and not within[0, 0]


def test_wire_up_is_up_and_wire_left_is_left():
    rays, _ = lens_rays(140.0, 101)
    assert rays[0, 50, 0] > 0.9
    assert rays[50, 0, 1] > 0.9
