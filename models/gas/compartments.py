"""Gas in the compartments of one colon: its six segments, and the small bowel behind the ileocaecal valve.

Gas is counted as the volume it would have at standard pressure, at the body's temperature throughout. What one
compartment loses another gains, or a ledger does, so nothing is lost. A segment that is collapsed closes: gas passes
between neighbours only where the higher of their pressures holds both of them open. Pressures of a step are those at
its end (one implicit step of the linearised compartments), so that steps may be long.

Water is incompressible and stands in the segment that it was put in: it takes room there, and gas has what is left. A
scope that sucks takes water first where its tip stands in some. Water neither leaks at the anus nor is absorbed, and
its own depth adds nothing to the pressure: all of that is assumed.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.law import open_share, pressure_of, share_rate
from haustra.models.gas.numbers import gas_numbers

COMPARTMENTS = (*SEGMENTS, "ileum")
"""From the anus inwards."""
MOST_TAKEN = 0.5
"""Largest share of a compartment's gas that one way out may take in a step: what is left keeps its sign."""
SOFTEST = 1e-13
"""Least compliance of a compartment [m^3/Pa]: a closed one has none."""
LEAST_VOLUME = 1e-5
"""Volume of a segment that a colon lacks [m^3]: 10 mL, which gas passes through as fast as scopes let it in."""
NEWTON_STEPS = 6
"""From below; below 60 mmHg the pressure is exact to 1e-7 then."""
RAMP = 0.5
"""A segment's passage opens fully between the closed share and half as much again [1]."""


class GasColon(NamedTuple):
    """One person's colon as gas sees it; leading axes are worlds."""

    most: Float[Any, "... segments"]
    """Volume of each segment when nothing more opens, Vmax [m^3]."""
    half: Float[Any, "... segments"]
    """Pressure at which half of that is reached [Pa]."""
    tone: Float[Any, "... segments"]
    """What presses on each segment beyond what is typical [Pa]."""
    refluxes: Float[Any, "..."]
    """Whether the ileocaecal valve lets gas into the small bowel: 1 or 0."""


class GasState(NamedTuple):
    """Where the gas is; leading axes are worlds. All volumes are at standard pressure [m^3]."""

    held: Float[Any, "... compartments"]
    """In each compartment."""
    pressure: Float[Any, "... compartments"]
    """Over that of the atmosphere [Pa]."""
    given: Float[Any, "..."]
    """Let in through the scope, less what it sucked out."""
    leaked: Float[Any, "..."]
    """Out of the anus."""
    absorbed: Float[Any, "..."]
    """Into the blood."""
    water: Float[Any, "... segments"]
    """Volume of water in each segment [m^3]."""
    poured: Float[Any, "..."]
    """Water let in through the scope, less what it sucked out [m^3]."""


def typical_colon(volumes: Float[np.ndarray, "*worlds segments"], *, pressure: float | None = None) -> GasColon:
    """A typical person's colon, with reflux.

    Args:
        volumes: of the segments at that pressure [m^3].
        pressure: of gas [Pa]; the set point of CT colonography when None.
    """
    known = gas_numbers()
    half = np.array([known[f"half_pressure.{name}"] for name in SEGMENTS])
    full = open_share(np, pressure or known["full_pressure"], half=half, exponent=known["exponent"])
    return GasColon(volumes / full, half + 0 * volumes, 0 * volumes, np.ones(volumes.shape[:-1]))


def drawn_colon(rng: np.random.Generator, volumes: Float[np.ndarray, " segments"]) -> GasColon:
    """A person's colon: what presses on each segment, and whether the ileocaecal valve leaks, are drawn.

    Args:
        rng: source of all draws.
        volumes: of the segments at the set point of CT colonography [m^3].
    """
    known = gas_numbers()
    mean = np.array([known[f"tone.{name}"] for name in SEGMENTS])
    tone = mean * (rng.exponential(size=len(SEGMENTS)) - np.log(2))
    return typical_colon(volumes)._replace(tone=tone, refluxes=np.float64(rng.random() < known["reflux.share"]))


def segment_volumes(colon: Colon) -> Float[np.ndarray, " segments"]:
    """Volume of each segment of a colon as it lies [m^3]; next to none of those that it lacks."""
    arc = colon.centreline.arc
    area = np.pi * (colon.radius**2).mean(axis=1) * np.gradient(arc)
    spans = {each.name: area[(arc >= each.start) & (arc < each.end)].sum() for each in colon.segments}
    return np.array([max(spans.get(name, 0.0), LEAST_VOLUME) for name in SEGMENTS])


def opened_at(colon: Colon) -> float:
    """Pressure of gas at which a colon is as wide as it was given [Pa]: what it was grown at, or CT colonography's."""
    own = colon.provenance.configuration.get("pressure")
    return float(own if isinstance(own, int | float) else gas_numbers()["full_pressure"])


def filled(xp: Any, colon: GasColon, pressure: Any) -> GasState:
    """Every segment at one pressure [Pa], and nothing in the small bowel."""
    known = gas_numbers()
    over = xp.zeros_like(colon.most) + pressure
    held = colon.most * _share(xp, colon, over) * (1 + over / known["atmosphere"])
    none = xp.zeros_like(held[..., :1])
    zero = none[..., 0]
    empty = xp.zeros_like(colon.most)
    return GasState(xp.concatenate([held, none], -1), xp.concatenate([over, none], -1), zero, zero, zero, empty, zero)


def lumen_volumes(xp: Any, colon: GasColon, pressure: Any) -> Float[Any, "... segments"]:
    """Volume of each segment, whatever fills it, at its pressure, or at one of all [Pa]; [m^3]."""
    return colon.most * _share(xp, colon, pressure)


def pressure_lost(xp: Any, colon: GasColon, pressure: Any, *, full: Any) -> Float[Any, "..."]:
    """How much less its gas thrusts a colon's ends apart than it did at the pressure `full`, over its area then [Pa].

    Gas of pressure p thrusts the ends of a tube of cross-section A apart by p A; what a colon has lost of that draws it
    together (`haustra.models.wall.moving_colon.gas_thrust`). The mean over segments, by their volumes.

    Args:
        xp: numpy, jax.numpy, or what a program offers in their place.
        colon: whose.
        pressure: of each segment, or of all, over that of the atmosphere [Pa].
        full: pressure of all segments at which the colon was in balance [Pa].
    """
    whole, now = lumen_volumes(xp, colon, full), lumen_volumes(xp, colon, pressure)
    return (full * whole - pressure * now).sum(-1) / whole.sum(-1)


def gas_volumes(xp: Any, colon: GasColon, state: GasState) -> Float[Any, "... segments"]:
    """Volume of the gas in each segment now [m^3]."""
    return lumen_volumes(xp, colon, state.pressure[..., :-1]) - state.water


def filling(xp: Any, colon: GasColon, pressure: Float[Any, "... segments"]) -> Float[Any, "... segments"]:
    """Volume of each segment at its pressure [Pa], over a typical person's at the set point of CT colonography [1]."""
    known = gas_numbers()
    full = open_share(xp, known["full_pressure"], half=colon.half, exponent=known["exponent"])
    return _share(xp, colon, pressure) / full


def collapsed(xp: Any, colon: GasColon, state: GasState) -> Any:
    """Which segments are collapsed."""
    return filling(xp, colon, state.pressure[..., :-1]) < gas_numbers()["closed_share"]


def step_gas(
    xp: Any, colon: GasColon, state: GasState, *, flow: Any, place: Any, timestep: Any, pour: Any = 0.0
) -> GasState:
    """Let gas and water in or out at the tip, and let gas move for a time step.

    Args:
        xp: numpy or jax.numpy.
        colon: of each world.
        state: before.
        flow: of gas into the colon at standard pressure [m^3/s]; negative when the scope sucks, water first.
        place: number of the segment that the tip is in, in each world.
        timestep: one, or one a world [s].
        pour: flow of water into the colon [m^3/s].
    """
    known = gas_numbers()
    held, over = state.held, state.pressure
    flow, timestep = xp.asarray(flow, dtype=held.dtype), xp.asarray(timestep, dtype=held.dtype)
    span = timestep[..., None]
    here = xp.asarray(place)[..., None] == np.arange(len(COMPARTMENTS))
    there = (held * here).sum(-1)
    drawn, let_in = _water_moved(xp, colon, state, here[..., :-1], flow * timestep, pour * timestep)
    given = xp.where(flow > 0, flow * timestep, -xp.minimum(-flow * timestep - drawn, MOST_TAKEN * there))
    gone = held * (1 - xp.exp(-known["absorption"] * span))
    rooms = _compliance(xp, colon, state)
    ways = span * _passages(xp, colon, over)
    anus = timestep * known["leak.conductance"] * xp.where(over[..., 0] > known["leak.opening"], 1.0, 0.0)
    push = rooms * over + given[..., None] * here - gone
    push = push + (let_in - drawn)[..., None] * here * (1 + over / known["atmosphere"])  # gas that water displaces
    push = push + (anus * known["leak.opening"])[..., None] * (np.arange(len(COMPARTMENTS)) == 0)
    # Gas that goes through the ileocaecal valve is driven by what is left above its opening pressure.
    barrier = ways[..., -1] * known["reflux.opening"]
    push = push + barrier[..., None] * (np.arange(len(COMPARTMENTS)) == len(SEGMENTS) - 1)
    push = push - barrier[..., None] * (np.arange(len(COMPARTMENTS)) == len(SEGMENTS))
    later = _solved(xp, rooms, ways, anus, push)
    drop = later[..., :-1] - later[..., 1:] - known["reflux.opening"] * (np.arange(len(SEGMENTS)) == len(SEGMENTS) - 1)
    moved = ways * drop
    moved = xp.where(np.arange(len(SEGMENTS)) == len(SEGMENTS) - 1, xp.maximum(moved, 0.0), moved)
    spare = held - gone - MOST_TAKEN * there[..., None] * here * xp.where(flow < 0, 1.0, 0.0)[..., None]
    bound = MOST_TAKEN / 2 * xp.maximum(spare, 0.0)
    moved = xp.minimum(xp.maximum(moved, -bound[..., 1:]), bound[..., :-1])
    leaked = xp.minimum(xp.maximum(anus * (later[..., 0] - known["leak.opening"]), 0.0), bound[..., 0])
    none = xp.zeros_like(moved[..., :1])
    held = held - gone + given[..., None] * here - xp.concatenate([moved, none], -1) + xp.concatenate([none, moved], -1)
    held = held - leaked[..., None] * (np.arange(len(COMPARTMENTS)) == 0)
    water = state.water + (let_in - drawn)[..., None] * here[..., :-1]
    return GasState(
        held,
        pressures_of(xp, colon, held, water),
        state.given + given,
        state.leaked + leaked,
        state.absorbed + gone.sum(-1),
        water,
        state.poured + let_in - drawn,
    )


def most_water(xp: Any, colon: GasColon) -> Float[Any, "... segments"]:
    """Water that each segment holds at most [m^3]: what opens it to `highest_pressure`."""
    return lumen_volumes(xp, colon, highest_pressure())


def highest_pressure() -> float:
    """What no pump of a scope comes to [Pa], assumed: twice the pressure that hurts."""
    return 2 * gas_numbers()["pain_pressure"]


def pressures_of(
    xp: Any, colon: GasColon, held: Float[Any, "... compartments"], water: Any = 0.0
) -> Float[Any, "... compartments"]:
    """Pressure of gas of so much at standard pressure in each compartment, beside so much water [m^3]; [Pa].

    Newton's method on ln V(p) - ln(W + n / (1 + p / p0)), which is concave and rises: from below it comes to the root
    without passing it.
    """
    known = gas_numbers()
    half, exponent, standard = colon.half, known["exponent"], known["atmosphere"]
    wanted, wet = xp.maximum(held[..., :-1], 1e-300) / colon.most, water / colon.most
    highest = highest_pressure()
    own = xp.minimum(pressure_of(xp, wanted / (1 + highest / standard) + wet, half=half, exponent=exponent), highest)
    for _ in range(NEWTON_STEPS):
        over = own + colon.tone
        resist = np.log(2) * xp.exp(exponent * xp.log(half / own))
        of_gas = 1 + wet * ((1 + over / standard) / wanted)  # what fills the segment, over the gas
        short = xp.log(wanted) + resist - xp.log(1 + over / standard) + xp.log(of_gas)
        own = xp.maximum(own + short / (exponent * resist / own + 1 / (standard + over) / of_gas), own / 2)
    ileum = held[..., -1:] / known["reflux.capacity"]
    return xp.concatenate([own + colon.tone, ileum], -1)


def _share(xp: Any, colon: GasColon, over: Any) -> Any:
    return open_share(xp, over - colon.tone, half=colon.half, exponent=gas_numbers()["exponent"])


def _water_moved(xp: Any, colon: GasColon, state: GasState, here: Any, flowed: Any, pours: Any) -> tuple[Any, Any]:
    """What of water a scope that sucks takes where its tip is, and what it lets in [m^3].

    Args:
        xp: numpy or jax.numpy.
        colon: of each world.
        state: before.
        here: 1 in the segment of the tip.
        flowed: volume that flows in; negative when the scope sucks [m^3].
        pours: water to be let in [m^3].
    """
    room = xp.maximum(most_water(xp, colon) - state.water, 0.0)
    let_in = xp.minimum(pours, (room * here).sum(-1))
    return xp.minimum(xp.maximum(-flowed, 0.0), (state.water * here).sum(-1)), let_in


def _compliance(xp: Any, colon: GasColon, state: GasState) -> Any:
    """How much more gas each compartment takes as its pressure rises [m^3/Pa]."""
    known, over = gas_numbers(), state.pressure
    own = over[..., :-1]
    rate = share_rate(xp, own - colon.tone, half=colon.half, exponent=known["exponent"])
    of_gas = _share(xp, colon, own) - state.water / colon.most
    rooms = colon.most * (rate * (1 + own / known["atmosphere"]) + of_gas / known["atmosphere"])
    ileum = xp.zeros_like(over[..., -1:]) + known["reflux.capacity"]
    return xp.concatenate([xp.maximum(rooms, SOFTEST), ileum], -1)


def _passages(xp: Any, colon: GasColon, over: Any) -> Any:
    """Conductance from each compartment to the next [m^3/s/Pa]."""
    known = gas_numbers()
    own = over[..., :-1]
    higher = xp.maximum(own[..., :-1], own[..., 1:])
    before = _passable(xp, colon._replace(half=colon.half[..., :-1], tone=colon.tone[..., :-1]), higher)
    after = _passable(xp, colon._replace(half=colon.half[..., 1:], tone=colon.tone[..., 1:]), higher)
    valve = xp.where(own[..., -1] - over[..., -1] > known["reflux.opening"], 1.0, 0.0) * colon.refluxes
    return xp.concatenate([known["passage"] * before * after, (known["reflux.conductance"] * valve)[..., None]], -1)


def _passable(xp: Any, colon: GasColon, over: Any) -> Any:
    """How open a segment's lumen is at a pressure [1]: closed when collapsed."""
    closed = gas_numbers()["closed_share"]
    return xp.minimum(xp.maximum((filling(xp, colon, over) - closed) / (RAMP * closed), 0.0), 1.0)


def _solved(xp: Any, rooms: Any, ways: Any, anus: Any, push: Any) -> Any:
    """Pressures at the end of a step: Thomas' algorithm on the compartments' tridiagonal system."""
    count = len(COMPARTMENTS)
    diagonal = [rooms[..., i] for i in range(count)]
    diagonal[0] = diagonal[0] + anus
    right = [push[..., i] for i in range(count)]
    for i in range(count - 1):
        diagonal[i], diagonal[i + 1] = diagonal[i] + ways[..., i], diagonal[i + 1] + ways[..., i]
    for i in range(1, count):
        share = ways[..., i - 1] / diagonal[i - 1]
        diagonal[i] = diagonal[i] - share * ways[..., i - 1]
        right[i] = right[i] + share * right[i - 1]
    found = [right[-1] / diagonal[-1]]
    for i in reversed(range(count - 1)):
        found.append((right[i] + ways[..., i] * found[-1]) / diagonal[i])
    return xp.stack(found[::-1], -1)
