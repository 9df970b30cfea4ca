from pathlib import Path

import numpy as np
import pytest
from bent_tube import bent_tube, hairpin
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.isosurface import isosurface
from haustra.models.anatomy.label_colon import import_label_map
from haustra.models.anatomy.label_map import lumen_of_label, read_label_map
from haustra.models.anatomy.lumen_grid import surface_samples
from haustra.models.anatomy.repair import genus, is_watertight, signed_volume
from tests.models.anatomy.conftest import short_ones_allowed

sitk = pytest.importorskip("SimpleITK")
SPACING = np.array([1.1, 0.9, 1.3])


def ball(centre: np.ndarray, radius: float, shape: tuple[int, int, int]) -> np.ndarray:
    at = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    return radius - np.linalg.norm(at - centre, axis=-1)


def write(file: Path, array: np.ndarray, direction: np.ndarray, origin: np.ndarray) -> Path:
    """Voxels by (x, y, z) index, of any orientation."""
    image = sitk.GetImageFromArray(array.astype(np.uint8).transpose(2, 1, 0))
    image.SetSpacing(SPACING.tolist())
    image.SetDirection(direction.ravel().tolist())
    image.SetOrigin(origin.tolist())
    sitk.WriteImage(image, str(file), True)
    return file


def test_marching_tetrahedra_close_a_ball_and_find_its_radius():
    surface = isosurface(ball(np.array([10.2, 9.7, 10.4]), 7.3, (21, 21, 21)))
    assert is_watertight(surface.faces) and genus(surface.faces) == 0
    radius = np.linalg.norm(surface.vertices - [10.2, 9.7, 10.4], axis=1)
    np.testing.assert_allclose(radius, 7.3, atol=0.1)  # vertices stay off the grid points
    assert signed_volume(surface.vertices, surface.faces) == pytest.approx(4 / 3 * np.pi * 7.3**3, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_marching_tetrahedra_are_closed_for_any_voxels(seed: int):
    values = np.where(np.random.default_rng(seed).random((9, 9, 9)) < 0.5, 0.5, -0.5)
    values[[0, -1]], values[:, [0, -1]], values[:, :, [0, -1]] = -0.5, -0.5, -0.5
    surface = isosurface(values)
    assert is_watertight(surface.faces)
    assert signed_volume(surface.vertices, surface.faces) > 0


@pytest.mark.parametrize("suffix", [".nii.gz", ".nrrd", ".mha"])
def test_spacing_orientation_and_origin_are_kept(tmp_path: Path, suffix: str):
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, -1]])  # left-handed
    centre, origin = np.array([14.0, 12.0, 10.0]), np.array([-30.0, 50.0, 200.0])
    array = ball(centre, 8.0, (30, 26, 22)) > 0
    file = write(
        tmp_path / f"ball{suffix}", array * 20 + (ball(np.array([3.0, 3, 3]), 2, array.shape) > 0), turn, origin
    )
    found = lumen_of_label(read_label_map(file, label=20)).surface
    expected = (origin + turn @ (SPACING * centre)) * 1e-3
    np.testing.assert_allclose(found.vertices.mean(0), expected, atol=2e-4)
    axes = (found.vertices - expected) @ turn
    np.testing.assert_allclose(np.abs(axes).max(0), 8.0e-3 * SPACING, atol=1e-3)
    assert signed_volume(found.vertices, found.faces) == pytest.approx(
        4 / 3 * np.pi * 8e-3**3 * np.prod(SPACING), rel=0.05
    )


def voxelised(surface: Surface, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Voxels whose centres lie within the tube's radius of its wall's inside, by the nearest sample's normal."""
    low = surface.vertices.min(0) - 3 * spacing
    shape = np.ceil((surface.vertices.max(0) - low) / spacing).astype(int) + 4
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centre = low + spacing * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    _, nearest = KDTree(corners.mean(1)).query(centre.reshape(-1, 3), workers=1)
    inside = ((centre.reshape(-1, 3) - corners.mean(1)[nearest]) * normal[nearest]).sum(1) < 0
    return inside.reshape(shape), low


def test_voxelised_colon_comes_back_within_a_voxel(tmp_path: Path):
    """Legs 5 mm apart; the file is in mm, its voxels 2 mm."""
    tube = bent_tube(hairpin(0.24, 0.05), 0.02)
    inside, low = voxelised(tube, 2e-3)
    image = sitk.GetImageFromArray(inside.astype(np.uint8).transpose(2, 1, 0))
    image.SetSpacing((2.0,) * 3)
    image.SetOrigin((low * 1e3).tolist())
    sitk.WriteImage(image, str(tmp_path / "tube.mha"), True)
    with short_ones_allowed():
        colon = import_label_map(tmp_path / "tube.mha")
    away = KDTree(surface_samples(tube, 1e-3)).query(colon.lumen.vertices)[0]
    assert away.max() < 2e-3
    assert genus(colon.lumen.faces) == 0
    assert colon.centreline.length == pytest.approx(0.48 + np.pi * 0.025, rel=0.08)
    assert any("voxels of 2 x 2 x 2 mm" in warning for warning in colon.warnings)
