"""Gas in one run: let in at the tip, it sets how wide the lumen is and how stiff its wall."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.landmarks import SEGMENTS, segment_names
from haustra.models.gas.compartments import filled, filling, gas_volumes, segment_volumes, step_gas, typical_colon
from haustra.models.gas.law import tension_stiffness, wall_tension
from haustra.models.gas.numbers import gas_numbers
from haustra.models.scene import SceneOptions
from haustra.models.wall.lumen_table import put_distended
from haustra.models.wall.signed_distance import surface_arcs

TAPER = 0.01
"""Standard deviation of the arc length over which the width of one segment goes over into the next's [m]."""
ANAL_CANAL = 0.04
"""Length behind the anus that the scope holds open, not gas [m]: Ellis, Clinical Anatomy."""
LEAST_CHANGE = 1e-3
"""The wall is moved when the share of its width changed by this [1]: 0.02 mm of its radius."""
INTERVAL = 0.1
"""Time between two steps of the gas [s]: it fills a colon in minutes."""

_MOMENTARY = ("_state", "_due", "_volume", "_shares", "widths", "_placed", "_tip", "asked", "tissue_stiffness")
"""What of a run's gas changes; each value is replaced, never written into."""


class GasRecord(NamedTuple):
    """What was recorded of gas after every decision."""

    pressure: Float[np.ndarray, "records segments"]
    """Pressure of each segment, over that of the atmosphere [Pa]."""
    volume: Float[np.ndarray, " records"]
    """Volume of the colon's gas [m^3]."""
    given: Float[np.ndarray, " records"]
    """Let in through the scope so far, at standard pressure [m^3]."""


class RunGas:
    """The gas of one colon, of a typical person, in which a scope lets in gas up to a set point."""

    def __init__(
        self,
        colon: Colon,
        options: SceneOptions,
        wall: Float[np.ndarray, "stations angles 4"],
        *,
        device_radius: float,
    ) -> None:
        """Fill the colon to the pressure at the start.

        Args:
            colon: as it was given.
            options: name the set point.
            wall: table of the colon's wall as it was given, `haustra.models.wall.lumen_table.Tables.wall`.
            device_radius: that the table is for [m].

        Raises:
            InvalidOptionError: when the colon's segments are not the usual ones.
        """
        line = colon.centreline
        assert options.gas is not None
        self._set_point, self._flow, self._device = options.gas, options.gas_flow, device_radius
        self.tissue_stiffness = options.wall_stiffness
        """Stiffness of a contact with the wall where nothing makes it taut [N/m]."""
        volumes = segment_volumes(colon)
        own = colon.provenance.configuration.get("pressure")  # what it was grown at
        given = own if isinstance(own, int | float) else gas_numbers()["full_pressure"]
        self._person = typical_colon(volumes, pressure=given)
        self._given = filling(np, self._person, np.full(len(SEGMENTS), float(given)))
        self._state = filled(np, self._person, options.gas_start)
        self._arcs = np.linspace(0.0, line.length, len(wall))
        self._number = _numbers(segment_names(colon.segments, self._arcs))
        inside = (self._number[:, None] == np.arange(len(SEGMENTS))) & (self._arcs > ANAL_CANAL)[:, None]
        self._weights = gaussian_filter1d(inside.astype(float), TAPER / self._arcs[1], axis=0, mode="nearest")
        lengths = np.bincount(self._number, minlength=len(SEGMENTS)) * self._arcs[1]
        self._radius = np.sqrt(volumes / (np.pi * np.maximum(lengths, self._arcs[1])))
        self._rest, self._placed = np.array(wall, float), np.zeros(len(wall))
        self._surface_arcs: Float[np.ndarray, " vertices"] | None = None
        self.asked: float | None = None
        """Flow that the hand asks for at standard pressure [m^3/s], negative to suck; the insufflator's when None."""
        self._due = 0.0
        self.widths: Float[np.ndarray, " stations"]
        """Width of the lumen at each station of the table, over that of the colon as it was given [1]."""
        self._step(options.start_depth)
        self._rows: list[tuple] = []

    def advance(self, tip_arc: float, seconds: float) -> bool:
        """Let gas in where the tip is, and let it move; says whether wall and stiffness are others than before.

        Args:
            tip_arc: arc length of the tip [m].
            seconds: how long.
        """
        self._due += seconds
        moves = self._due > INTERVAL * (1 - 1e-9)
        if moves:
            self._step(tip_arc)
        self._rows.append((self._state.pressure[:-1], self._volume, float(self._state.given)))
        return moves

    def _step(self, tip_arc: float) -> None:
        """Move the gas for the time that is due."""
        self._tip = int(self.segments_at(np.array([tip_arc]))[0])
        flow = self.asked
        if flow is None:
            flow = self._flow * float(self._state.pressure[self._tip] < self._set_point)
        self._state = step_gas(np, self._person, self._state, flow=flow, place=self._tip, timestep=self._due)
        self._due, self._volume = 0.0, float(gas_volumes(np, self._person, self._state).sum())
        share = np.sqrt(filling(np, self._person, self._state.pressure[:-1]) / self._given)
        self._shares, self.widths = share, 1 + self._weights @ (share - 1)

    @property
    def stiffness(self) -> float:
        """Stiffness of a contact with the wall: the tissue's, and its tension's in the segment of the tip [N/m]."""
        radius = float(self._radius[self._tip] * self._shares[self._tip])
        tension = wall_tension(max(float(self._state.pressure[self._tip]), 0.0), radius)
        return self.tissue_stiffness + tension_stiffness(np, tension, radius, self._device)

    def segments_at(self, arcs: Float[np.ndarray, " places"]) -> Int[np.ndarray, " places"]:
        """Numbers of the segments at arc lengths [m], as columns of `GasRecord.pressure`."""
        return self._number[np.searchsorted(self._arcs[:-1], arcs)]

    def place(self, wall: Float[np.ndarray, "stations angles 4"], *, anew: bool = False) -> None:
        """Put a table's wall where gas holds it; `anew` when the table is another one."""
        widths = self.widths
        if anew or np.abs(widths - self._placed).max() > LEAST_CHANGE:
            put_distended(wall, self._rest, widths, device_radius=self._device)
            self._placed = widths

    def colon(self, colon: Colon) -> Colon:
        """A colon as wide as gas holds it now, wherever it has moved to."""
        line, widths = colon.centreline, self.widths
        if self._surface_arcs is None:
            self._surface_arcs = surface_arcs(colon)
        arcs = self._surface_arcs
        middle = np.stack([np.interp(arcs, line.arc, line.points[:, axis]) for axis in range(3)], axis=1)
        share = np.interp(arcs, self._arcs, widths)[:, None]
        vertices = middle + (colon.lumen.vertices - middle) * share
        radius = colon.radius * np.interp(line.arc, self._arcs, widths)[:, None]
        return replace(colon, lumen=Surface(vertices, colon.lumen.faces), radius=radius)

    @property
    def pressure(self) -> Float[np.ndarray, " segments"]:
        """Pressure of each segment now, over that of the atmosphere [Pa]."""
        return self._state.pressure[:-1]

    @property
    def volume(self) -> float:
        """Volume of the colon's gas now [m^3]."""
        return self._volume

    def forget(self) -> None:
        """Drop what was recorded: nobody asks for it of a run without end."""
        self._rows.clear()

    def keep(self) -> dict[str, Any]:
        """Where the gas is, to go back to."""
        return {name: getattr(self, name) for name in _MOMENTARY}

    def put_back(self, kept: dict[str, Any]) -> None:
        """Go back to where the gas was."""
        for name, value in kept.items():
            setattr(self, name, value)

    def record(self, count: int) -> GasRecord:
        """The first so many rows."""
        rows = self._rows[:count]
        if not rows:
            return GasRecord(np.zeros((0, len(SEGMENTS))), np.zeros(0), np.zeros(0))
        return GasRecord(*(np.array(column) for column in zip(*rows, strict=True)))


def gas_pressures(
    gas: RunGas | None, count: int, arcs: Float[np.ndarray, " places"]
) -> Float[np.ndarray, "records places"] | None:
    """Pressures at arc lengths [m], of the first so many rows [Pa]; None of a run without gas."""
    return gas and gas.record(count).pressure[:, gas.segments_at(arcs)]


def _numbers(names: list[str]) -> Int[np.ndarray, " stations"]:
    if unknown := set(names) - set(SEGMENTS):
        raise InvalidOptionError(
            f"Gas knows no segment '{min(unknown)}': leave it out, or name segments {', '.join(SEGMENTS)}."
        )
    return np.array([SEGMENTS.index(name) for name in names])
