"""The course of a grown colon through the abdomen: a chain of fixed length that finds room for itself.

Axes as in DICOM patient coordinates: x to the patient's left, y to the back, z up; the anus is near the origin.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from inspect import unwrap
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicSpline, PchipInterpolator

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.frames import arc_length, curvature, resample, smooth
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.recipe import ColonRecipe
from haustra.models.anatomy.tortuosity import acute_flexures

LINK = 5e-3
"""Length of the chain's links [m]: an eighth of a flexure's radius."""
ROUNDS = 600
"""Relaxation rounds; lengths, bends and room change by less than 1 % in the last hundred."""
SWEEPS = 8
"""Times in each round that bends and links are brought to their bounds."""
HOMING = 0.004
"""Share of the way back to its anatomical place that each point goes in the first round, fading to none..."""
HOMING_SHARE = 0.6
"""... over this share of the rounds; then only bends, links and room matter."""
LOOK_ROUND = 10
"""Rounds between looks for parts that are near to each other..."""
LOOK_ROUND_ROOM = 0.02
"""... within this much [m], more than anything moves in between."""
DRAFT_SMOOTHING = 0.025
"""Standard deviation by which the draft is smoothed [m]: rounds its corners to about a flexure's radius."""
STRIDES = (1, 4)
"""Links on either side over which a bend is measured: the longer ones carry corrections across a flexure."""
GAP_MARGIN, BEND_MARGIN, OUTER_MARGIN = 1.2, 1.15, 1.4
"""Room and radius of curvature are aimed this much above what is needed, since relaxation stops short of it: the
room, the flexure's radius, and the radius of curvature over the lumen's."""
ENOUGH_ROOM = 0.9
"""A course is taken when its gap and its bends reach this share of what the recipe asks."""
RECTAL_FADE = 0.05
"""The slow widening sets in over this length [m] above the anal canal."""
NEAR_AHEAD = 2.2
"""Points are neighbours along the colon, not across, within this many times their two radii."""
SWAY, SWAY_PER_FLEXURE = 0.009, 5.7e-3
"""Standard deviation of the course about its usual places [m] that gives `PLAIN` flexures a metre, and how much more of
it gives one more a metre; measured on six colons, and only the first guess."""
PLAIN = 2.8
"""Acute flexures a metre of a hardly swaying course."""
SWAY_LIMITS = (0.003, 0.035)
"""Least and largest sway [m]."""
SWAY_WAVES, SWAY_TERMS = (0.12, 0.18), 3
"""Wavelengths of the sway [m], and how many of them add up."""
SWAY_LENGTH = 15.0
"""Share of the length by which loops are drafted shorter for a metre of sway, which itself takes length [1/m]."""
LOOSE_POINTS = 0.009
"""Standard deviation of the draft's points about their usual places [m]."""
ATTEMPTS = 6
"""Courses that are tried for one case before it is given up."""
TRIES = 4
"""Times the sway is corrected towards the flexures that are asked for."""
NEAR_ENOUGH = 0.75
"""Flexures more or fewer that are taken."""
Places: TypeAlias = tuple[tuple[float, float, float], ...]
SIGMOID_COURSES: dict[str, Places] = {
    "coiled": ((-0.035, 0.000, 0.125), (-0.045, -0.050, 0.115), (0.010, -0.070, 0.085), (0.065, -0.050, 0.105)),
    "omega": ((-0.020, 0.000, 0.140), (-0.005, -0.040, 0.185), (0.045, -0.055, 0.190), (0.090, -0.030, 0.160)),
}
"""Usual places of four points of the sigmoid [m]: coiled over the rectum, which it crosses as seen from the front in
most colons, or in one bow up from the rectum and down to the left, crossing it in a quarter; engineering choices."""
EXACT = 9
"""Decimals of a metre to which the draft is rounded. The relaxation only adds, multiplies, divides and takes roots,
which every machine does alike; sines and splines before it may differ in their last bits."""
BULGE = 1.15
"""Outside of the haustra over the mean radius."""


@dataclass(frozen=True)
class Course:
    """Axis of a grown colon."""

    points: Float[np.ndarray, "points 3"]
    """Positions [m], about `LINK` apart."""
    gap: float
    """Smallest room between the lumens of parts that are not neighbours along the colon [m]."""
    radius_of_curvature: float
    """Smallest radius of curvature [m]."""
    flexures: int
    """Acute flexures."""


@dataclass(frozen=True)
class Sway:
    """What chance decides about a course; the same sway can be laid with any strength."""

    points: tuple[Float[np.ndarray, "_ 3"], ...]
    """Unit offsets of the draft's points in sigmoid, descending, transverse and ascending colon."""
    waves: Float[np.ndarray, "terms 1 3"]
    """Wavelengths along the colon [m]."""
    phases: Float[np.ndarray, "terms 1 3"]
    """Their phases [rad]."""


def draw_sway(rng: np.random.Generator) -> Sway:
    """Draw what chance decides about a course."""
    return Sway(
        points=tuple(rng.standard_normal((count, 3)) for count in (4, 2, 4, 2)),
        waves=rng.uniform(*SWAY_WAVES, size=(SWAY_TERMS, 1, 3)),
        phases=rng.uniform(0, 2 * np.pi, size=(SWAY_TERMS, 1, 3)),
    )


def lay_course(recipe: ColonRecipe, rng: np.random.Generator, *, sigmoid: str = "coiled") -> Course:
    """Lay the axis with about as many flexures as the recipe asks, or as near to it as its length and room allow."""
    sway = draw_sway(rng)
    strength = SWAY + SWAY_PER_FLEXURE * (recipe.flexures / recipe.length - PLAIN)
    courses: list[Course] = []
    for _ in range(TRIES):
        strength = float(np.clip(strength, *SWAY_LIMITS))
        courses.append(_lay(recipe, sway, strength, SIGMOID_COURSES[sigmoid]))
        missing = recipe.flexures - courses[-1].flexures
        if abs(missing) <= NEAR_ENOUGH and is_free(courses[-1], recipe):
            break
        strength += SWAY_PER_FLEXURE * missing / recipe.length
    return min(courses, key=lambda course: (not is_free(course, recipe), abs(recipe.flexures - course.flexures)))


def lay_free_course(recipe: ColonRecipe, rng: np.random.Generator, *, sigmoid: str = "coiled") -> Course:
    """Lay courses until one has room between its loops and bends wide enough.

    Raises:
        InvalidMeshError: when none of `ATTEMPTS` has.
    """
    for _ in range(ATTEMPTS):
        course = lay_course(recipe, rng, sigmoid=sigmoid)
        if is_free(course, recipe):
            return course
    raise InvalidMeshError(f"No course without self-contact was found in {ATTEMPTS} attempts: take another seed.")


def is_free(course: Course, recipe: ColonRecipe) -> bool:
    """Whether the course has room between its loops and bends wide enough."""
    roomy = course.gap >= ENOUGH_ROOM * recipe.gap
    return bool(roomy and course.radius_of_curvature >= ENOUGH_ROOM * recipe.flexure_radius)


def _lay(recipe: ColonRecipe, sway: Sway, strength: float, sigmoid: Places) -> Course:
    """An anatomical draft, relaxed until it has its length, its bends and its room."""
    links = round(recipe.length / LINK)
    arc = np.linspace(0.0, recipe.length, links + 1)
    outer = np.round(BULGE * radius_along(recipe, arc), EXACT)
    draft = smooth(_draft(recipe, sway, arc, strength, sigmoid), DRAFT_SMOOTHING / LINK)
    home = np.round(draft + strength * _swaying(sway, arc), EXACT)
    points = resample(_relax(home, recipe, outer), LINK)
    points = points * (recipe.length / arc_length(points)[-1])  # wide bends leave the chain 1 to 2 % short
    return Course(
        points=points,
        gap=smallest_gap(points, BULGE * radius_along(recipe, np.linspace(0, recipe.length, len(points)))),
        radius_of_curvature=float(1 / curvature(points)[2:-2].max()),
        flexures=acute_flexures(points),
    )


def radius_along(recipe: ColonRecipe, arc: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
    """Mean radius [m] at each arc length: smooth between the middles of the segments, widening and narrowing slowly."""
    borders = recipe.borders()
    middles = [sum(borders[name]) / 2 for name in SEGMENTS]
    values = [recipe.diameters[name] / 2 for name in SEGMENTS]
    ampulla = np.array([0.25, 0.5, 0.85]) * borders["rectum"][1]
    places = [0.0, *ampulla, *middles[1:], recipe.length]
    radii = [recipe.anus_diameter / 2, 0.75 * values[0], values[0], values[0], *values[1:], values[-1]]
    waves = [share * np.sin(2 * np.pi * arc / wave + phase) for share, wave, phase in recipe.widenings]
    fading = np.clip((arc - ampulla[0]) / RECTAL_FADE, 0.0, 1.0)
    return PchipInterpolator(places, radii)(np.clip(arc, 0.0, recipe.length)) * (1 + fading * np.sum(waves, axis=0))


def smallest_gap(points: Float[np.ndarray, "points 3"], outer: Float[np.ndarray, " points"]) -> float:
    """Smallest room [m] between the outsides of parts that are not neighbours along the colon."""
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    room = distance - outer[:, None] - outer[None]
    return float(room[_across(outer)].min())


def _across(outer: Float[np.ndarray, " points"]) -> Bool[np.ndarray, "points points"]:
    index = np.arange(len(outer))
    apart = np.abs(index[:, None] - index[None]) * LINK
    return apart > NEAR_AHEAD * (outer[:, None] + outer[None])


def _draft(
    recipe: ColonRecipe, sway: Sway, arc: Float[np.ndarray, " points"], strength: float, sigmoid: Places
) -> Float[np.ndarray, "points 3"]:
    """Anatomical places along the colon, each segment stretched or folded to its length less what its sway takes."""
    left, right = 0.115, -0.110
    junction = np.array([left, 0.015, 0.150])
    splenic = np.array([0.100, 0.035, junction[2] + 0.95 * recipe.lengths["descending"]])
    hepatic = np.array([-0.095, 0.010, splenic[2] - 0.045])
    foot = np.array([right, 0.015, hepatic[2] - 0.97 * recipe.lengths["ascending"]])
    rectal = [(0, 0.055, 0), (0, 0.072, 0.040), (0, 0.062, 0.080), (0, 0.030, 0.112)]
    descending = [(left + 0.008, 0.035, junction[2] + share * (splenic[2] - junction[2])) for share in (0.3, 0.65)]
    transverse = [(0.075, -0.040, splenic[2] - 0.045), (0.030, -0.075, 0), (-0.030, -0.080, 0), (-0.075, -0.050, 0)]
    ascending = [(right - 0.005, 0.030, hepatic[2] + share * (foot[2] - hepatic[2])) for share in (0.35, 0.7)]
    caecum = [foot + np.array([0.008, -0.012, -0.9 * recipe.lengths["caecum"]])]
    noise = [LOOSE_POINTS * offsets for offsets in sway.points]
    taut = 1 - SWAY_LENGTH * (strength - SWAY_LIMITS[0])
    ends = [np.asarray(rectal[-1]), junction, splenic, hepatic, foot]
    middle = (
        _bow(np.array(sigmoid) + noise[0], ends[0], ends[1], taut * recipe.lengths["sigmoid"]),
        np.array(descending) + 0.6 * noise[1],
        _sag(np.array(transverse) + noise[2], splenic, hepatic, recipe.lengths["transverse"]),
        np.array(ascending) + 0.6 * noise[3],
        np.array(caecum),
    )
    borders = recipe.borders()
    places, controls = [], []
    for name, start, inner, end in zip(
        SEGMENTS,
        [np.asarray(rectal[0]), *ends],
        [np.array(rectal[1:-1]), *middle[:-1], middle[-1][:0]],
        [*ends, middle[-1][0]],
        strict=True,
    ):
        stretch = np.concatenate([[start], inner, [end]])
        share = arc_length(stretch) / arc_length(stretch)[-1]
        begin, finish = borders[name]
        places.append(begin + share[: None if name == SEGMENTS[-1] else -1] * (finish - begin))
        controls.append(stretch[: len(places[-1])])
    return CubicSpline(np.concatenate(places), np.concatenate(controls))(arc)


def _swaying(sway: Sway, arc: Float[np.ndarray, " points"]) -> Float[np.ndarray, "points 3"]:
    """Swaying of unit strength about the draft, fading in from the fixed rectum."""
    waves = np.sin(2 * np.pi * arc[:, None] / sway.waves + sway.phases).sum(0)
    return np.sqrt(2 / SWAY_TERMS) * np.clip((arc - 0.08) / 0.05, 0, 1)[:, None] * waves


def _bow(inner: np.ndarray, start: np.ndarray, end: np.ndarray, length: float) -> np.ndarray:
    """Move the loop's points away from its chord until the polygon has the length."""
    share = np.linspace(0, 1, len(inner) + 2)[1:-1, None]
    chord = start + share * (end - start)
    return _stretch(lambda factor: chord + factor * (inner - chord), start, end, length)


def _sag(inner: np.ndarray, start: np.ndarray, end: np.ndarray, length: float) -> np.ndarray:
    """Let the transverse colon hang down until the polygon has the length."""
    share = np.linspace(0, 1, len(inner) + 2)[1:-1]
    hang = np.sin(np.pi * share) ** 0.7

    def place(factor: float) -> np.ndarray:
        points = inner.copy()
        points[:, 2] = start[2] + share * (end[2] - start[2]) - 0.1 * factor * hang
        return points

    return _stretch(place, start, end, length)


def _stretch(place, start: np.ndarray, end: np.ndarray, length: float) -> np.ndarray:
    """The placing whose polygon has the length, by bisection of its factor."""
    low, high = 0.0, 4.0
    for _ in range(40):
        factor = (low + high) / 2
        polygon = np.concatenate([[start], place(factor), [end]])
        low, high = (factor, high) if arc_length(polygon)[-1] < length else (low, factor)
    return place((low + high) / 2)


def _relax(
    home: Float[np.ndarray, "points 3"], recipe: ColonRecipe, outer: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "points 3"]:
    """Give the chain its link length, its smallest bend and room between its loops, near its anatomical places."""
    points = np.ascontiguousarray(home.T)  # a row a coordinate: half the time of a row a point
    link = recipe.length / (len(home) - 1)
    sharpest = link**2 / np.maximum(BEND_MARGIN * recipe.flexure_radius, OUTER_MARGIN * outer)
    one, two = np.nonzero(np.triu(_across(outer)))
    needed = outer[one] + outer[two]
    near, (look, part, tighten) = np.empty(0, int), _compiled()
    for turn in range(ROUNDS):
        if turn < HOMING_SHARE * ROUNDS:
            points += HOMING * (1 - turn / (HOMING_SHARE * ROUNDS)) * (home.T - points)
        if turn % LOOK_ROUND == 0:
            near = look(points, one, two, needed + recipe.gap + LOOK_ROUND_ROOM)
        part(points, one[near], two[near], needed[near] + GAP_MARGIN * recipe.gap)
        tighten(points, sharpest, link)
    return np.ascontiguousarray(points.T)


@cache
def _compiled() -> tuple[Callable[..., Any], ...]:
    """Compile the loops below, or read what was compiled before.

    Without liberties, so that sums keep their order: the same on every machine, to the last bit.
    """
    from numba import njit

    loops: Any = _near, _parted, _tightened
    return tuple(njit(unwrap(loop), nogil=True, cache=True) for loop in loops)


def _near(
    points: Float[np.ndarray, "3 points"],
    one: Int[np.ndarray, " pairs"],
    two: Int[np.ndarray, " pairs"],
    reach: Float[np.ndarray, " pairs"],
) -> Int[np.ndarray, " near"]:
    """Which pairs are nearer to each other than they reach."""
    found, count = np.empty(len(one), np.int64), 0
    for pair in range(len(one)):
        i, j = one[pair], two[pair]
        x, y, z = points[0, i] - points[0, j], points[1, i] - points[1, j], points[2, i] - points[2, j]
        if np.sqrt(x * x + y * y + z * z) < reach[pair]:
            found[count] = pair
            count += 1
    return found[:count]


def _tightened(points: Float[np.ndarray, "3 points"], sharpest: Float[np.ndarray, " points"], link: float) -> None:
    """Bring bends and links to their bounds, in turn, by moving points in place.

    Every point moves whose chord over some links bulges more than its smallest radius allows, and then those at the
    ends of links that are too long or too short.
    """
    count = points.shape[1]
    excess = np.zeros_like(points)
    for _ in range(SWEEPS):
        for stride in STRIDES:
            for i in range(stride, count - stride):
                x = points[0, i - stride] - 2 * points[0, i] + points[0, i + stride]
                y = points[1, i - stride] - 2 * points[1, i] + points[1, i + stride]
                z = points[2, i - stride] - 2 * points[2, i] + points[2, i + stride]
                size = max(np.sqrt(x * x + y * y + z * z), 1e-12)
                share = max(0.0, 1 - stride**2 * sharpest[i] / size)
                excess[0, i], excess[1, i], excess[2, i] = share * x, share * y, share * z
            for axis in range(3):
                for i in range(count):
                    move = 0.0
                    if stride <= i < count - stride:
                        move += 0.25 * excess[axis, i]
                    if i < count - 2 * stride:
                        move -= 0.125 * excess[axis, i + stride]
                    if i >= 2 * stride:
                        move -= 0.125 * excess[axis, i - stride]
                    points[axis, i] += move
        for i in range(count - 1):
            x, y, z = points[0, i + 1] - points[0, i], points[1, i + 1] - points[1, i], points[2, i + 1] - points[2, i]
            share = 0.5 * (1 - link / max(np.sqrt(x * x + y * y + z * z), 1e-9))
            excess[0, i], excess[1, i], excess[2, i] = share * x, share * y, share * z
        for axis in range(3):
            for i in range(count):
                move = 0.0
                if i < count - 1:
                    move += 0.5 * excess[axis, i]
                if i > 0:
                    move -= 0.5 * excess[axis, i - 1]
                points[axis, i] += move


def _parted(
    points: Float[np.ndarray, "3 points"],
    one: Int[np.ndarray, " pairs"],
    two: Int[np.ndarray, " pairs"],
    needed: Float[np.ndarray, " pairs"],
) -> None:
    """Move apart, in place, the pairs that are nearer than needed; each point by the mean over its pairs."""
    away, back, count = np.zeros_like(points), np.zeros_like(points), np.zeros(points.shape[1])
    for pair in range(len(one)):
        i, j = one[pair], two[pair]
        x, y, z = points[0, i] - points[0, j], points[1, i] - points[1, j], points[2, i] - points[2, j]
        distance = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        overlap = needed[pair] - distance
        if overlap > 0:
            push = overlap / distance
            away[0, i], away[1, i], away[2, i] = away[0, i] + push * x, away[1, i] + push * y, away[2, i] + push * z
            back[0, j], back[1, j], back[2, j] = back[0, j] - push * x, back[1, j] - push * y, back[2, j] - push * z
            count[i] += 1
            count[j] += 1
    for axis in range(3):
        for i in range(points.shape[1]):
            points[axis, i] += 0.25 * (away[axis, i] + back[axis, i]) / max(count[i], 1.0)
