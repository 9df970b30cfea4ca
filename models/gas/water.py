"""Water in the rectum and sigmoid at the start, and its weight on the axis of a colon that moves."""

import re
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.compartments import GasColon, GasState, lumen_volumes
from haustra.models.gas.numbers import gas_numbers
from haustra.models.wall.abdomen import FALL

FILLED = ("rectum", "sigmoid")
"""Segments that water is put in at the start."""
_UNITS = {"mL": 1e-6, "L": 1e-3}
"""Cubic metres in one unit."""
_HALVINGS = 50
"""Steps of bisection for the pressure that water asks for: to 1e-11 Pa."""


def volume_from(text: str) -> float:
    """Read '300mL' or '0.3L' as a volume [m^3].

    Raises:
        InvalidOptionError: when it is none.
    """
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]*)?)\s*(mL|L)\s*", text)
    if match is None:
        raise InvalidOptionError(f"'{text}' is no volume of water: give '300mL' or '0.3L'.")
    return float(match.group(1)) * _UNITS[match.group(2)]


def with_water(xp: Any, colon: GasColon, state: GasState, volume: Any) -> GasState:
    """Put water into rectum and sigmoid, in the place of gas there.

    Both are at one pressure: that of the gas where the water finds room, and else the one at which it fills both. They
    share it by their volumes.

    Args:
        xp: numpy or jax.numpy.
        colon: of each world.
        state: of gas alone, at one pressure.
        volume: of the water [m^3], no more than `most_filled`.
    """
    inside = np.array([name in FILLED for name in SEGMENTS])
    pressure = xp.maximum(state.pressure[..., :-1], _pressure_for(xp, colon, inside, volume)[..., None])
    pressure = xp.where(inside, pressure, state.pressure[..., :-1])
    room = lumen_volumes(xp, colon, pressure) * inside
    water = room * (volume / room.sum(-1))[..., None]
    gas = xp.maximum(room - water, 0.0) * (1 + pressure / gas_numbers()["atmosphere"])
    held = xp.where(inside, gas, state.held[..., :-1])
    return state._replace(
        held=xp.concatenate([held, state.held[..., -1:]], -1),
        pressure=xp.concatenate([pressure, state.pressure[..., -1:]], -1),
        water=water,
    )


def most_filled(xp: Any, colon: GasColon) -> Any:
    """Water that rectum and sigmoid take together at the pressure that hurts [m^3]."""
    inside = np.array([name in FILLED for name in SEGMENTS])
    return (lumen_volumes(xp, colon, gas_numbers()["pain_pressure"]) * inside).sum(-1)


def water_load(
    xp: Any, water: Float[Any, "... segments"], share: Float[Any, "... nodes segments"], down: Float[Any, "... 3"]
) -> Float[Any, "... nodes 3"]:
    """Weight of water on the nodes of a colon's axis [N].

    Water was not there when the colon was imaged, in balance: all of its weight counts, unlike the wall's own
    (`haustra.models.wall.abdomen.turned_weight`).

    Args:
        xp: numpy or jax.numpy.
        water: in each segment [m^3].
        share: of each segment's water that each node bears [1].
        down: direction of gravity.
    """
    weight = gas_numbers()["water.density"] * FALL * (share * water[..., None, :]).sum(-1)
    return weight[..., None] * down[..., None, :]


def _pressure_for(xp: Any, colon: GasColon, inside: Any, volume: Any) -> Any:
    """Pressure at which segments hold so much together [Pa]."""
    low = xp.zeros_like(colon.most[..., 0])
    high = low + gas_numbers()["pain_pressure"]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        holds = (lumen_volumes(xp, colon, middle[..., None]) * inside).sum(-1)
        low, high = xp.where(holds < volume, middle, low), xp.where(holds < volume, high, middle)
    return high
