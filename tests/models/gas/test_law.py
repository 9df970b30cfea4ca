"""The pressure-volume law of a segment of colon."""

import jax
import numpy as np
import pytest

from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.law import MMHG, open_share, pressure_of, share_rate, wall_tension, width_share
from haustra.models.gas.numbers import diameter_share, full_diameters, gas_numbers

HALF, EXPONENT = 2000.0, 1.9
PRESSURES = np.linspace(300.0, 9000.0, 200)


def share(pressure):
    return open_share(np, pressure, half=HALF, exponent=EXPONENT)


def test_half_of_the_volume_is_reached_at_the_half_pressure_and_all_of_it_never():
    assert share(HALF) == pytest.approx(0.5, abs=1e-15)
    assert 0.999 < share(1e5) < 1
    assert share(np.array([-5.0, 0.0, 1.0])).tolist() == [0, 0, 0]


def test_law_is_sigmoidal_as_barostat_curves_are():
    """Bharucha 2001: hardly anything opens at first, most about the middle, little at the end."""
    held = share(PRESSURES)
    assert (np.diff(held) > 0).all()
    steepest = PRESSURES[np.diff(held).argmax()]
    assert 0.3 * HALF < steepest < HALF
    assert share(5 * MMHG) < 0.01 and share(8 * MMHG) == pytest.approx(0.1, abs=0.02)
    assert share(40 * MMHG) == pytest.approx(0.9, abs=0.02)


def test_inverse_and_derivative_are_the_laws_own():
    held = share(PRESSURES)
    np.testing.assert_allclose(pressure_of(np, held, half=HALF, exponent=EXPONENT), PRESSURES, rtol=1e-9)
    step = 0.01
    slope = (share(PRESSURES + step) - share(PRESSURES - step)) / (2 * step)
    np.testing.assert_allclose(share_rate(np, PRESSURES, half=HALF, exponent=EXPONENT), slope, rtol=1e-5)


def test_jax_calls_the_same_law():
    with jax.enable_x64(True):
        found = jax.jit(lambda p: open_share(jax.numpy, p, half=HALF, exponent=EXPONENT))(PRESSURES)
        slope = jax.vmap(jax.grad(lambda p: open_share(jax.numpy, p, half=HALF, exponent=EXPONENT)))(PRESSURES)
    np.testing.assert_allclose(found, share(PRESSURES), rtol=1e-12)
    np.testing.assert_allclose(slope, share_rate(np, PRESSURES, half=HALF, exponent=EXPONENT), rtol=1e-9)


def test_diameters_go_with_the_root_of_the_volume():
    full = 25 * MMHG
    wide = width_share(np, PRESSURES, full=full, half=HALF, exponent=EXPONENT)
    np.testing.assert_allclose(wide**2, share(PRESSURES) / share(full), rtol=1e-12)
    known = gas_numbers()
    for name in SEGMENTS:
        assert 12 * MMHG < known[f"half_pressure.{name}"] < 18.01 * MMHG
        assert diameter_share(np, name, known["full_pressure"]) == pytest.approx(1.0)
        assert diameter_share(np, name, 1333.0) < 0.75
        assert 0.025 < full_diameters()[name] < 0.05


def test_tension_of_a_tube_is_laplaces():
    assert wall_tension(3333.0, 0.02) == pytest.approx(66.66)


def test_gas_gives_back_the_work_that_it_took() -> None:
    """The sum of p dV by the compliance is what is stored by the volumes, p V less the sum of V dp, to 1e-8."""
    law = {"half": 15 * MMHG, "exponent": 2.0}
    nodes, weights = np.polynomial.legendre.leggauss(200)
    first, last = 5 * MMHG, 40 * MMHG
    pressures, each = (first + last) / 2 + (last - first) / 2 * nodes, (last - first) / 2 * weights
    work = float((each * pressures * share_rate(np, pressures, **law)).sum())
    volumes = float((each * open_share(np, pressures, **law)).sum())
    ends = [float(p * open_share(np, np.float64(p), **law)) for p in (first, last)]
    assert work == pytest.approx(ends[1] - ends[0] - volumes, rel=1e-8)
    emptied = float(
        (each * pressure_of(np, open_share(np, pressures, **law), **law) * share_rate(np, pressures, **law)).sum()
    )
    assert emptied == pytest.approx(work, rel=1e-8)
