"""Penalty contacts of the tread: sliding frictional tooth faces on tissue, and frictionless circular strut tips.

Both return nodal forces with their exact derivative, so Newton's method converges quadratically between changes of the
active set. Forces are per unit width [N/m]; nodes are numbered over all bodies.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

_GAUSS = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)])
_GAUSS_WEIGHTS = np.array([5, 8, 5]) / 18
"""Three points a segment: the contact force then changes smoothly while an edge of contact crosses a segment."""


SOFT_DEPTH = 5e-6
"""Depth [m] over which the pressure starts as a parabola: without it points flip in and out of contact for ever."""


def pressure_law(depth: Float[np.ndarray, " c"], stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Penalty pressure [Pa] and its slope [Pa/m]: parabola up to `SOFT_DEPTH`, then its tangent."""
    soft = np.minimum(depth, SOFT_DEPTH)
    return stiffness * (soft**2 / (2 * SOFT_DEPTH) + (depth - soft)), stiffness * soft / SOFT_DEPTH


@dataclass(frozen=True)
class Patch:
    """Forces of the active contact points on the few nodes each one touches."""

    nodes: Int[np.ndarray, "c k"]
    forces: Float[np.ndarray, "c k 2"]
    """[N/m]."""
    slopes: Float[np.ndarray, "c k 2 k 2"]
    """d forces / d positions [N/m^2]."""
    depth: float
    """Deepest penetration [m]; the penalty's own error."""


def sliding_faces(
    x: Float[np.ndarray, "n 2"],
    faces: Int[np.ndarray, "f 2"],
    rest_lengths: Float[np.ndarray, " f"],
    surface: Int[np.ndarray, " s"],
    *,
    stiffness: float,
    friction: float,
) -> Patch:
    """Tooth faces pressed into the tissue surface while they slide towards -x (so friction drags them to +x).

    A point of a face at depth g below the surface's polyline carries `pressure_law(g)` along the face's normal and
    `friction` times it along the face: Coulomb's law with fully developed sliding. Tooth faces carry the points
    and the tissue is the surface, so that a tooth's edge is where it is and not at the nearest tissue node.

    Args:
        x: Positions of all nodes [m].
        faces: Node pairs of the tooth faces, left to right.
        rest_lengths: Their lengths at rest [m].
        surface: Nodes of the tissue's inner surface, left to right.
        stiffness: Penalty [Pa/m].
        friction: Coulomb's coefficient.
    """
    shape = np.stack([1 - _GAUSS, _GAUSS])  # node, point
    points = np.einsum("fai,ap->fpi", x[faces], shape)
    ground = x[surface]
    segment = np.clip(np.searchsorted(ground[:, 0], points[..., 0]) - 1, 0, len(surface) - 2)
    run = ground[segment + 1] - ground[segment]
    slope = run[..., 1] / run[..., 0]
    along = (points[..., 0] - ground[segment, 0]) / run[..., 0]
    gap = points[..., 1] - ground[segment, 1] - slope * (points[..., 0] - ground[segment, 0])
    face, point = np.nonzero(gap > 0)
    at = (face, point)

    edge = x[faces[face, 1]] - x[faces[face, 0]]
    length = np.linalg.norm(edge, axis=1)
    tangent = edge / length[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], 1)
    pull = -normal + friction * tangent
    weight = rest_lengths[face] * _GAUSS_WEIGHTS[point]
    pressure, hardness = pressure_law(gap[at], stiffness)
    share = np.stack([shape[0, point], shape[1, point], along[at] - 1, -along[at]], 1)
    nodes = np.stack([faces[face, 0], faces[face, 1], surface[segment[at]], surface[segment[at] + 1]], 1)
    forces = (weight * pressure)[:, None, None] * share[:, :, None] * pull[:, None, :]

    rise = np.stack([-slope[at], np.ones(len(face))], 1)
    gap_slope = share[:, :, None] * rise[:, None, :]
    slopes = np.einsum("c,ca,ci,cbj->caibj", weight * hardness, share, pull, gap_slope, optimize=True)
    shift = np.einsum("c,ci,cb->cib", weight * pressure / run[at][:, 0], pull, share)
    slopes[:, 2, :, :, 0] += shift
    slopes[:, 3, :, :, 0] -= shift
    turn = (tangent + friction * normal)[:, None, :] * share[:, :, None] * (weight * pressure / length)[:, None, None]
    slopes[:, :, :, 1, :] += turn[..., None] * normal[:, None, None, :]
    slopes[:, :, :, 0, :] -= turn[..., None] * normal[:, None, None, :]
    return Patch(nodes, forces, slopes, float(gap.max(initial=0.0)))


def round_tips(
    x: Float[np.ndarray, "n 2"],
    faces: Int[np.ndarray, "f 2"],
    rest_lengths: Float[np.ndarray, " f"],
    centres: Float[np.ndarray, "t 2"],
    radius: float,
    *,
    stiffness: float,
) -> tuple[Patch, Int[np.ndarray, " c"]]:
    """Rigid frictionless circles pressed into the belt's inner face; also which tip each contact point touches."""
    shape = np.stack([1 - _GAUSS, _GAUSS])
    points = np.einsum("fai,ap->fpi", x[faces], shape)
    offset = points[:, :, None, :] - centres
    distance = np.linalg.norm(offset, axis=-1)
    face, point, tip = np.nonzero(distance < radius)
    r = distance[face, point, tip]
    outward = offset[face, point, tip] / r[:, None]
    weight = rest_lengths[face] * _GAUSS_WEIGHTS[point]
    pressure, hardness = pressure_law(radius - r, stiffness)
    share = shape[:, point].T
    forces = (weight * pressure)[:, None, None] * share[:, :, None] * outward[:, None, :]
    radial = outward[:, :, None] * outward[:, None, :]
    local = (pressure / r)[:, None, None] * (np.eye(2) - radial) - hardness[:, None, None] * radial
    slopes = np.einsum("c,ca,cb,cij->caibj", weight, share, share, local, optimize=True)
    return Patch(faces[face], forces, slopes, float((radius - r).max(initial=0.0))), tip
