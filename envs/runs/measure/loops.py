"""Loops of the scope, read off its shape: N, alpha, reversed alpha, deep transverse, gamma.

Definitions, after Cotton and Williams, Practical Gastrointestinal Endoscopy (from memory, unverified), and readers of
magnetic imagers: an alpha loop crosses itself and comes out with clockwise torque, seen along the scope from the
handle; a reversed alpha loop with anticlockwise torque; a gamma loop crosses itself in the transverse colon; an N loop
bows one way and back without crossing itself, between the rectum and the end of the descending colon; a deep transverse
loop hangs down from both ends of the transverse colon.

A colon has a course of its own, which a scope that pushes nothing follows. Told where the colon lay at rest (`Rest`),
only those are loops that the push made: forms that the colon did not have there, of a scope that has left the lumen at
rest, or forms that it had and that reach further now. A scope laid on the axis at rest has none.

A crossing that clockwise torque undoes is right-handed: pulled straight, a loop of writhe +1 leaves one right-handed
turn of twist (Calugareanu's theorem), which the handle takes out by turning clockwise. So the sign of the crossing
tells alpha from reversed alpha, and does not depend on the side that the patient is looked at from.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import pdist

from haustra.envs.runs.measure.crossings import crossings
from haustra.errors import InvalidOptionError
from haustra.models.wall.vectors import cross, dot

_BOW = np.radians(60.0)
"""An N loop turns at least this far each way; engineering choice."""

_SLACK = 1.15
"""An N loop is at least this much longer than the straight way; engineering choice."""

_SHORTEST = 0.05
"""A loop runs along at least this much of the scope [m]; engineering choice: tighter is no loop but noise."""

_DEEP = 0.08
"""A transverse colon is deep that hangs at least this far below both its ends [m]; engineering choice."""

_PUSHED = 0.04
"""A scope has left the lumen at rest where it is further than this from the axis at rest, and a form that the colon had
is pushed where it reaches further by this [m]; engineering choice above the lumen's radius of 15 to 30 mm."""

_BESIDE = 0.05
"""A form of the colon at rest is looked for along a loop and this far beyond both ends [m]; engineering choice."""


class LoopKind(Enum):
    """Kinds of loops that endoscopists name."""

    N = "N"
    ALPHA = "alpha"
    REVERSED_ALPHA = "reversed alpha"
    DEEP_TRANSVERSE = "deep transverse"
    GAMMA = "gamma"


CROSSING = (LoopKind.ALPHA, LoopKind.REVERSED_ALPHA, LoopKind.GAMMA)
"""Kinds of loops that cross themselves."""


@dataclass(frozen=True)
class Loop:
    """One loop."""

    kind: LoopKind
    start: float
    """Where it begins: distance along the scope from the first point [m]."""
    end: float
    """Where it ends [m]."""
    size: float
    """Largest distance between two of its points [m]."""


@dataclass(frozen=True)
class Rest:
    """Where the colon lay before a scope came."""

    points: Float[np.ndarray, "stations 3"]
    """Its axis, from the anus [m]."""
    arc: Float[np.ndarray, " stations"]
    """Arc length there [m]."""
    beside: Float[np.ndarray, " n"]
    """Arc length beside each point of the scope [m]."""

    def between(self, low: float, high: float) -> Float[np.ndarray, "_ 3"]:
        """The axis between two arc lengths [m]."""
        return self.points[(self.arc >= low) & (self.arc <= high)]


def find_loops(
    points: Float[np.ndarray, "n 3"],
    *,
    view: Float[np.ndarray, "3"],
    regions: Mapping[str, tuple[float, float]] | None = None,
    down: Float[np.ndarray, "3"] | None = None,
    rest: Rest | None = None,
) -> tuple[Loop, ...]:
    """Loops of a scope as seen along `view`, from the handle to the tip.

    Args:
        points: along the scope's axis, from the handle to the tip [m].
        view: direction of sight, along which crossings are looked for: the anteroposterior axis.
        regions: from where to where the scope lies in each segment of the colon [m along the scope]: a crossing loop
            in one named 'transverse' is a gamma loop, and N loops lie before the end of one named 'descending'.
        down: direction of the patient's feet, in which a deep transverse loop hangs; none is looked for when None.
        rest: where the colon lay at rest; all forms are loops when None, whoever made them.

    Raises:
        InvalidOptionError: when there are fewer than four points, or the view has no direction.
    """
    line = np.asarray(points, dtype=float)
    size = np.linalg.norm(view)
    if len(line) < 4 or not np.isfinite(line).all() or not size > 0:
        raise InvalidOptionError("Loops need at least four finite points and a direction of view.")
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    flat, height = _project(line, np.asarray(view, dtype=float) / size)
    loops = [
        Loop(_kind(start, end, sign, regions), start, end, _extent(line, arc, start, end))
        for start, end, sign in _crossed(crossings(flat, height, arc))
    ]
    last = (regions or {}).get("descending", (0.0, arc[-1]))[1]
    free = [(start, min(end, last)) for start, end in _gaps(loops, arc[-1]) if start < last]
    loops += [bow for start, end in free if (bow := _bow(line, flat, arc, start, end))]
    if down is not None and (deep := _deep(line, arc, regions or {}, np.asarray(down, dtype=float))):
        loops += [] if any(loop.kind is LoopKind.GAMMA for loop in loops) else [deep]
    if rest is not None:
        loops = [loop for loop in loops if _is_pushed(loop, line, arc, rest, view, down)]
    return tuple(sorted(loops, key=lambda loop: loop.start))


def reach(points: Float[np.ndarray, "n 3"]) -> float:
    """How far a curve bows out: the largest distance of its points from the line through its ends [m]."""
    chord = points[-1] - points[0]
    along = chord / max(float(np.linalg.norm(chord)), 1e-9)
    away = points - points[0]
    share = np.clip(away @ along, 0.0, np.linalg.norm(chord))
    return float(np.linalg.norm(away - share[:, None] * along, axis=1).max())


def _is_pushed(
    loop: Loop, line: np.ndarray, arc: np.ndarray, rest: Rest, view: np.ndarray, down: np.ndarray | None
) -> bool:
    """Whether it is what a push made, and not the colon's own course."""
    inside = (arc >= loop.start - _SHORTEST / 2) & (arc <= loop.end + _SHORTEST / 2)
    low, high = float(rest.beside[inside].min()), float(rest.beside[inside].max())
    own, near = rest.between(low, high), rest.between(low - _BESIDE, high + _BESIDE)
    if len(near) < 4 or len(own) < 2:
        return False
    away = np.linalg.norm(line[inside][:, None] - near[None], axis=2).min(axis=1).max()
    if away <= _PUSHED:
        return False
    if loop.kind is LoopKind.DEEP_TRANSVERSE:
        assert down is not None
        return bool((line[inside] @ down).max() > (own @ down).max() + _PUSHED)
    kinds = CROSSING if loop.kind in CROSSING else (loop.kind,)
    if reach(line[inside]) > reach(own) + _PUSHED:
        return True
    return not any(form.kind in kinds for form in find_loops(near, view=view))


def _deep(
    line: np.ndarray, arc: np.ndarray, regions: Mapping[str, tuple[float, float]], down: np.ndarray
) -> Loop | None:
    """A transverse colon that hangs below both its ends, or below the tip in it."""
    start, end = regions.get("transverse", (arc[-1], arc[-1]))
    inside = np.flatnonzero((arc >= start) & (arc <= end))
    if len(inside) < 4:
        return None
    depth = line[inside] @ down
    if depth.max() - max(depth[0], depth[-1]) < _DEEP:
        return None
    begins, ends = float(arc[inside[0]]), float(arc[inside[-1]])
    return Loop(LoopKind.DEEP_TRANSVERSE, begins, ends, _extent(line, arc, begins, ends))


def writhe(points: Float[np.ndarray, "n 3"]) -> float:
    """Writhe of an open curve, by Gauss's double integral over its straight pieces; right-handed loops are positive.

    Each pair of pieces adds the solid angle in which one is seen to cross the other, over 2 pi (Klenin and Langowski,
    Biopolymers 54 (2000) 307), here as two triangles (van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983)
    125), which stays sound where pieces are in line.
    """
    line = np.asarray(points, dtype=float)
    first, second = np.triu_indices(len(line) - 1, 2)
    a, b, c, d = line.T[:, first], line.T[:, first + 1], line.T[:, second], line.T[:, second + 1]
    ac, ad, bd, bc = (_unit(each) for each in (c - a, d - a, d - b, c - b))
    return float((_solid_angle(ac, bd, ad) + _solid_angle(ac, bc, bd)).sum()) / (2 * np.pi)


def _solid_angle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Signed solid angle of triangles of directions (3, triangles)."""
    one, other, third = ((each[0], each[1], each[2]) for each in (a, b, c))
    volume = dot(one, cross(other, third))
    return 2 * np.arctan2(volume, 1 + dot(one, other) + dot(other, third) + dot(third, one))


def _unit(directions: np.ndarray) -> np.ndarray:
    return directions / np.maximum(np.sqrt((directions * directions).sum(axis=0)), 1e-300)


def _project(line: np.ndarray, view: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates across the view, right-handed with it, and along it."""
    across = np.eye(3)[int(np.argmin(np.abs(view)))]
    first = np.cross(across, view)
    first /= np.linalg.norm(first)
    second = np.cross(view, first)
    return line @ np.column_stack([first, second]), line @ view


def _crossed(crossings: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Stretches between crossings that make a loop, and the sum of their signs.

    The innermost crossings come first: one that encloses a loop already found is part of the way there and back. One
    that shares more than half of its stretch with a loop crosses the same loop again: signs add up, and strands that
    weave over and under each other come to nothing.
    """
    found: list[list[float]] = []
    for first, second, sign in sorted(crossings, key=lambda each: each[1] - each[0]):
        if second - first < _SHORTEST or any(start >= first and end <= second for start, end, _ in found):
            continue
        shared = [min(second, end) - max(first, start) for start, end, _ in found]
        if shared and max(shared) > 0.5 * (second - first):
            found[int(np.argmax(shared))][2] += sign
        else:
            found.append([first, second, sign])
    return [(start, end, sign) for start, end, sign in found if sign]


def _kind(start: float, end: float, sign: float, regions: Mapping[str, tuple[float, float]] | None) -> LoopKind:
    if regions and _region_at((start + end) / 2, regions) == "transverse":
        return LoopKind.GAMMA
    return LoopKind.ALPHA if sign > 0 else LoopKind.REVERSED_ALPHA


def _gaps(loops: list[Loop], length: float) -> list[tuple[float, float]]:
    edges = [
        0.0,
        *(edge for loop in sorted(loops, key=lambda loop: loop.start) for edge in (loop.start, loop.end)),
        length,
    ]
    return [(edges[k], edges[k + 1]) for k in range(0, len(edges), 2) if edges[k + 1] - edges[k] >= _SHORTEST]


def _bow(line: np.ndarray, flat: np.ndarray, arc: np.ndarray, start: float, end: float) -> Loop | None:
    """An N loop in a stretch without crossings: the first turn one way and the next back."""
    inside = np.flatnonzero((arc >= start) & (arc <= end))
    if len(inside) < 4:
        return None
    step = np.diff(flat[inside], axis=0)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    turns = _alternating_turns(heading)
    for (begin, _, first), (_, finish, second) in pairwise(turns):
        if min(abs(first), abs(second)) >= _BOW and first * second < 0:
            low, high = inside[begin], inside[min(finish + 1, len(inside) - 1)]
            if arc[high] - arc[low] >= _SLACK * np.linalg.norm(line[high] - line[low]):
                begins, ends = float(arc[low]), float(arc[high])
                return Loop(LoopKind.N, begins, ends, _extent(line, arc, begins, ends))
    return None


def _alternating_turns(heading: np.ndarray) -> list[tuple[int, int, float]]:
    """Stretches (first, last, angle) over which the heading turns one way, small wobbles joined."""
    wobble = np.radians(10.0)
    turns: list[tuple[int, int, float]] = []
    begin = extreme = 0
    way = 0
    for index in range(1, len(heading)):
        if way == 0:
            if abs(heading[index] - heading[begin]) > wobble:
                way, extreme = int(np.sign(heading[index] - heading[begin])), index
        elif way * (heading[index] - heading[extreme]) >= 0:
            extreme = index
        elif abs(heading[index] - heading[extreme]) > wobble:
            turns.append((begin, extreme, float(heading[extreme] - heading[begin])))
            begin, way, extreme = extreme, -way, index
    if way:
        turns.append((begin, extreme, float(heading[extreme] - heading[begin])))
    return turns


def _extent(line: np.ndarray, arc: np.ndarray, start: float, end: float) -> float:
    part = line[(arc >= start) & (arc <= end)]
    return float(pdist(part).max()) if len(part) > 1 else 0.0


def _region_at(place: float, regions: Mapping[str, tuple[float, float]]) -> str | None:
    return next((name for name, (start, end) in regions.items() if start <= place <= end), None)
