"""A colon's surface cut into exactly as many triangles as another paper's scene has."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon, Surface


def with_triangles(colon: Colon, count: int) -> Colon:
    """The colon with its lumen cut into `count` triangles (one fewer where closure forbids that number).

    Edges are halved, longest first, so that the surface stays exactly where it was and stays closed.

    Raises:
        InvalidOptionError: when it has more triangles already.
    """
    vertices, faces = colon.lumen.vertices, colon.lumen.faces
    if count < len(faces):
        raise InvalidOptionError(f"'{colon.name}' has {len(faces)} triangles already: give at least as many.")
    while len(faces) + 1 < count:
        vertices, faces = _halve(vertices, faces, (count - len(faces)) // 2)
    return replace(colon, lumen=Surface(vertices, faces))


def _halve(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], most: int
) -> tuple[Float[np.ndarray, "w 3"], Int[np.ndarray, "g 3"]]:
    """Halve up to `most` inner edges, no two of one triangle."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    own, inverse, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    length = np.linalg.norm(vertices[own[:, 0]] - vertices[own[:, 1]], axis=1)
    of_face = inverse.reshape(-1, 3)
    # An edge is halved when it is the longest of both its triangles: such edges share no triangle.
    order = np.empty(len(own), dtype=int)
    order[np.argsort(-length, kind="stable")] = np.arange(len(own))
    longest = of_face[np.arange(len(faces)), order[of_face].argmin(1)]
    votes = np.bincount(longest, minlength=len(own))
    chosen = np.flatnonzero((votes == 2) & (counts == 2))
    chosen = chosen[np.argsort(order[chosen])][:most]
    middle = np.full(len(own), -1)
    middle[chosen] = len(vertices) + np.arange(len(chosen))
    added = vertices[own[chosen]].mean(axis=1)
    split = np.flatnonzero(middle[longest] >= 0)
    side = order[of_face[split]].argmin(1)
    turned = faces[split[:, None], (side[:, None] + np.arange(3)) % 3]
    new = middle[longest[split]]
    halves = np.concatenate(
        [
            np.stack([turned[:, 0], new, turned[:, 2]], axis=1),
            np.stack([new, turned[:, 1], turned[:, 2]], axis=1),
        ]
    )
    kept = np.delete(faces, split, axis=0)
    return np.concatenate([vertices, added]), np.concatenate([kept, halves]).astype(faces.dtype)
