"""Landmarks and segments from the course of the centreline in the patient's body."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from haustra.errors import InvalidMeshError, InvalidOptionError
from haustra.models.anatomy.colon import Centreline, ColonSegment

SEGMENTS = ("rectum", "sigmoid", "descending", "transverse", "ascending", "caecum")
"""From anus to caecum."""
BORDERS = ("rectosigmoid_junction", "descending_sigmoid_junction", "splenic_flexure", "hepatic_flexure", "caecum")
"""Landmark between each segment and the next."""
VALVE = "ileocaecal_valve"
"""A landmark that is never found, only given: the caecum begins at it."""
LARGEST_DISTANCE = 0.08
"""A landmark farther than this [m] from the centreline is a mistake: the widest caecum is 0.09 m across."""
LARGEST_GAP = 0.05
"""A landmark farther than this [m] from the surface is in other units, or of another patient: an anal canal that the
surface leaves out is 0.03 to 0.05 m long."""
VALVE_NOTE = "The caecum's border is its usual share of the length: the surface shows no valve."
USUAL_SHARE = {
    "rectosigmoid_junction": 0.09,
    "descending_sigmoid_junction": 0.32,
    "splenic_flexure": 0.53,
    "hepatic_flexure": 0.83,
    "caecum": 0.955,
}
"""Usual place as a share of the whole length: the means of assets/numbers/anatomy.toml, added up and rounded."""
RECTUM_WINDOW = (0.10, 0.20)
"""The rectosigmoid junction lies in this stretch [m]: about 0.15 m from the anal verge."""
RECTUM_USUAL = 0.15
"""Where it is taken to be when the lumen does not narrow [m]."""
NARROWING = 0.8
"""The rectum ends where the diameter falls below this share over 30 mm."""
RISE = 0.015
"""The descending colon ends distally where the course climbs again by this much [m]."""
OPPOSITE = 0.5
"""Share of the breadth by which the flexures stand apart; more says nothing about where they turn."""
FLEXURE_SPREAD = 0.09
"""Standard deviation of a flexure's share of the length, for weighing height against it."""
CAECUM_SHARE = 0.045
"""Caecum below the ileocaecal valve, share of the whole length."""


@dataclass(frozen=True)
class Landmarks:
    """Arc length of named places [m], and what a user should know about them."""

    places: Mapping[str, float]
    notes: tuple[str, ...]


def find_landmarks(line: Centreline, diameter: Float[np.ndarray, " stations"]) -> Landmarks:
    """Find the borders of the segments; z is up in the patient (as in RAS and LPS), diameters in [m].

    The flexures are the pair of places that stand highest on opposite sides, weighed against their usual
    share of the length. The descending colon ends where the course, followed down from the splenic flexure, turns up
    again. The rectum ends where the lumen narrows most within `RECTUM_WINDOW`. The ileocaecal valve leaves no mark on
    a lumen surface, so the caecum is the usual share of the length.
    """
    length, notes = line.length, [VALVE_NOTE]
    splenic, hepatic, standing = _flexures(line)
    if not standing:
        notes.append("The flexures do not stand out in height (is z up?): segments are usual shares of the length.")
        places = {name: share * length for name, share in USUAL_SHARE.items()}
        return Landmarks({"anus": 0.0, **places}, tuple(notes))
    junction, rising = _foot_of_descending(line, splenic)
    if not rising:
        notes.append("The sigmoid's upper end does not turn: it is taken at its usual share of the length.")
    places = {
        "anus": 0.0,
        "rectosigmoid_junction": _rectum_end(line, diameter, junction),
        "descending_sigmoid_junction": junction,
        "splenic_flexure": float(line.arc[splenic]),
        "hepatic_flexure": float(line.arc[hepatic]),
        "caecum": length * (1 - CAECUM_SHARE),
    }
    return Landmarks(places, tuple(notes))


def landmark_positions(
    places: Mapping[str, tuple[float, float, float]], transform: Float[np.ndarray, "3 3"]
) -> dict[str, Float[np.ndarray, "3"]]:
    """Positions [m] of named landmarks from a file's coordinates.

    Raises:
        InvalidOptionError: when a name is not known or a position is not three finite numbers.
    """
    known = ("anus", *BORDERS, VALVE)
    positions = {}
    for name, place in places.items():
        if name not in known:
            raise InvalidOptionError(f"Landmark '{name}' is not known. Known: {', '.join(known)}.")
        position = np.asarray(place, dtype=float)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise InvalidOptionError(f"The position of the {name} must be three finite numbers.")
        positions[name] = transform @ position
    if "caecum" in positions and VALVE in positions:
        raise InvalidOptionError(f"The caecum begins at the {VALVE}: give one of the two.")
    return positions


def require_near(
    positions: Mapping[str, Float[np.ndarray, "3"]],
    vertices: Float[np.ndarray, "vertices 3"],
    other_units: Mapping[str, float],
) -> None:
    """Refuse landmarks that are not near the surface.

    Args:
        positions: of the landmarks [m].
        vertices: of the surface [m].
        other_units: names of units in which positions may be by mistake, and what to multiply them with if so.

    Raises:
        InvalidMeshError: naming the landmark, its distance, and the unit that it is probably in.
    """
    if not positions:
        return
    tree = KDTree(vertices)
    for name, position in positions.items():
        distance = float(tree.query(position)[0])
        if distance <= LARGEST_GAP:
            continue
        likely = [unit for unit, scale in other_units.items() if tree.query(position * scale)[0] <= LARGEST_GAP]
        advice = f"it is probably in {likely[0]}" if likely else "check its coordinates and units"
        raise InvalidMeshError(
            f"The given {name} is {distance:.3g} m from the surface, more than {LARGEST_GAP} m: {advice}."
        )


def with_places(found: Landmarks, line: Centreline, positions: Mapping[str, Float[np.ndarray, "3"]]) -> Landmarks:
    """Landmarks that were found, overridden by given positions [m] at the station nearest to each.

    Raises:
        InvalidMeshError: when a position is far from the colon, or the borders no longer follow each other.
    """
    places, notes = dict(found.places), list(found.notes)
    for name, position in positions.items():
        if name == "anus":
            continue  # it decided where the centreline begins
        distance = np.linalg.norm(line.points - position, axis=1)
        if distance.min() > LARGEST_DISTANCE:
            raise InvalidMeshError(
                f"The given {name} is {distance.min() * 1e3:.0f} mm from the centreline: "
                "check its coordinates and units."
            )
        places[name] = float(line.arc[int(distance.argmin())])
    if VALVE in positions:
        places["caecum"] = places[VALVE]
    if {"caecum", VALVE} & positions.keys():
        notes.remove(VALVE_NOTE)
    order = [0.0, *(places[name] for name in BORDERS), line.length]
    if any(after <= before for before, after in pairwise(order)):
        along = ", ".join(f"{name} {places[name]:.2f} m" for name in BORDERS)
        raise InvalidMeshError(
            f"The landmarks do not follow each other from anus to caecum: {along}. Check those given."
        )
    return Landmarks(places, tuple(notes))


def segments_between(places: Mapping[str, float], length: float) -> tuple[ColonSegment, ...]:
    """Segments without gaps from the places of their borders [m]."""
    borders = [0.0, *(places[name] for name in BORDERS), length]
    return tuple(ColonSegment(name, borders[i], borders[i + 1]) for i, name in enumerate(SEGMENTS))


def segment_names(segments: tuple[ColonSegment, ...], arc: Float[np.ndarray, " stations"]) -> list[str]:
    """Name of the segment at each arc length [m]."""
    index = np.searchsorted([segment.end for segment in segments[:-1]], arc, side="right")
    return [segments[i].name for i in index]


def _flexures(line: Centreline) -> tuple[int, int, bool]:
    """Stations of the splenic and hepatic flexure, and whether they stand out above the course between and around."""
    share = line.arc / line.length
    height = (line.points[:, 2] - line.points[:, 2].min()) / np.ptp(line.points[:, 2])
    side = line.points[:, 0] / np.ptp(line.points[:, 0])
    coarse = np.arange(0, len(share), 3)
    first = coarse[(share[coarse] > 0.35) & (share[coarse] < 0.72)]
    second = coarse[(share[coarse] > 0.65) & (share[coarse] < 0.95)]
    usual = [(USUAL_SHARE[name], FLEXURE_SPREAD) for name in ("splenic_flexure", "hepatic_flexure")]
    penalty = [((share - mean) / spread) ** 2 / 8 for mean, spread in usual]
    score = (height - penalty[0])[first, None] + (height - penalty[1])[None, second]
    score = score + np.minimum(np.abs(side[first, None] - side[None, second]), OPPOSITE)
    score[share[second][None, :] - share[first][:, None] < 0.12] = -np.inf
    i, j = np.unravel_index(int(np.argmax(score)), score.shape)
    splenic, hepatic = int(first[i]), int(second[j])
    standing = height[splenic] > 0.6 and height[hepatic] > 0.4 and height[splenic] > height[share < 0.2].max()
    return splenic, hepatic, bool(standing)


def _foot_of_descending(line: Centreline, splenic: int) -> tuple[float, bool]:
    """Arc length where the course, followed from the splenic flexure towards the anus, first climbs by `RISE`."""
    low, high = 0.18 * line.length, line.arc[splenic] - 0.08 * line.length
    stations = np.flatnonzero((line.arc > low) & (line.arc < high))[::-1]
    height = line.points[stations, 2]
    lowest = np.minimum.accumulate(height)
    climbed = np.flatnonzero(height > lowest + RISE)
    if len(climbed) == 0:
        share = USUAL_SHARE["descending_sigmoid_junction"] / USUAL_SHARE["splenic_flexure"]
        return share * float(line.arc[splenic]), False
    return float(line.arc[stations[int(np.argmin(height[: climbed[0]]))]]), True


def _rectum_end(line: Centreline, diameter: Float[np.ndarray, " stations"], limit: float) -> float:
    """Arc length in `RECTUM_WINDOW` where the diameter falls most over 30 mm, or the usual one."""
    step = float(line.arc[1])
    half = max(round(0.015 / step), 1)
    ratio = np.ones_like(diameter)
    ratio[half:-half] = diameter[2 * half :] / diameter[: -2 * half]
    window = np.flatnonzero((line.arc >= RECTUM_WINDOW[0]) & (line.arc <= min(RECTUM_WINDOW[1], 0.8 * limit)))
    if len(window) and ratio[window].min() < NARROWING:
        return float(line.arc[window[int(np.argmin(ratio[window]))]])
    return min(RECTUM_USUAL, 0.5 * limit)
