"""Water in a colon: incompressible, in the place of gas, kept where it was put, and heavy."""

import jax
import numpy as np
import pytest

from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.compartments import (
    NEWTON_STEPS,
    filled,
    gas_volumes,
    highest_pressure,
    lumen_volumes,
    most_water,
    pressures_of,
    step_gas,
    typical_colon,
)
from haustra.models.gas.law import MMHG, pressure_of
from haustra.models.gas.numbers import gas_numbers
from haustra.models.gas.water import most_filled, water_load, with_water
from tests.models.gas.test_compartments import VOLUMES, all_gas, people

COLON = typical_colon(VOLUMES)
START = 15 * MMHG
SIGMOID = SEGMENTS.index("sigmoid")


def poured(seconds: float, flow: float = 5e-6):
    state = filled(np, COLON, START)
    for _ in range(round(seconds / 0.1)):
        state = step_gas(np, COLON, state, flow=0.0, place=SIGMOID, timestep=0.1, pour=flow)
    return state


@pytest.mark.parametrize("volume", [5e-5, 2e-4, 3e-4, 4.5e-4])
def test_gas_has_the_room_that_water_leaves(volume: float):
    """Water within the open lumen leaves the pressure as it was; more of it asks for the pressure at which it fits."""
    state = with_water(np, COLON, filled(np, COLON, START), volume)
    assert state.water.sum() == pytest.approx(volume, rel=1e-12) and not state.water[2:].any()
    gas = gas_volumes(np, COLON, state)
    assert (gas > -1e-12).all()
    dense = 1 + state.pressure[:-1] / gas_numbers()["atmosphere"]
    np.testing.assert_allclose(state.held[:-1], gas * dense, atol=1e-12)
    np.testing.assert_allclose(pressures_of(np, COLON, state.held, state.water), state.pressure, rtol=1e-7)
    room = lumen_volumes(np, COLON, np.full(6, START))[:2].sum()
    assert (state.pressure[0] > START * (1 + 1e-9)) == (volume > room)
    assert state.pressure[0] == pytest.approx(state.pressure[1]) and (state.pressure[2:-1] == START).all()


def test_water_that_is_poured_in_presses_gas_together():
    """Where no gas can get away, p V of the gas stays: Boyle's law in what is left of the lumen."""
    state = filled(np, COLON, START)
    water = np.zeros(6)
    water[SIGMOID] = 5e-5
    pressure = pressures_of(np, COLON, state.held, water)
    left = lumen_volumes(np, COLON, pressure[:-1]) - water
    np.testing.assert_allclose(left * (1 + pressure[:-1] / gas_numbers()["atmosphere"]), state.held[:-1], rtol=1e-7)
    assert pressure[SIGMOID] > START + 100


def test_water_and_gas_are_kept_to_1e6_and_water_stands_where_it_was_put():
    before, state = filled(np, COLON, START), poured(40.0)
    assert state.water[SIGMOID] == pytest.approx(2e-4, rel=1e-9) == state.poured
    assert not np.delete(state.water, SIGMOID).any()
    assert abs(all_gas(state) - all_gas(before)) < 1e-6 * all_gas(before)
    for place in (SIGMOID, SIGMOID, 0, 3) * 200:
        state = step_gas(np, COLON, state, flow=-3e-6, place=place, timestep=0.1, pour=1e-6)
    assert abs(state.water.sum() - state.poured) < 1e-6 * 2e-4
    assert abs(all_gas(state) - all_gas(before)) < 1e-6 * all_gas(before)


def test_no_more_is_poured_in_than_a_pump_presses():
    state = poured(200.0)
    assert state.water[SIGMOID] == pytest.approx(most_water(np, COLON)[SIGMOID], rel=1e-9)
    assert state.pressure[SIGMOID] == pytest.approx(highest_pressure(), rel=1e-3)


def test_a_scope_that_sucks_takes_water_first_and_then_gas():
    state = poured(4.0)
    dry = state.given
    for _ in range(40):
        state = step_gas(np, COLON, state, flow=-4e-6, place=SIGMOID, timestep=0.1)
    assert state.water[SIGMOID] == pytest.approx(2e-5 - 1.6e-5) and state.given == dry
    for _ in range(40):
        state = step_gas(np, COLON, state, flow=-4e-6, place=SIGMOID, timestep=0.1)
    assert state.water[SIGMOID] == pytest.approx(0.0, abs=1e-15)
    assert state.given == pytest.approx(dry - 1.2e-5)


def test_without_water_pressures_are_those_of_gas_alone_to_the_bit():
    """Newton's method as it was before there was water."""
    colon, known = people(20), gas_numbers()
    held = filled(np, colon, START).held
    wanted, standard, exponent = np.maximum(held[:, :-1], 1e-300) / colon.most, known["atmosphere"], known["exponent"]
    highest = highest_pressure()
    own = pressure_of(np, wanted / (1 + highest / standard), half=colon.half, exponent=exponent)
    own = np.minimum(own, highest)
    for _ in range(NEWTON_STEPS):
        over = own + colon.tone
        resist = np.log(2) * np.exp(exponent * np.log(colon.half / own))
        short = np.log(wanted) + resist - np.log(1 + over / standard)
        own = np.maximum(own + short / (exponent * resist / own + 1 / (standard + over)), own / 2)
    np.testing.assert_array_equal(pressures_of(np, colon, held, np.zeros_like(colon.most))[:, :-1], own + colon.tone)


def test_worlds_have_water_of_their_own_and_jax_agrees():
    colon = people(3)
    state = with_water(np, colon, filled(np, colon, START), np.array([0.0, 1e-4, 3e-4]))
    np.testing.assert_allclose(state.water.sum(axis=1), [0.0, 1e-4, 3e-4], atol=1e-15)
    asked = {"flow": np.array([0.0, -1e-5, 0.0]), "place": np.ones(3, int), "timestep": 0.1, "pour": 5e-6}
    many = step_gas(np, colon, state, **asked)
    with jax.enable_x64(True):
        traced = jax.jit(lambda state: step_gas(jax.numpy, colon, state, **asked))(state)
    for one, other in zip(many, traced, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-15)


def test_water_weighs_on_the_nodes_of_its_segment_downwards():
    share = np.zeros((5, 6))
    share[1:3, SIGMOID] = 0.5
    water = np.zeros(6)
    water[[SIGMOID, 4]] = 3e-4, 1e-4
    load = water_load(np, water, share, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(load.sum(axis=0), [0.0, 993 * 9.81 * 3e-4, 0.0])
    assert not load[[0, 3, 4]].any()


def test_most_that_begins_there_is_what_hurts():
    hurts = lumen_volumes(np, COLON, np.full(6, gas_numbers()["pain_pressure"]))[:2].sum()
    assert most_filled(np, COLON) == pytest.approx(hurts)
    state = with_water(np, COLON, filled(np, COLON, START), hurts)
    assert state.pressure[0] == pytest.approx(gas_numbers()["pain_pressure"], rel=1e-6)
