"""Gas that endoscopists suck out of patients and let in again."""

import numpy as np
import pytest

from haustra.envs.study.clinic_gas import PatientsGas
from haustra.models.anatomy.grown import grow_colon
from haustra.models.gas.numbers import gas_numbers

_SUCKS, _LETS_IN = np.ones(2, bool), np.zeros(2, bool)


@pytest.fixture(scope="module")
def colons():
    """One person's at 10 and 25 mmHg."""
    return [grow_colon(seed=3, pressure=pressure) for pressure in (1333.0, 3333.0)]


def test_a_colon_that_nobody_sucks_at_keeps_its_gas(colons):
    gas = PatientsGas(colons)
    for _ in range(3):
        np.testing.assert_allclose(gas(_LETS_IN, 10.0), 0.0, atol=1e-9)
        assert gas.full


def test_suction_takes_the_thrust_of_the_gas_away_and_closes_the_lumen_before_all_is_out(colons):
    """More and more, never all of the pressure at which the colon was imaged: a closed lumen lets nothing through."""
    gas, full = PatientsGas(colons), np.array([1333.0, 3333.0])
    lost = np.array([gas(_SUCKS, 1.0) for _ in range(300)])
    assert (np.diff(lost, axis=0) >= 0).all()
    assert (lost[0] > 0).all() and (lost[0] < 0.2 * full).all()
    assert (lost[-1] > 0.9 * full).all() and (lost[-1] < full).all()


def test_gas_comes_back_as_slowly_as_a_scope_lets_it_in(colons):
    """Sucked for 5 s, as much is back after 5 s times suction over flow, and not before."""
    gas, known = PatientsGas(colons), gas_numbers()
    gas(_SUCKS, 5.0)
    back = 5.0 * known["suction"] / known["flow"]
    assert (gas(_LETS_IN, 0.9 * back) > 0).all() and not gas.full
    np.testing.assert_allclose(gas(_LETS_IN, 0.11 * back), 0.0, atol=1e-9)
    assert gas.full
