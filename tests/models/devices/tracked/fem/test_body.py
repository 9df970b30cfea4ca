"""One body of the reference: forces are the energy's, and blocks behave as theory says."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix

pytest.importorskip("skfem")
from haustra.models.devices.tracked.fem.body import Body
from haustra.models.devices.tracked.fem.mooney import TISSUE, TREAD


def assemble(body: Body, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    forces, stiffness = body.forces(u)
    residual = np.zeros_like(u)
    np.add.at(residual, body.quads, forces)
    dofs = (2 * body.quads[:, :, None] + np.arange(2)).reshape(-1, 8)
    rows, columns = np.repeat(dofs, 8, axis=1).ravel(), np.tile(dofs, 8).ravel()
    return residual, coo_matrix((stiffness.ravel(), (rows, columns)), shape=(u.size, u.size)).toarray()


def grid(cells: int, bulk_ratio: float = 500.0) -> Body:
    lines = np.linspace(0.0, 0.01, cells + 1)
    return Body.on_grid(lines, lines, TISSUE, bulk_ratio=bulk_ratio)


def test_forces_and_stiffness_are_derivatives_of_the_energy() -> None:
    body = Body.on_grid(np.linspace(0, 0.01, 4), np.linspace(0, 0.01, 3), TREAD, bulk_ratio=500.0)
    draw = np.random.default_rng(0)
    u, du = draw.normal(size=(2, *body.nodes.shape)) * 1e-4
    residual, stiffness = assemble(body, u)
    h = 1e-5
    assert (residual * du).sum() == pytest.approx(
        (body.energy(u + h * du) - body.energy(u - h * du)) / (2 * h), rel=1e-5
    )
    slope = (assemble(body, u + h * du)[0] - assemble(body, u - h * du)[0]).ravel() / (2 * h)
    assert stiffness @ du.ravel() == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(slope).max())
    assert stiffness == pytest.approx(stiffness.T)


def test_rotation_stores_nothing() -> None:
    body = grid(3)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    assert body.energy(body.nodes @ turn.T - body.nodes) == pytest.approx(0.0, abs=1e-9)


def test_block_has_the_plane_strain_modulus() -> None:
    """Small stretch between frictionless plates: stress / strain = E / (1 - nu^2) = 2 mu / (1 - nu)."""
    body, strain = grid(4), 1e-4
    u = np.zeros_like(body.nodes)
    left, right = body.nodes[:, 0] < 1e-9, body.nodes[:, 0] > 0.01 - 1e-9
    fixed = np.zeros(u.shape, bool)
    fixed[left | right, 0] = fixed[body.nodes[:, 1] < 1e-9, 1] = True
    u[:, 0] = strain * body.nodes[:, 0]
    free = ~fixed.ravel()
    for _ in range(3):
        residual, stiffness = assemble(body, u)
        step = np.zeros(u.size)
        step[free] = np.linalg.solve(stiffness[np.ix_(free, free)], -residual.ravel()[free])
        u += step.reshape(u.shape)
    force = assemble(body, u)[0][right, 0].sum()
    ratio = 500.0
    poisson = (3 * ratio - 2) / (2 * (3 * ratio + 1))
    assert force / 0.01 / strain == pytest.approx(2 * TISSUE.shear_modulus / (1 - poisson), rel=1e-3)


def test_bending_does_not_lock() -> None:
    """A mean volume ratio an element keeps a nearly incompressible block soft: energy moves little with K x 100."""
    bent = [grid(6, bulk_ratio) for bulk_ratio in (100.0, 10000.0)]
    energies = []
    for body in bent:
        x, y = body.nodes.T - 0.005
        u = 2e-2 * np.column_stack([x * y, -(x**2 - y**2) / 2]) / 0.01
        u[:, 1] += 2e-2 * (-(y**2)) / 0.01
        energies.append(body.energy(u * 0.01))
    assert energies[1] < 1.5 * energies[0]
