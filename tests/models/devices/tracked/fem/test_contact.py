"""Contacts of the reference: Coulomb's law, action and reaction, exact derivatives."""

import numpy as np
import pytest

from haustra.models.devices.tracked.fem.contact import SOFT_DEPTH, Patch, pressure_law, round_tips, sliding_faces

X = np.array([[0.0, 2e-5], [1e-3, 1e-5], [-0.5e-3, 0.0], [0.6e-3, 2e-6], [1.6e-3, -1e-6]])
FACES, SURFACE = np.array([[0, 1]]), np.array([2, 3, 4])
LENGTHS = np.array([1e-3])


def faces(x: np.ndarray, friction: float = 0.4) -> Patch:
    return sliding_faces(x, FACES, LENGTHS, SURFACE, stiffness=1e9, friction=friction)


def tips(x: np.ndarray) -> Patch:
    centres = np.array([[0.5e-3, -1.98e-3]])
    return round_tips(x, FACES, LENGTHS, centres, 2e-3, stiffness=1e10)[0]


def total(patch: Patch, nodes: int) -> np.ndarray:
    force = np.zeros((nodes, 2))
    np.add.at(force, patch.nodes, patch.forces)
    return force


def test_friction_is_mu_times_normal_and_pulls_the_tread_forwards() -> None:
    flat = X.copy()
    flat[:2, 1], flat[2:, 1] = 1e-5, 0.0
    on_tread = total(faces(flat), 5)[:2].sum(0)
    assert on_tread[1] < 0
    assert on_tread[0] == pytest.approx(-0.4 * on_tread[1])


def test_action_is_reaction() -> None:
    assert total(faces(X), 5).sum(0) == pytest.approx(0.0, abs=1e-9)


def test_nothing_touches_nothing() -> None:
    apart = X - np.array([[0.0, 1e-3]]) * (np.arange(5) < 2)[:, None]
    assert len(faces(apart).nodes) == 0
    assert faces(apart).depth == 0.0


@pytest.mark.parametrize("contact", [faces, tips])
def test_slopes_are_exact(contact) -> None:
    draw = np.random.default_rng(1)
    du, h = draw.normal(size=X.shape), 1e-10
    patch = contact(X)
    assert len(patch.nodes)
    slope = np.zeros_like(X)
    np.add.at(slope, patch.nodes, np.einsum("caibj,cbj->cai", patch.slopes, du[patch.nodes]))
    measured = (total(contact(X + h * du), 5) - total(contact(X - h * du), 5)) / (2 * h)
    assert slope == pytest.approx(measured, rel=1e-4, abs=1e-5 * np.abs(measured).max())


def test_pressure_starts_smoothly() -> None:
    depth = np.array([0.0, SOFT_DEPTH, 2 * SOFT_DEPTH])
    pressure, slope = pressure_law(depth, 1e9)
    assert slope == pytest.approx([0.0, 1e9, 1e9])
    assert pressure == pytest.approx([0.0, 1e9 * SOFT_DEPTH / 2, 1e9 * SOFT_DEPTH * 1.5])
