"""Rays say where a solid begins, or that they start inside it."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from manifold3d import Manifold

from haustra.models.wall.pieces.rays import Caster, joined_hulls


def cube(edge: float) -> np.ndarray:
    mesh = Manifold.cube((edge, edge, edge), True).to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3]


def test_from_inside_a_solid_begins_at_once() -> None:
    caster = Caster(joined_hulls([cube(0.02)]))
    directions = np.random.default_rng(0).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert (caster.entry(np.zeros(3), directions) == 0).all()


def test_threads_that_cast_at_once_see_what_one_sees() -> None:
    caster = Caster(*(joined_hulls([cube(0.02) + np.array([0.03 * k, 0, 0])]) for k in range(4)))
    origins = np.random.default_rng(3).uniform(-0.02, 0.12, (400, 3))
    directions = np.random.default_rng(4).normal(size=(16, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    with ThreadPoolExecutor(2) as pool:
        met = list(pool.map(lambda origin: caster.entry(origin, directions), origins))
    np.testing.assert_array_equal(met, [caster.entry(origin, directions) for origin in origins])


def test_surfaces_side_by_side_are_met_as_one_surface() -> None:
    places = np.random.default_rng(1).uniform(-0.1, 0.1, (30, 3))
    cubes = [cube(0.02) + place for place in places]
    together, apart = Caster(joined_hulls(cubes)), Caster(*(joined_hulls([one]) for one in cubes))
    directions = np.random.default_rng(2).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    met = together.entry(np.zeros(3), directions)
    assert 0.1 < np.isfinite(met).mean() < 1.0
    assert apart.entry(np.zeros(3), directions) == pytest.approx(met, abs=1e-8)


def test_a_solid_thinner_than_rounding_is_not_taken_for_the_inside() -> None:
    """Either of its faces may be met first."""
    corners = np.array([[x, y, z] for x in (0.05, 0.05 + 1e-9) for y in (-0.02, 0.02) for z in (-0.02, 0.02)])
    caster = Caster(joined_hulls([corners * [1, 1, 1] + [0, 0.001 * y, 0] for y in range(3)]))
    spread = np.linspace(-0.3, 0.3, 41)
    directions = np.array([[1.0, y, z] for y in spread for z in spread])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert caster.entry(np.zeros(3), directions) * directions[:, 0] == pytest.approx(np.full(len(directions), 0.05))
