"""Gas and water in runs: let in at the tips, they set how wide each world's lumen is and how stiff its wall."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from haustra.envs.sim.linear.row_law import Size, row_law
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.landmarks import SEGMENTS, segment_names
from haustra.models.gas.compartments import (
    GasColon,
    GasState,
    filled,
    filling,
    gas_volumes,
    opened_at,
    pressure_lost,
    segment_volumes,
    step_gas,
    typical_colon,
)
from haustra.models.gas.law import tension_stiffness, wall_tension
from haustra.models.gas.water import most_filled, with_water
from haustra.models.injury.pain import pain
from haustra.models.injury.perforation import bursting_pressure, gas_load
from haustra.models.scene import SceneOptions
from haustra.models.wall.signed_distance import surface_arcs

TAPER = 0.01
"""Standard deviation of the arc length over which the width of one segment goes over into the next's [m]."""
ANAL_CANAL = 0.04
"""Length behind the anus that the scope holds open, not gas [m]: Ellis, Clinical Anatomy."""
INTERVAL = 0.1
"""Time between two steps of the gas [s]: it fills a colon in minutes."""

_MOMENTARY = ("_sought", "_moved", "pressure_peak", "_due", "_tip", "_case", "asked", "pouring", "tissue_stiffness")
"""What of worlds' gas changes; each value is replaced, never written into."""
_TOLD = len(SEGMENTS) + 2
"""Numbers of a world that a step tells behind its state."""
_STEPPED = ("flow", "place", "timestep", "pour")
"""What a step of the gas is given, as `step_gas` names it."""


class GasRecord(NamedTuple):
    """What was recorded of gas after every decision."""

    pressure: Float[np.ndarray, "records segments"]
    """Pressure of each segment, over that of the atmosphere [Pa]."""
    volume: Float[np.ndarray, " records"]
    """Volume of the colon's gas [m^3]."""
    given: Float[np.ndarray, " records"]
    """Let in through the scope so far, at standard pressure [m^3]."""
    water: Float[np.ndarray, " records"]
    """Volume of the colon's water [m^3]."""
    share: Float[np.ndarray, "records segments"]
    """Radius of each segment over that of the colon as it was given [1]."""


class GasBurden(NamedTuple):
    """What the wall bears of gas alone, one number a world."""

    gas_load: Float[np.ndarray, " worlds"]
    """Largest load over the median person's strength [1]."""
    gas_load_arc: Float[np.ndarray, " worlds"]
    """Arc length there [m]."""
    gas_pain: Float[np.ndarray, " worlds"]
    """Largest tension over that which hurts [1]."""
    gas_pain_arc: Float[np.ndarray, " worlds"]
    """Arc length there [m]."""


class _Lumens(NamedTuple):
    """What gas finds in colons as they were given; leading axis: colons."""

    person: GasColon
    full: Float[np.ndarray, " colons"]
    """Pressure at which they were so [Pa]."""
    given: Float[np.ndarray, "colons segments"]
    """Filling of each segment then, as `filling` counts it [1]."""
    radius: Float[np.ndarray, "colons segments"]
    """Mean radius of each segment [m]."""
    step: Float[np.ndarray, " colons"]
    """Distance between the stations of the colon's table [m]."""
    number: Int[np.ndarray, "colons stations"]
    """Segment of each station; behind a colon's last station as at it."""
    weights: Float[np.ndarray, "colons stations segments"]
    """What each segment has to say of the width at each station [1]; nothing behind a colon's last."""
    widest: Float[np.ndarray, "colons segments"]
    """Largest radius of each segment [m], and 0 of one that a colon lacks."""
    widest_arc: Float[np.ndarray, "colons segments"]
    """Arc length there [m]."""
    first_arc: Float[np.ndarray, "colons segments"]
    """Arc length where each segment begins [m]."""


class GasWorlds:
    """The gas of worlds, each a colon of a typical person, in which a scope lets in gas up to a set point.

    Worlds know nothing of each other.
    """

    def __init__(
        self,
        colons: Sequence[Colon],
        options: SceneOptions,
        *,
        stations: Sequence[int],
        device_radius: Float[np.ndarray, " colons"],
        worlds: int = 1,
        widths: Sequence[np.ndarray] | None = None,
    ) -> None:
        """Fill all worlds, in the first colon, to the pressure at the start.

        Args:
            colons: as they were given.
            options: name the set point.
            stations: of each colon's table.
            device_radius: that each colon's table is for [m].
            worlds: how many.
            widths: of each colon's lumen, at its stations [m], for `burden`.

        Raises:
            InvalidOptionError: when a colon's segments are not the usual ones.
        """
        assert options.gas is not None
        self.set_point, self._flow, self._start = options.gas, options.gas_flow, options.gas_start
        self._start_depth, self._water = options.start_depth, options.water
        self._lumens = _lumens_of(colons, list(stations), widths)
        self._device, self._bursting = np.asarray(device_radius, float), np.array([*map(bursting_pressure, SEGMENTS)])
        self._case, self._tip, self._due = np.zeros(worlds, int), np.zeros(worlds, int), np.zeros(worlds)
        self.pressure_peak: Float[np.ndarray, " worlds"] = np.zeros(worlds)
        """Highest pressure of any segment since the world began [Pa]."""
        self.tissue_stiffness: Float[np.ndarray, " worlds"] = np.full(worlds, float(options.wall_stiffness))
        """Stiffness of a contact with the wall where nothing makes it taut [N/m]."""
        self.asked: Float[np.ndarray, " worlds"] = np.full(worlds, np.nan)
        """Flow that hands ask for at standard pressure [m^3/s], negative to suck; the insufflator's where NaN."""
        self._sought: Float[np.ndarray, " worlds"] = np.zeros(worlds)
        """What they have asked for since the gas last moved [m^3]."""
        self.pouring: Float[np.ndarray, " worlds"] = np.zeros(worlds)
        """Flow of water that hands let in [m^3/s]."""
        self.rows: list[tuple] | None = None
        """Numbers of `GasRecord` of the first world after every advance; None: nobody keeps them."""
        for colon in colons if self._water else ():
            require_room(colon, self._water)
        everyone, own = np.arange(worlds), [*self._lumens.person, self._lumens.full, self._lumens.given]
        self._persons: Float[np.ndarray, "colons numbers"] = _beside(own)
        state = self._begun(everyone)
        sizes, changing = tuple(map(_size, own)), tuple(map(_size, state))
        self._law, self._columns = row_law(_moved_on, (*sizes, *changing, *[None] * len(_STEPPED))), _columns(changing)
        self._moved: Float[np.ndarray, "worlds told"] = _beside([*state, np.ones((worlds, _TOLD))])
        self.begin(everyone, self._case, self.tissue_stiffness)

    def begin(
        self,
        worlds: Int[np.ndarray, " begun"],
        case: Int[np.ndarray, " begun"],
        tissue_stiffness: Float[np.ndarray, " begun"],
    ) -> None:
        """Fill some worlds anew.

        Args:
            worlds: which.
            case: the colons that they have now.
            tissue_stiffness: of their walls [N/m].
        """
        self._put(worlds, _case=case, tissue_stiffness=tissue_stiffness, _due=0.0, _sought=0.0, pressure_peak=-np.inf)
        self._step(worlds, np.full(len(worlds), self._start_depth), _beside(self._begun(worlds)))

    def advance(
        self, tip_arc: Float[np.ndarray, " worlds"], seconds: Float[np.ndarray, " worlds"]
    ) -> Int[np.ndarray, " moved"]:
        """Let gas in where the tips are, and let it move; says in which worlds wall and stiffness are others now.

        Args:
            tip_arc: arc length of the tip in each world [m].
            seconds: how long, in each.
        """
        self._due, self._sought = self._due + seconds, self._sought + self.asked * seconds
        moving = np.flatnonzero(self._due > INTERVAL * (1 - 1e-9))
        if len(moving):
            self._step(moving, tip_arc[moving], self._moved[moving, :-_TOLD])
        if self.rows is not None:
            given, water = float(self.state.given[0]), float(self.water[0].sum())
            self.rows.append((self.pressure[0], self.volume[0], given, water, self._share[0].copy()))
        return moving

    def _step(self, worlds: np.ndarray, tip_arc: np.ndarray, state: Float[np.ndarray, "some numbers"]) -> None:
        """Move the gas of some worlds, which is in that state, for the time that is due."""
        case, row = self._case[worlds], np.arange(len(worlds))
        lumens = self._lumens
        station = np.ceil(np.nan_to_num(tip_arc) / lumens.step[case]).clip(0, lumens.number.shape[1] - 1)
        tip = lumens.number[case, station.astype(int)]
        pressure = self._apart(state).pressure
        insufflated, sought, due = (
            self._flow * (pressure[row, tip] < self.set_point),
            self._sought[worlds],
            self._due[worlds],
        )
        flow = np.where(np.isnan(sought), insufflated, sought / np.maximum(due, 1e-9))
        told = self._law(_beside([self._persons[case], state, flow, tip, due, self.pouring[worlds]]))
        peak = np.maximum(self.pressure_peak[worlds], self._apart(told).pressure[:, :-1].max(axis=1))
        self._put(worlds, _due=0.0, _sought=0.0, _tip=tip, _moved=told, pressure_peak=peak)

    def _put(self, worlds: np.ndarray, **values: Any) -> None:
        for name, value in values.items():
            setattr(self, name, _with(getattr(self, name), worlds, value))

    def _begun(self, worlds: np.ndarray) -> GasState:
        """Gas and water of some worlds at the start."""
        person = GasColon(*(part[self._case[worlds]] for part in self._lumens.person))
        state = filled(np, person, self._start)
        return with_water(np, person, state, self._water) if self._water else state

    @property
    def state(self) -> GasState:
        """Where the gas is."""
        return self._apart(self._moved)

    @property
    def volume(self) -> Float[np.ndarray, " worlds"]:
        """Volume of each colon's gas now [m^3]."""
        return self._moved[:, -2]

    @property
    def _share(self) -> Float[np.ndarray, "worlds segments"]:
        """Radius of each segment over that of the colon as it was given [1]."""
        return self._moved[:, -_TOLD:-2]

    def _apart(self, rows: Float[np.ndarray, "some numbers"]) -> GasState:
        """The state that rows begin with."""
        return GasState(*(rows[:, at] for at in self._columns))

    def stiffness(self, worlds: Int[np.ndarray, " some"]) -> Float[np.ndarray, " some"]:
        """Stiffness of a contact with the wall: the tissue's, and its tension's in the segment of the tip [N/m]."""
        case, tip = self._case[worlds], self._tip[worlds]
        radius = self._lumens.radius[case, tip] * self._share[worlds, tip]
        tension = wall_tension(np.maximum(self.state.pressure[worlds, tip], 0.0), radius)
        return self.tissue_stiffness[worlds] + tension_stiffness(np, tension, radius, self._device[case])

    def pressure_lost(self, worlds: Int[np.ndarray, " some"]) -> Float[np.ndarray, " some"]:
        """How much less gas thrusts the ends of colons apart than when they were imaged, over their area then [Pa]."""
        return self._moved[worlds, -1]

    def widths(self, worlds: Int[np.ndarray, " some"]) -> Float[np.ndarray, "some stations"]:
        """Width of the lumen at each station of the table, over that of the colon as it was given [1]."""
        return station_widths(self._lumens.weights[self._case[worlds]], self._share[worlds])

    def burden(self, worlds: Int[np.ndarray, " some"]) -> GasBurden:
        """What the walls of some worlds bear of gas alone."""
        case, row, own = self._case[worlds], np.arange(len(worlds)), self._lumens
        pressure, there = self.state.pressure[worlds, :-1], own.widest[case] > 0
        load = gas_load(pressure, self._bursting) * there
        hurts = pain(np, pressure * own.widest[case], 0.0)
        most, worst = load.argmax(axis=1), hurts.argmax(axis=1)
        arcs = own.first_arc[case, most], own.widest_arc[case, worst]
        return GasBurden(load[row, most], arcs[0], hurts[row, worst], arcs[1])

    @property
    def tip_pressure(self) -> Float[np.ndarray, " worlds"]:
        """Pressure in the segment of each tip when the gas last moved, over that of the atmosphere [Pa]."""
        return self.pressure[np.arange(len(self._tip)), self._tip]

    @property
    def pressure(self) -> Float[np.ndarray, "worlds segments"]:
        """Pressure of each segment now, over that of the atmosphere [Pa]."""
        return self.state.pressure[:, :-1]

    @property
    def water(self) -> Float[np.ndarray, "worlds segments"]:
        """Water in each segment now [m^3]."""
        return self.state.water

    def keep(self) -> dict[str, Any]:
        """Where the gas is, to go back to."""
        return {name: getattr(self, name) for name in _MOMENTARY}

    def put_back(self, kept: dict[str, Any]) -> None:
        """Go back to where the gas was."""
        for name, value in kept.items():
            setattr(self, name, value)


class RunGas:
    """The gas of a run, which is the only world: what is asked of it, and what was recorded."""

    def __init__(self, colon: Colon, worlds: GasWorlds, *, stations: int) -> None:
        """Begin a record.

        Args:
            colon: as it was given.
            worlds: its gas.
            stations: of the colon's table.
        """
        self.worlds, self._arcs = worlds, np.linspace(0.0, colon.centreline.length, stations)
        self._number = _numbers(segment_names(colon.segments, self._arcs))
        self._surface_arcs: Float[np.ndarray, " vertices"] | None = None
        self._rows = worlds.rows = []

    def advance(self, tip_arc: float, seconds: float) -> bool:
        """Let gas in where the tip is, and let it move; says whether wall and stiffness are others than before.

        Args:
            tip_arc: arc length of the tip [m].
            seconds: how long.
        """
        return bool(len(self.worlds.advance(np.array([tip_arc]), np.array([seconds]))))

    def ask(self, flow: float | None) -> None:
        """Let the hand ask for a flow at standard pressure [m^3/s], negative to suck; the insufflator when None."""
        self.worlds.asked = np.array([np.nan if flow is None else flow])

    def pour(self, flow: float) -> None:
        """Let the hand pour in water [m^3/s]."""
        self.worlds.pouring = np.array([flow])

    def soften(self, tissue_stiffness: float) -> None:
        """Set the stiffness of a contact with the wall where nothing makes it taut [N/m]."""
        self.worlds.tissue_stiffness = np.array([tissue_stiffness])

    @property
    def stiffness(self) -> float:
        """Stiffness of a contact with the wall: the tissue's, and its tension's in the segment of the tip [N/m]."""
        return float(self.worlds.stiffness(_ONLY)[0])

    @property
    def pressure_lost(self) -> float:
        """How much less gas thrusts the colon's ends apart than when it was imaged, over its area then [Pa]."""
        return float(self.worlds.pressure_lost(_ONLY)[0])

    @property
    def widths(self) -> Float[np.ndarray, " stations"]:
        """Width of the lumen at each station of the table, over that of the colon as it was given [1]."""
        return self.worlds.widths(_ONLY)[0]

    def segments_at(self, arcs: Float[np.ndarray, " places"]) -> Int[np.ndarray, " places"]:
        """Numbers of the segments at arc lengths [m], as columns of `GasRecord.pressure`."""
        return self._number[np.searchsorted(self._arcs[:-1], arcs)]

    def colon(self, colon: Colon) -> Colon:
        """A colon as wide as gas holds it now, wherever it has moved to."""
        if self._surface_arcs is None:
            self._surface_arcs = surface_arcs(colon)
        return widened(colon, self._surface_arcs, self.widths)

    @property
    def pressure(self) -> Float[np.ndarray, " segments"]:
        """Pressure of each segment now, over that of the atmosphere [Pa]."""
        return self.worlds.pressure[0]

    @property
    def volume(self) -> float:
        """Volume of the colon's gas now [m^3]."""
        return float(self.worlds.volume[0])

    @property
    def water(self) -> Float[np.ndarray, " segments"]:
        """Water in each segment now [m^3]."""
        return self.worlds.water[0]

    def forget(self) -> None:
        """Drop what was recorded: nobody asks for it of a run without end."""
        self._rows.clear()

    def record(self, count: int) -> GasRecord:
        """The first so many rows."""
        rows = self._rows[:count]
        if not rows:
            none = np.zeros((0, len(SEGMENTS)))
            return GasRecord(none, np.zeros(0), np.zeros(0), np.zeros(0), none)
        return GasRecord(*(np.array(column) for column in zip(*rows, strict=True)))


_ONLY = np.zeros(1, int)


def run_gas(colon: Colon, options: SceneOptions, *, stations: int, device_radius: float) -> RunGas:
    """The gas of one colon whose table has so many stations, for a device of that radius [m].

    Raises:
        InvalidOptionError: when the colon's segments are not the usual ones.
    """
    worlds = GasWorlds([colon], options, stations=[stations], device_radius=np.array([device_radius]))
    return RunGas(colon, worlds, stations=stations)


def widened(colon: Colon, arcs: Float[np.ndarray, " vertices"], widths: Float[np.ndarray, " stations"]) -> Colon:
    """A colon whose lumen is so wide, wherever it has moved to.

    Args:
        colon: where it is.
        arcs: arc length of each vertex [m].
        widths: at even arc lengths from its beginning to its end, over that of the colon as it was given [1].
    """
    line = colon.centreline
    even = np.linspace(0.0, line.length, len(widths))
    middle = np.stack([np.interp(arcs, line.arc, line.points[:, axis]) for axis in range(3)], axis=1)
    vertices = middle + (colon.lumen.vertices - middle) * np.interp(arcs, even, widths)[:, None]
    radius = colon.radius * np.interp(line.arc, even, widths)[:, None]
    return replace(colon, lumen=Surface(vertices, colon.lumen.faces), radius=radius)


def station_widths(
    weights: Float[np.ndarray, "*worlds stations segments"], share: Float[np.ndarray, "*worlds segments"]
) -> Float[np.ndarray, "*worlds stations"]:
    """Width of the lumen at stations, over that of the colon as it was given [1].

    Args:
        weights: what each segment has to say at each station (`segment_weights`).
        share: radius of each segment over that of the colon as it was given [1].
    """
    return 1 + (weights @ (share - 1)[..., None])[..., 0]


def segment_weights(colon: Colon, stations: int) -> Float[np.ndarray, "stations segments"]:
    """What each segment has to say of the width at so many even stations [1]; nobody has any in the anal canal."""
    arcs = np.linspace(0.0, colon.centreline.length, stations)
    inside = _numbers(segment_names(colon.segments, arcs))[:, None] == np.arange(len(SEGMENTS))
    held = inside & (arcs > ANAL_CANAL)[:, None]
    return gaussian_filter1d(held.astype(float), TAPER / arcs[1], axis=0, mode="nearest")


def gas_pressures(
    gas: RunGas | None, count: int, arcs: Float[np.ndarray, " places"]
) -> Float[np.ndarray, "records places"] | None:
    """Pressures at arc lengths [m], of the first so many rows [Pa]; None of a run without gas."""
    return gas and gas.record(count).pressure[:, gas.segments_at(arcs)]


def _moved_on(xp: Any, *given: Any) -> tuple[Any, ...]:
    """The state after a step, how wide each segment is then, what the colon holds and has lost; compiled."""
    person, (full, whole, *begun) = GasColon(*given[: len(GasColon._fields)]), given[len(GasColon._fields) :]
    state, inputs = begun[: len(GasState._fields)], dict(zip(_STEPPED, begun[len(GasState._fields) :], strict=True))
    state = step_gas(xp, person, GasState(*state), **inputs)
    pressure = state.pressure[..., :-1]
    share = xp.sqrt(filling(xp, person, pressure) / whole)
    lost = pressure_lost(xp, person, pressure, full=full[..., None])
    return *state, share, gas_volumes(xp, person, state).sum(-1), lost


def _size(part: np.ndarray) -> Size:
    return None if part.ndim == 1 else part.shape[1]


def _columns(sizes: Sequence[Size]) -> list[Any]:
    """Where parts of these sizes lie in a row."""
    ends = np.cumsum([size or 1 for size in sizes]).tolist()
    return [end - 1 if size is None else slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]


def _beside(parts: Sequence[np.ndarray]) -> Float[np.ndarray, "worlds numbers"]:
    """Numbers of worlds side by side."""
    return np.concatenate([part[:, None] if part.ndim == 1 else part for part in parts], axis=1)


def require_room(colon: Colon, water: float) -> None:
    """Refuse to begin with more water than rectum and sigmoid take at the pressure that hurts [m^3].

    Raises:
        InvalidOptionError: naming both volumes.
    """
    most = float(most_filled(np, _person_of(colon)))
    if water > most:
        raise InvalidOptionError(
            f"Water of {1e6 * water:.0f} mL hurts in colon '{colon.name}', whose rectum and sigmoid take "
            f"{1e6 * most:.0f} mL: give less."
        )


def _person_of(colon: Colon) -> GasColon:
    return typical_colon(segment_volumes(colon), pressure=opened_at(colon))


def _with(old: np.ndarray, worlds: np.ndarray, new: Any) -> np.ndarray:
    found = old.copy()
    found[worlds] = new
    return found


def _lumens_of(colons: Sequence[Colon], stations: list[int], widths: Sequence[np.ndarray] | None) -> _Lumens:
    most = max(stations)
    each = [
        _lumen_of(colon, count, most, np.zeros(count) if widths is None else widths[index])
        for index, (colon, count) in enumerate(zip(colons, stations, strict=True))
    ]
    person, *rest = zip(*each, strict=True)
    return _Lumens(GasColon(*map(np.stack, zip(*person, strict=True))), *map(np.stack, rest))


def _lumen_of(colon: Colon, stations: int, most: int, width: np.ndarray) -> tuple[Any, ...]:
    """A row of `_Lumens`."""
    if not colon.segments:
        raise InvalidOptionError(f"Gas asks for segments, which colon '{colon.name}' has none of: leave gas out.")
    volumes = segment_volumes(colon)
    pressure = opened_at(colon)
    person = typical_colon(volumes, pressure=pressure)
    given = filling(np, person, np.full(len(SEGMENTS), pressure))
    arcs = np.linspace(0.0, colon.centreline.length, stations)
    number = _numbers(segment_names(colon.segments, arcs))
    inside = number[:, None] == np.arange(len(SEGMENTS))
    weights = segment_weights(colon, stations)
    lengths = np.bincount(number, minlength=len(SEGMENTS)) * arcs[1]
    radius = np.sqrt(volumes / (np.pi * np.maximum(lengths, arcs[1])))
    wide = np.where(inside, width[:, None], 0.0)
    behind = (0, most - stations)
    number, weights = np.pad(number, behind, mode="edge"), np.pad(weights, (behind, (0, 0)))
    places = arcs[wide.argmax(axis=0)], arcs[inside.argmax(axis=0)]
    return person, pressure, given, radius, arcs[1], number, weights, wide.max(axis=0), *places


def _numbers(names: list[str]) -> Int[np.ndarray, " stations"]:
    if unknown := set(names) - set(SEGMENTS):
        raise InvalidOptionError(
            f"Gas knows no segment '{min(unknown)}': leave it out, or name segments {', '.join(SEGMENTS)}."
        )
    return np.array([SEGMENTS.index(name) for name in names])
