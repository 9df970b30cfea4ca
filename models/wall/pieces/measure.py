"""The wall's error, measured with rays from the centreline."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon
from haustra.models.wall.pieces.blocks import ENTRY_RADIUS, ENTRY_REACH
from haustra.models.wall.pieces.distance import Faces
from haustra.models.wall.pieces.neighbours import OTHER_LOOP, Standing, deepest
from haustra.models.wall.pieces.rays import Caster, joined_hulls
from haustra.models.wall.pieces.wall import WallAccuracy, WallPiece

RAYS_PER_STATION = 16
GOLDEN = 0.61803398875
"""Turn between stations, as a share of the angle between rays: no direction is left out along the whole colon."""
LEAK = 0.003
"""A ray that runs this far [m] outside the lumen without meeting a piece has leaked: thinner walls leak (FINDINGS)."""
RIM = 0.001
"""How near [m] a ray passes the rim of a fold, or of a hole where two loops have grown together, when it grazes it."""
MILLIMETRE = 1e3
SEAM_PAIRS = 400
"""Pairs of neighbouring rays between which a step is looked for."""
FURTHEST = 1.0
"""Stands for no hit at all where steps are looked for [m]."""
SEAM_HALVINGS = 10
"""Times that the angle between two rays is halved: 4 mm on the wall become 4 micrometres."""
_Found = TypeVar("_Found")


@dataclass(frozen=True)
class RayAccuracy:
    """Where each ray from the centreline meets the pieces, seen from the lumen surface."""

    origins: Float[np.ndarray, "rays 3"]
    """On the centreline [m], in order of arc length."""
    directions: Float[np.ndarray, "rays 3"]
    """Unit vectors across it."""
    along: Float[np.ndarray, " rays"]
    """First hit on a piece minus first hit on the lumen, along the ray [m]; infinite where no piece was met."""
    signed: Float[np.ndarray, " rays"]
    """Distance of the hit from the lumen surface [m], negative inside the lumen; NaN where the ray leaked."""
    leaked: Bool[np.ndarray, " rays"]
    """Which rays left the lumen and met no piece within `LEAK`."""


def measure(
    colon: Colon, pieces: Sequence[WallPiece], standing: Iterable[Standing], *, rays: int, threads: int
) -> tuple[WallAccuracy, dict[str, float]]:
    """The error of `pieces` as a wall of `colon`, from about `rays` rays, and figures that go beside it [mm].

    `standing` is where they stand in the lumen of another loop; `threads` share the rays.

    A ray sees only what is in sight of the centreline: pockets behind folds in sharp bends are left out.
    """
    lumen = Caster(colon.lumen)
    stretches = groupby(pieces, key=lambda piece: piece.start)
    wall = Caster(*(joined_hulls([piece.vertices for piece in stretch]) for _, stretch in stretches))
    error = cast_error(colon, lumen, wall, rays=rays, threads=threads)
    signed = error.signed[~error.leaked] * MILLIMETRE
    inwards, outwards = np.maximum(-signed, 0), np.maximum(signed, 0)
    along = np.maximum(-error.along[~error.leaked], 0) * MILLIMETRE
    if not len(signed):
        raise ValueError(f"none of {len(error.signed)} rays met the wall")
    found = WallAccuracy(
        intrusion_max_mm=float(inwards.max()),
        intrusion_p95_mm=float(np.percentile(inwards, 95)),
        recess_p95_mm=float(np.percentile(outwards, 95)),
        rms_mm=float(np.sqrt(np.mean(signed**2))),
        mean_signed_mm=float(signed.mean()),
        seam_step_max_mm=seam_step(lumen, wall, error, threads=threads) * MILLIMETRE,
        rays=len(error.signed),
        leaks=int(error.leaked.sum()),
        neighbour_max_mm=max((deepest(found, lumen) for found in standing), default=0.0) * MILLIMETRE,
    )
    beside = {
        "intrusion_p99_mm": float(np.percentile(inwards, 99)),
        "intrusion_along_ray_p95_mm": float(np.percentile(along, 95)),
    }
    return found, beside


def cast_error(colon: Colon, lumen: Caster, wall: Caster, *, rays: int, threads: int) -> RayAccuracy:
    """Cast about `rays` rays across the centreline at the lumen and at the wall.

    The error of a ray is the distance of its hit from the lumen surface, not the difference along the ray: a ray that
    grazes a fold would otherwise count centimetres for a tenth of a millimetre.
    """
    origins, directions, arcs, reach, hit = _cast(colon, lumen, wall, rays, threads)
    along = hit - reach
    met = np.isfinite(along)
    points = origins + directions * np.where(met, hit, reach)[:, None]
    distance = Faces(colon.lumen).nearest(points)[0]
    late = met & (along > LEAK)
    leaked = ~met
    lost = (distance[late] > LEAK) | _elsewhere(
        colon, arcs[late], origins[late] + directions[late] * reach[late, None], points[late]
    )
    leaked[late] = lost
    for ray in np.flatnonzero(late)[lost]:
        leaked[ray] = not _grazes(lumen, origins[ray], directions[ray], float(reach[ray]))
    signed = np.where(along < 0, -1.0, 1.0) * np.minimum(distance, np.abs(np.where(met, along, 0.0)))
    return RayAccuracy(origins, directions, along, np.where(leaked, np.nan, signed), leaked)


def seam_step(lumen: Caster, wall: Caster, error: RayAccuracy, *, threads: int) -> float:
    """Largest step of the inner face [m] where one piece ends and the next begins, beyond the lumen's own.

    Between neighbouring rays the angle is halved again and again, keeping the half in which the error changes most:
    what is left on a smooth face goes to zero, on a step it stays.
    """

    def step_at(index: int) -> float:
        origin, rays = error.origins[index], error.directions[index : index + 2]
        seen = _seen(origin, rays, lumen, wall)
        for _ in range(SEAM_HALVINGS):
            middle = rays.sum(axis=0)
            middle /= np.linalg.norm(middle)
            rays = np.insert(rays, 1, middle, axis=0)
            seen = np.insert(seen, 1, _seen(origin, rays[1:2], lumen, wall)[0], axis=0)
            change = np.abs(np.diff(seen[:, 0] - seen[:, 1]))
            half = slice(0, 2) if change[0] > change[1] else slice(1, 3)
            rays, seen = rays[half], seen[half]
        step, own = np.abs(seen[1] - seen[0])
        # A jump as large as a fold is high is a crest seen against what lies behind it, not a joint.
        return float(step) if step < LEAK and own < LEAK else 0.0

    return max(_shared(step_at, _seam_pairs(error), threads), default=0.0)


def _cast(colon: Colon, lumen: Caster, wall: Caster, rays: int, threads: int) -> tuple[np.ndarray, ...]:
    """Origins, directions, arc lengths, distances to lumen and wall, without the rays that leave by the anus."""
    line = colon.centreline
    stations = np.linspace(0, len(line.arc) - 1, max(2, rays // RAYS_PER_STATION)).round().astype(int)

    def around(number: int) -> tuple[np.ndarray, ...]:
        station = stations[number]
        angle = 2 * np.pi * (np.arange(RAYS_PER_STATION) + number * GOLDEN) / RAYS_PER_STATION
        origin = line.points[station]
        across = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ line.frames[station][:, :2].T
        reach = lumen.distance(origin, across)
        kept = np.isfinite(reach) & ~_by_the_anus(colon, origin + across * np.where(np.isinf(reach), 0, reach)[:, None])
        across, reach = across[kept], reach[kept]
        count = len(reach)
        arcs = np.full(count, line.arc[station])
        return np.tile(origin, (count, 1)), across, arcs, reach, wall.entry(origin, across)

    found = _shared(around, np.arange(len(stations)), threads)
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))


def _shared(find: Callable[[int], _Found], numbers: np.ndarray, threads: int) -> list[_Found]:
    """What is found for each number, in order, each thread having a part of them."""

    def part(own: np.ndarray) -> list[_Found]:
        return [find(int(number)) for number in own]

    with ThreadPoolExecutor(threads) as pool:
        return [found for some in pool.map(part, np.array_split(numbers, threads)) for found in some]


def _seen(origin: np.ndarray, rays: np.ndarray, lumen: Caster, wall: Caster) -> np.ndarray:
    """Distances to the wall and to the lumen surface of rays from one origin, at most `FURTHEST`, side by side."""
    return np.minimum(np.stack([wall.entry(origin, rays), lumen.distance(origin, rays)], axis=1), FURTHEST)


def _by_the_anus(colon: Colon, points: np.ndarray) -> np.ndarray:
    """Which points lie where the wall is left open for the scope to come in."""
    offset = points - colon.centreline.points[0]
    axis = colon.centreline.frames[0][:, 2]
    back = -offset @ axis
    aside = np.linalg.norm(offset + back[:, None] * axis, axis=1)
    return (back > -LEAK) & (back < ENTRY_REACH) & (aside < ENTRY_RADIUS + LEAK)


def _elsewhere(colon: Colon, arcs: np.ndarray, left: np.ndarray, came: np.ndarray) -> np.ndarray:
    """Which rays left the lumen in their own loop and came out in another."""
    tree, arc = KDTree(colon.centreline.points), colon.centreline.arc
    own = np.abs(arc[tree.query(left)[1]] - arcs) < OTHER_LOOP
    return own & (np.abs(arc[tree.query(came)[1]] - arcs) > OTHER_LOOP)


def _grazes(lumen: Caster, origin: np.ndarray, direction: np.ndarray, reach: float) -> bool:
    """Whether a ray only touches the rim of an opening: a ray a little beside it goes on inside the lumen."""
    aside = np.linalg.svd(direction[None])[2][1:]
    angle = 2 * np.pi * np.arange(8) / 8
    aim = reach * direction + RIM * (np.cos(angle)[:, None] * aside[0] + np.sin(angle)[:, None] * aside[1])
    aim /= np.linalg.norm(aim, axis=1, keepdims=True)
    return bool((lumen.distance(origin, aim) > reach + LEAK).any())


def _seam_pairs(error: RayAccuracy) -> np.ndarray:
    """First of each pair of neighbouring rays of one station, as many as `SEAM_PAIRS`, evenly spread."""
    together = (error.origins[:-1] == error.origins[1:]).all(axis=1) & ~error.leaked[:-1] & ~error.leaked[1:]
    index = np.flatnonzero(together)
    return index[np.linspace(0, len(index) - 1, min(SEAM_PAIRS, len(index))).astype(int)] if len(index) else index
