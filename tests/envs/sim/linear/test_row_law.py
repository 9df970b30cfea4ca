"""A law over short arrays, compiled, says what numpy says of the same arrays."""

from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.linear.row_law import row_law
from haustra.models.gas.compartments import GasColon, GasState, filled, gas_volumes, step_gas, typical_colon

RANDOM = np.random.default_rng(0)
WORLDS = 40


def beside(*parts: Any) -> np.ndarray:
    """Numbers of worlds side by side."""
    return np.concatenate([np.asarray(part, float).reshape(WORLDS, -1) for part in parts], axis=1)


def plain(xp: Any, many: Any, one: Any) -> tuple[Any, ...]:
    """What laws do to arrays."""
    here = xp.asarray(one)[..., None] == np.arange(3)
    turned = 1.0 - many / (2.0 + many * many)
    picked = xp.where(np.arange(3) == 1, xp.maximum(many, 0.0), xp.minimum(many, one[..., None]))
    ends = xp.concatenate([many[..., :1], xp.zeros_like(many[..., :1]), -many[..., -1:]], -1)
    about = xp.stack([xp.exp(-(many * many)).sum(-1), xp.log(1.5 + one), xp.sqrt(one)], -1)
    chosen = np.array([1.0, 2.0, 3.0]) * xp.where(many > one[..., None], many, 0.5)
    return turned, picked, ends, about, chosen, (here * many).sum(-1)


def test_what_laws_do_is_numpys() -> None:
    many, one = RANDOM.normal(size=(WORLDS, 3)), RANDOM.integers(0, 3, WORLDS).astype(float)
    found = row_law(plain, (3, None))(beside(many, one))
    np.testing.assert_allclose(found, beside(*plain(np, many, one)), rtol=1e-13, atol=1e-14)


def gas(xp: Any, *given: Any) -> tuple[Any, ...]:
    """A step of the gas, and the volumes after it."""
    person, state, (flow, place, timestep, pour) = GasColon(*given[:4]), GasState(*given[4:11]), given[11:]
    state = step_gas(xp, person, state, flow=flow, place=place, timestep=timestep, pour=pour)
    return *state, gas_volumes(xp, person, state)


@pytest.mark.parametrize("flow", [1e-4, -1e-4])
def test_gas_moves_as_by_numpy(flow: float) -> None:
    """To 1e-11 of the largest number of its kind, from collapsed to full, in and out, beside water, in fifty steps."""
    most = np.exp(RANDOM.uniform(-11, -7, (WORLDS, 6)))
    reflux = RANDOM.integers(0, 2, WORLDS).astype(float)
    person = typical_colon(most)._replace(tone=RANDOM.normal(0, 300, most.shape), refluxes=reflux)
    state = filled(np, person, RANDOM.uniform(100, 6000, (WORLDS, 1)))
    law = row_law(gas, (6, 6, 6, None, 7, 7, None, None, None, 6, None, None, None, None, None))
    for _ in range(50):
        given = flow * RANDOM.random(WORLDS), RANDOM.integers(0, 6, WORLDS), RANDOM.uniform(0.02, 0.5, WORLDS)
        given = *given, RANDOM.integers(0, 2, WORLDS) * 1e-5
        known = gas(np, *person, *state, *given)
        found = law(beside(*person, *state, *given))
        expected = beside(*known)
        assert np.abs((found - expected) / (np.abs(expected).max(axis=0) + 1e-30)).max() < 1e-11
        state = GasState(*known[: len(state)])
