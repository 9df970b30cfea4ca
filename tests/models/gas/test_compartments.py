"""Gas in the compartments of a colon: nothing is lost, pressures settle, collapsed segments close."""

from functools import partial

import jax
import numpy as np
import pytest

from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.repair import signed_volume
from haustra.models.gas.compartments import (
    GasColon,
    GasState,
    collapsed,
    drawn_colon,
    filled,
    filling,
    gas_volumes,
    pressures_of,
    segment_volumes,
    step_gas,
    typical_colon,
)
from haustra.models.gas.law import MMHG
from haustra.models.gas.numbers import full_diameters, gas_numbers
from tests.models.wall.conftest import swept_colon
from tests.models.wall.quickly import jitted

LENGTHS = np.array([0.15, 0.41, 0.268, 0.44, 0.17, 0.07])
VOLUMES = np.pi / 4 * np.array(list(full_diameters().values())) ** 2 * LENGTHS
LITRE_A_MINUTE = 1e-3 / 60
FULL = gas_numbers()["full_pressure"]


def people(count: int) -> GasColon:
    rng = np.random.default_rng(0)
    drawn = [drawn_colon(rng, VOLUMES) for _ in range(count)]
    return GasColon(*(np.stack(parts) for parts in zip(*drawn, strict=True)))


def all_gas(state: GasState) -> np.ndarray:
    return state.held.sum(axis=-1) + state.leaked + state.absorbed - state.given


def test_at_the_set_point_segments_hold_their_volumes():
    colon = typical_colon(VOLUMES)
    state = filled(np, colon, FULL)
    np.testing.assert_allclose(gas_volumes(np, colon, state), VOLUMES, rtol=1e-12)
    np.testing.assert_allclose(filling(np, colon, state.pressure[:-1]), 1.0, rtol=1e-12)
    assert not collapsed(np, colon, state).any()
    assert collapsed(np, colon, filled(np, colon, 5 * MMHG)).all()


@pytest.mark.parametrize("pressure", [2.0, 8.0, 25.0, 57.0])
def test_pressure_is_the_inverse_of_what_is_held(pressure: float):
    colon = people(50)
    state = filled(np, colon, pressure * MMHG)
    sound = state.pressure[:, :-1] - colon.tone > 3 * MMHG  # below, a segment holds nothing that could tell
    found = pressures_of(np, colon, state.held)[:, :-1]
    np.testing.assert_allclose(found[sound], state.pressure[:, :-1][sound], rtol=1e-7)


def test_overfilled_segments_have_a_high_pressure_and_no_segment_has_none():
    """More gas than fits at atmospheric pressure is compressed, as Boyle says."""
    colon = typical_colon(VOLUMES)
    twice = pressures_of(np, colon, np.append(2 * colon.most, 0.0))[:-1]
    np.testing.assert_allclose(twice, gas_numbers()["atmosphere"], rtol=0.02)
    assert np.isfinite(pressures_of(np, colon, np.zeros(7))).all()


def test_no_gas_is_lost_by_insufflation_suction_leaks_and_valves():
    """Flows of up to 4 L/min either way, at places all over 20 colons, for ten minutes."""
    rng, colon = np.random.default_rng(1), people(20)
    state = filled(np, colon, 12 * MMHG)
    begun = all_gas(state)
    for _ in range(1200):
        flow, place = rng.uniform(-4, 4, 20) * LITRE_A_MINUTE, rng.integers(0, len(SEGMENTS), 20)
        flow = np.where(state.pressure[:, 0] > 50 * MMHG, -abs(flow), flow)
        state = step_gas(np, colon, state, flow=flow, place=place, timestep=0.5)
        assert (state.held >= 0).all() and np.isfinite(state.pressure).all()
    passed = begun + 1200 * 0.5 * 2 * LITRE_A_MINUTE
    assert np.abs(all_gas(state) - begun).max() < 1e-12 * passed.max()
    assert state.leaked.min() > 0 and state.absorbed.min() > 0


def test_open_segments_come_to_one_pressure_and_a_step_of_any_length_stays_bounded():
    colon = typical_colon(VOLUMES)._replace(refluxes=np.float64(0))
    state = filled(np, colon, 20 * MMHG)
    held = state.held * np.array([1.1, 0.95, 1, 1, 0.95, 1, 0])
    state = state._replace(held=held, pressure=pressures_of(np, colon, held))
    for _ in range(20):
        state = step_gas(np, colon, state, flow=0.0, place=0, timestep=2.0)
    assert np.ptp(state.pressure[:-1]) < 5.0  # what the leak and the blood take flows past open segments
    state = step_gas(np, colon, state, flow=0.0, place=0, timestep=1e4)
    assert 0 <= state.pressure.max() < 20 * MMHG


def test_a_collapsed_segment_closes_until_pressure_opens_it():
    sigmoid = SEGMENTS.index("sigmoid")
    tone = np.zeros(len(SEGMENTS))
    tone[sigmoid] = 30 * MMHG
    colon = typical_colon(VOLUMES)._replace(tone=tone)
    state = filled(np, colon, 20 * MMHG)
    assert collapsed(np, colon, state).tolist() == [False, True, False, False, False, False]
    behind = state.pressure[sigmoid + 1]
    for _ in range(100):
        blown = state.pressure[0] < FULL
        state = step_gas(np, colon, state, flow=2 * LITRE_A_MINUTE * blown, place=0, timestep=0.1)
    assert state.pressure[0] > 24 * MMHG
    assert state.pressure[sigmoid + 1] <= behind  # nothing came through
    for _ in range(400):
        blown = state.pressure[0] < 50 * MMHG
        state = step_gas(np, colon, state, flow=4 * LITRE_A_MINUTE * blown, place=0, timestep=0.1)
    assert state.pressure[sigmoid + 1] > 30 * MMHG
    assert not collapsed(np, colon, state)[sigmoid]


def test_more_flow_more_pressure_and_reflux_takes_gas_in():
    """0.25 L/min give 9 to 57 mmHg with the tip free (n = 34), whatever the segment of the tip."""
    colon = typical_colon(VOLUMES)
    many = GasColon(*(np.stack([part] * 4) for part in colon))._replace(refluxes=np.array([1.0, 1, 1, 0]))
    state = filled(np, many, 9 * MMHG)
    flow = np.array([0.1, 0.25, 1.0, 1.0]) * LITRE_A_MINUTE
    for _ in range(1800):
        state = step_gas(np, many, state, flow=flow, place=np.array([0, 3, 5, 5]), timestep=1.0)
    pressure = state.pressure[:, 3] / MMHG
    assert (np.diff(pressure[:3]) > 0).all()
    assert 9 < pressure[1] < 57
    assert state.held[2, -1] > 0 and state.held[3, -1] == 0


def test_suction_collapses_and_never_takes_more_than_there_is():
    colon = typical_colon(VOLUMES)
    state = filled(np, colon, 15 * MMHG)
    for _ in range(600):
        state = step_gas(np, colon, state, flow=-10 * LITRE_A_MINUTE, place=1, timestep=0.5)
    assert collapsed(np, colon, state)[1] and (state.held >= 0).all()


def test_jax_steps_the_same_gas():
    colon = people(3)
    state = filled(np, colon, 15 * MMHG)
    asked = {"flow": np.array([1.0, -1.0, 0.25]) * LITRE_A_MINUTE, "place": np.array([0, 2, 5]), "timestep": 0.1}
    expected = step_gas(np, colon, state, **asked)
    with jax.enable_x64(True):
        found = jitted(partial(step_gas, jax.numpy, **asked))(colon, state)
    for mine, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-15)


def test_volume_of_a_segment_is_its_lumens():
    path = np.column_stack([np.linspace(0, 0.6, 301), np.zeros(301), np.zeros(301)])
    colon = swept_colon(path, name="tube")
    held = segment_volumes(colon)[0]  # it is all rectum
    inside = signed_volume(colon.lumen.vertices, colon.lumen.faces)
    assert held == pytest.approx(inside, rel=0.02)
