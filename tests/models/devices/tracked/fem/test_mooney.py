"""The paper's two rubber laws: small-strain moduli, exact derivatives, a stress that theory knows."""

import numpy as np
import pytest

from haustra.models.devices.tracked.fem.mooney import TISSUE, TREAD, MooneyRivlin

LAWS = pytest.mark.parametrize("law", [TISSUE, TREAD], ids=["tissue", "tread"])


def test_moduli_are_the_papers() -> None:
    """mu = 2 (C10 + C01): 59.74 kPa and 1.182 MPa; Young's modulus is three times that."""
    assert TISSUE.shear_modulus == pytest.approx(59.74e3, rel=1e-3)
    assert TREAD.shear_modulus == pytest.approx(1.182e6, rel=1e-3)


@LAWS
def test_rest_stores_no_energy_and_no_stress(law: MooneyRivlin) -> None:
    rest = (np.array([2.0]), np.array([1.0]))
    assert law.energy(*rest) == pytest.approx(0.0, abs=1e-9)
    w_t, w_j, *_ = law.derivatives(*rest)
    assert 2 * w_t + w_j == pytest.approx(0.0, abs=1e-6)


@LAWS
def test_derivatives_are_the_energys(law: MooneyRivlin) -> None:
    t, j, h = np.array([2.1, 2.6, 3.4]), np.array([0.98, 1.0, 1.05]), 1e-5
    w_t, w_j, w_tt, w_tj, w_jj = law.derivatives(t, j)
    tolerance = 1e-5 * law.shear_modulus
    assert w_t == pytest.approx((law.energy(t + h, j) - law.energy(t - h, j)) / (2 * h), abs=tolerance)
    assert w_j == pytest.approx((law.energy(t, j + h) - law.energy(t, j - h)) / (2 * h), abs=tolerance)
    up, down = law.derivatives(t + h, j), law.derivatives(t - h, j)
    assert w_tt == pytest.approx((up[0] - down[0]) / (2 * h), abs=tolerance)
    assert w_tj == pytest.approx((up[1] - down[1]) / (2 * h), abs=tolerance)
    up, down = law.derivatives(t, j + h), law.derivatives(t, j - h)
    assert w_jj == pytest.approx((up[1] - down[1]) / (2 * h), abs=tolerance)


@LAWS
def test_simple_shear_stress(law: MooneyRivlin) -> None:
    """Small simple shear g: von Mises stress sqrt(3) mu g."""
    shear = 1e-4
    assert law.von_mises(np.array([[[1.0, shear], [0.0, 1.0]]])) == pytest.approx(
        np.sqrt(3) * law.shear_modulus * shear, rel=1e-3
    )


@LAWS
def test_law_is_stable_in_plane_strain(law: MooneyRivlin) -> None:
    """Planar stretch from 0.5 to 2: nominal stress rises throughout, negative C10 or not."""
    stretch = np.linspace(0.5, 2.0, 61)
    energy = law.energy(stretch**2 + stretch**-2, np.ones_like(stretch))
    assert (np.diff(energy, 2) > 0).all()
