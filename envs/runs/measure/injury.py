"""What a scope does to the colon at each record of a run, and what is said of it at the end: tears, bleeding, pain."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.runs.measure.containment import lumen_widths
from haustra.envs.runs.measure.load import largest_load
from haustra.envs.runs.measure.progress import segment_at
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.state import Readings
from haustra.models.anatomy.colon import Colon
from haustra.models.injury.bleeding import PATCH, bleeds, mucosal_shear
from haustra.models.injury.pain import axis_tensions, pain, pressed_tension
from haustra.models.injury.perforation import (
    bursting_pressure,
    gas_load,
    perforation_probability,
    worst_load,
)
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import axis_tables
from haustra.models.wall.moving_colon import mesentery_extension

STATION_STEP = PATCH
"""Distance between the places along the colon at which it is recorded what it bears [m]."""


_FLEXURES = {"transverse": "splenic_flexure", "ascending": "hepatic_flexure"}
"""Where segments begin."""
_FLEXURE = 0.05
"""How far a flexure reaches to either side [m]; engineering choice."""


class Burden(NamedTuple):
    """What a colon bears, a row a record."""

    load: Float[np.ndarray, " records"]
    """Largest load of a place over the median person's strength [1]."""
    load_arc: Float[np.ndarray, " records"]
    """Arc length there [m]."""
    pressed: Float[np.ndarray, "records stations"]
    """Largest resultant wall force on one link next to each station [N]."""
    shear: Float[np.ndarray, "records stations"]
    """Largest shear of the mucosa there [Pa]."""
    pain: Float[np.ndarray, "records stations"]
    """Pain at each station [1] (`haustra.models.injury.pain`)."""
    mesentery_extension: Float[np.ndarray, " records"]
    """Farthest that the mesentery is drawn out beyond its slack [m]."""


class InjuryMeter:
    """Tells what readings of a scope mean for the colon it is in."""

    def __init__(self, scene: Scene) -> None:
        """For that scope in that colon."""
        colon = scene.colon
        self._diameter, self._tip_links = 2 * scene.cable.radius, scene.cable.tip_links
        self._lengths, self._friction = -np.diff(scene.cable.node_distances), scene.options.friction
        self.stations = stations_of(colon)
        width = lumen_widths(colon)
        self._radius = np.interp(self.stations, *width)
        self._bursting = np.array([bursting_pressure(segment_at(colon, arc)) for arc in self.stations])
        self._axis = axis_tables(colon, scene.options.abdomen).mesentery if scene.options.mesentery else None
        if self._axis is not None:
            self._node_arcs = float(self._axis.spacing) * np.arange(len(self._axis.nodes))
            self._node_radius = np.interp(self._node_arcs, *width)

    def measure(self, seen: Readings, pressure: Float[np.ndarray, "records stations"] | None = None) -> Burden:
        """What the colon bears.

        Args:
            seen: readings of several records in the scene's coordinates: `time`, `link_forces`, `link_arcs`, `bend`
                and `displacement` are used.
            pressure: of gas at each of `stations`, over that of the abdomen [Pa]; no gas when None.
        """
        load, arc = largest_load(np, seen, tip_links=self._tip_links, diameter=self._diameter, lengths=self._lengths)
        forces, patch = np.where(seen.link_arcs > 0, seen.link_forces, 0.0), (self._diameter, self._lengths)
        each = forces, mucosal_shear(forces, self._friction, *patch), pressed_tension(forces, *patch)
        pressed, shear, wall = (at_stations(values, seen.link_arcs, len(self.stations)) for values in each)
        mesentery, extension = np.zeros_like(wall), np.zeros(len(wall))
        if self._axis is not None:
            extension = mesentery_extension(np, self._axis, seen.displacement, seen.time).max(axis=-1)
            along, held = axis_tensions(np, self._axis, seen.displacement, self._node_radius, seen.time)
            along, mesentery = (at_stations(part, self._node_arcs, len(self.stations)) for part in (along, held))
            wall = np.maximum(wall, along)
        if pressure is not None:
            gas = gas_load(pressure, self._bursting)
            most = gas.max(axis=1)
            load, arc = np.maximum(load, most), np.where(most > load, self.stations[gas.argmax(axis=1)], arc)
            wall = np.maximum(wall, pressure * self._radius)
        return Burden(load, arc, pressed, shear, pain(np, wall, mesentery), extension)


def at_stations(
    values: Float[np.ndarray, "records places"], arcs: Float[np.ndarray, "*records places"], stations: int
) -> Float[np.ndarray, "records stations"]:
    """The largest of values at arc lengths [m] next to each of that many stations; 0 where there is none."""
    found = np.zeros((len(values), stations))
    beside = np.clip(np.rint(arcs / STATION_STEP), 0, stations - 1).astype(int)
    np.maximum.at(found, (np.arange(len(values))[:, None], beside), values)
    return found


def stations_of(colon: Colon) -> Float[np.ndarray, " stations"]:
    """Arc lengths of the places at which it is recorded what a colon bears [m]."""
    return STATION_STEP * np.arange(int(np.ceil(colon.centreline.length / STATION_STEP)) + 1)


def perforation_scores(load: float, arc: float, colon: Colon) -> dict[str, object]:
    """Share of people whose colon would have been perforated, and where that was.

    Args:
        load: largest load over strength of a run [1]; 0 of one that never touched the wall.
        arc: arc length there [m].
        colon: the colon.
    """
    touched = load > 0
    return {
        "p_perforation": float(perforation_probability(load)),
        "perforation_site": segment_at(colon, arc) if touched else "none",
        "perforation_arc_m": float(arc) if touched else None,
    }


def injury_scores(burden: Burden, outcome: Outcome, colon: Colon, *, interval: float) -> dict[str, object]:
    """Scores of what a colon bore in a run, as plain JSON values.

    `p_perforation` is the share of people whose colon would have been perforated, at `perforation_site`; a run that
    ended as escaped has torn everybody's. `bleeding_places` counts places of two centimetres whose mucosa was sheared
    by more than the assumed threshold, `bleeding_by_site` by segment. `pain_peak` is the largest tension of wall or
    mesentery over that which is assumed to hurt, `pain_s` how long any place was above it, `pain_by_site` the peak by
    segment, and within five centimetres of the flexures. `mesentery_extension_peak_mm` is the farthest that the
    mesentery was drawn out beyond its slack.

    Args:
        burden: what was recorded.
        outcome: how the run ended.
        colon: the colon.
        interval: between records [s].
    """
    shear = burden.shear.max(axis=0, initial=0.0)
    bleeding, peak = bleeds(shear), burden.pain.max(axis=0, initial=0.0)
    of = np.array([segment_at(colon, arc) for arc in stations_of(colon)])
    names = [segment.name for segment in colon.segments]
    return {
        **perforation_scores(*_worst(burden, outcome), colon),
        "bleeding_places": int(bleeding.sum()),
        "bleeding_by_site": {name: int(bleeding[of == name].sum()) for name in names},
        "mucosal_shear_peak_kPa": float(shear.max()) / 1e3,
        "pain_peak": float(peak.max()),
        "pain_s": float((burden.pain.max(axis=1, initial=0.0) > 1).sum() * interval),
        "pain_by_site": by_site(peak, colon),
        "mesentery_extension_peak_mm": 1e3 * float(burden.mesentery_extension.max(initial=0.0)),
    }


def by_site(peak: Float[np.ndarray, " stations"], colon: Colon) -> dict[str, float]:
    """The largest of what stations bear, by segment, and within five centimetres of the flexures."""
    return {name: float(peak[there].max(initial=0.0)) for name, there in _sites(colon).items()}


def _sites(colon: Colon) -> dict[str, Bool[np.ndarray, " stations"]]:
    """Which stations belong to each segment, and to each flexure."""
    arcs = stations_of(colon)
    of = np.array([segment_at(colon, arc) for arc in arcs])
    borders = {flexure: segment.start for segment in colon.segments if (flexure := _FLEXURES.get(segment.name))}
    segments = {segment.name: of == segment.name for segment in colon.segments}
    return segments | {name: np.abs(arcs - border) <= _FLEXURE for name, border in borders.items()}


def _worst(burden: Burden, outcome: Outcome) -> tuple[float, float]:
    """Largest load over strength of a run, and where; an escape is seen at the last record."""
    load, arc = burden.load, burden.load_arc
    if not len(load):
        return 0.0, 0.0
    worst = int(load.argmax())
    found = worst_load(np, (load[worst], arc[worst]), load[-1], arc[-1], outcome is Outcome.ESCAPED)
    return float(found[0]), float(found[1])
