"""The course of a grown colon through the abdomen: a chain of fixed length that finds room for itself.

Axes as in DICOM patient coordinates: x to the patient's left, y to the back, z up; the anus is near the origin.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline, PchipInterpolator

from haustra.models.anatomy.frames import arc_length, curvature, resample, smooth
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.recipe import ColonRecipe

LINK = 5e-3
"""Length of the chain's links [m]: an eighth of a flexure's radius."""
ROUNDS = 1000
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
GAP_MARGIN, BEND_MARGIN, OUTER_MARGIN = 1.2, 1.05, 1.4
"""Room and radius of curvature are aimed this much above what is needed, since relaxation stops short of it: the
room, the flexure's radius, and the radius of curvature over the lumen's."""
NEAR_AHEAD = 2.2
"""Points are neighbours along the colon, not across, within this many times their two radii."""
MEANDER = 0.009
"""Standard deviation of the course about its usual places [m]..."""
MEANDER_WAVES, MEANDER_TERMS = (0.10, 0.25), 3
"""... swaying with this many wavelengths from this range [m]."""
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


def lay_course(recipe: ColonRecipe, rng: np.random.Generator) -> Course:
    """Lay the axis: an anatomical draft, relaxed until it has its length, its bends and its room."""
    links = round(recipe.length / LINK)
    arc = np.linspace(0.0, recipe.length, links + 1)
    outer = BULGE * radius_along(recipe, arc)
    home = smooth(_draft(recipe, rng, arc), DRAFT_SMOOTHING / LINK) + _meander(rng, arc)
    points = _relax(home, recipe, outer)
    points = resample(points, LINK)
    return Course(
        points=points,
        gap=smallest_gap(points, BULGE * radius_along(recipe, np.linspace(0, recipe.length, len(points)))),
        radius_of_curvature=float(1 / curvature(points)[2:-2].max()),
    )


def radius_along(recipe: ColonRecipe, arc: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
    """Mean radius [m] at each arc length, changing smoothly between the middles of the segments."""
    borders = recipe.borders()
    middles = [sum(borders[name]) / 2 for name in SEGMENTS]
    values = [recipe.diameters[name] / 2 for name in SEGMENTS]
    ampulla = np.array([0.25, 0.5, 0.85]) * borders["rectum"][1]
    places = [0.0, *ampulla, *middles[1:], recipe.length]
    radii = [recipe.anus_diameter / 2, 0.75 * values[0], values[0], values[0], *values[1:], values[-1]]
    return PchipInterpolator(places, radii)(np.clip(arc, 0.0, recipe.length))


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
    recipe: ColonRecipe, rng: np.random.Generator, arc: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "points 3"]:
    """Anatomical places along the colon, each segment stretched or folded to its length."""
    left, right = 0.115, -0.110
    junction = np.array([left, 0.015, 0.150])
    splenic = np.array([0.100, 0.035, junction[2] + 0.95 * recipe.lengths["descending"]])
    hepatic = np.array([-0.095, 0.010, splenic[2] - 0.045])
    foot = np.array([right, 0.015, hepatic[2] - 0.97 * recipe.lengths["ascending"]])
    rectal = [(0, 0.055, 0), (0, 0.072, 0.040), (0, 0.062, 0.080), (0, 0.030, 0.112)]
    sigmoid = [(-0.035, 0.000, 0.125), (-0.045, -0.050, 0.115), (0.010, -0.070, 0.085), (0.065, -0.050, 0.105)]
    descending = [(left + 0.008, 0.035, junction[2] + share * (splenic[2] - junction[2])) for share in (0.3, 0.65)]
    transverse = [(0.075, -0.040, splenic[2] - 0.045), (0.030, -0.075, 0), (-0.030, -0.080, 0), (-0.075, -0.050, 0)]
    ascending = [(right - 0.005, 0.030, hepatic[2] + share * (foot[2] - hepatic[2])) for share in (0.35, 0.7)]
    caecum = [foot + np.array([0.008, -0.012, -0.9 * recipe.lengths["caecum"]])]
    noise = [MEANDER * rng.standard_normal((len(part), 3)) for part in (sigmoid, descending, transverse, ascending)]
    ends = [np.asarray(rectal[-1]), junction, splenic, hepatic, foot]
    middle = (
        _bow(np.array(sigmoid) + noise[0], ends[0], ends[1], recipe.lengths["sigmoid"]),
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


def _meander(rng: np.random.Generator, arc: Float[np.ndarray, " points"]) -> Float[np.ndarray, "points 3"]:
    """Swaying about the draft, fading in from the fixed rectum."""
    waves = rng.uniform(*MEANDER_WAVES, size=(MEANDER_TERMS, 1, 3))
    phases = rng.uniform(0, 2 * np.pi, size=(MEANDER_TERMS, 1, 3))
    sway = np.sin(2 * np.pi * arc[:, None] / waves + phases).sum(0)
    return MEANDER * np.sqrt(2 / MEANDER_TERMS) * np.clip((arc - 0.08) / 0.05, 0, 1)[:, None] * sway


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
    points = home.copy()
    link = recipe.length / (len(points) - 1)
    sharpest = link**2 / np.maximum(BEND_MARGIN * recipe.flexure_radius, OUTER_MARGIN * outer)
    one, two = np.nonzero(np.triu(_across(outer)))
    near = np.empty(0, int)
    for turn in range(ROUNDS):
        if turn < HOMING_SHARE * ROUNDS:
            points += HOMING * (1 - turn / (HOMING_SHARE * ROUNDS)) * (home - points)
        if turn % LOOK_ROUND == 0:
            distance = np.linalg.norm(points[one] - points[two], axis=1)
            near = np.flatnonzero(distance < outer[one] + outer[two] + recipe.gap + LOOK_ROUND_ROOM)
        points += _part(points, one[near], two[near], (outer[one] + outer[two])[near] + GAP_MARGIN * recipe.gap)
        for _ in range(SWEEPS):
            for stride in STRIDES:
                points += _straighten(points, sharpest, stride)
            points += _keep_links(points, link)
    return points


def _straighten(points: np.ndarray, sharpest: np.ndarray, stride: int) -> np.ndarray:
    """Move every point whose chord over `stride` links bulges more than its smallest radius allows."""
    bulge = points[: -2 * stride] - 2 * points[stride:-stride] + points[2 * stride :]
    size = np.maximum(np.linalg.norm(bulge, axis=1), 1e-12)
    allowed = stride**2 * sharpest[stride:-stride]
    excess = np.maximum(0.0, 1 - allowed / size)[:, None] * bulge
    move = np.zeros_like(points)
    move[stride:-stride] += 0.25 * excess
    move[: -2 * stride] -= 0.125 * excess
    move[2 * stride :] -= 0.125 * excess
    return move


def _part(points: np.ndarray, one: np.ndarray, two: np.ndarray, needed: np.ndarray) -> np.ndarray:
    """Move apart the pairs that are nearer than needed; each point by the mean over its pairs."""
    apart = points[one] - points[two]
    distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-9)
    overlap = np.maximum(0.0, needed - distance)
    push = (overlap / distance)[:, None] * apart
    move, count = np.zeros_like(points), np.zeros(len(points))
    for index, sign in ((one, 1.0), (two, -1.0)):
        count += np.bincount(index, weights=overlap > 0, minlength=len(points))
        for axis in range(3):
            move[:, axis] += np.bincount(index, weights=sign * push[:, axis], minlength=len(points))
    return 0.25 * move / np.maximum(count, 1)[:, None]


def _keep_links(points: np.ndarray, link: float) -> np.ndarray:
    step = np.diff(points, axis=0)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    pull = 0.5 * (1 - link / np.maximum(length, 1e-9)) * step
    move = np.zeros_like(points)
    move[:-1] += 0.5 * pull
    move[1:] -= 0.5 * pull
    return move
