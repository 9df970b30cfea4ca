"""Splitting and collapsing many edges of a closed surface at once, without changing its topology."""

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array

SPLIT_ABOVE, COLLAPSE_BELOW = 4 / 3, 4 / 5
"""Edges beyond these shares of the wanted length are split or collapsed: halves and doubles fall between them."""
PASSES = 12
"""Passes over edges of which none touches another; what is left after them waits for the next round."""
LEAST_TURN = 0.3
"""Cosine between a triangle's normals before and after a collapse: less is a fold."""


def split_long(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "triangles 3"],
    wanted: Float[np.ndarray, " vertices"],
) -> tuple[Float[np.ndarray, "more 3"], Int[np.ndarray, "more_triangles 3"]]:
    """Halve edges that are longer than wanted [m], the longest of each triangle first."""
    for _ in range(PASSES):
        edge, of_face = _edges(faces)
        length = np.linalg.norm(vertices[edge[:, 0]] - vertices[edge[:, 1]], axis=1)
        excess = length / (0.5 * (wanted[edge[:, 0]] + wanted[edge[:, 1]]))
        rank = excess[of_face] + 1e-9 * of_face / len(edge)  # no ties, so that both triangles agree
        best = of_face[np.arange(len(faces)), rank.argmax(1)]
        chosen = (np.bincount(best, minlength=len(edge)) == 2) & (excess > SPLIT_ABOVE)
        if not chosen.any():
            break
        middle = np.full(len(edge), -1)
        middle[chosen] = len(vertices) + np.arange(int(chosen.sum()))
        ends = edge[chosen]
        vertices = np.concatenate([vertices, vertices[ends].mean(1)])
        wanted = np.concatenate([wanted, wanted[ends].mean(1)])
        cut = chosen[best]
        side = rank.argmax(1)[cut]
        rows = np.arange(int(cut.sum()))
        u, v, w = (faces[cut][rows, (side + k) % 3] for k in range(3))
        m = middle[best[cut]]
        faces = np.concatenate([faces[~cut], np.stack([u, m, w], axis=1), np.stack([m, v, w], axis=1)])
    return vertices, faces


def collapse_short(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "triangles 3"],
    wanted: Float[np.ndarray, " vertices"],
) -> tuple[Float[np.ndarray, "fewer 3"], Int[np.ndarray, "fewer_triangles 3"]]:
    """Contract edges that are shorter than wanted [m] to their middle, where that keeps topology and folds nothing."""
    rng = np.random.Generator(np.random.PCG64(0))
    for _ in range(PASSES):
        edge, _ = _edges(faces)
        n = len(vertices)
        length = np.linalg.norm(vertices[edge[:, 0]] - vertices[edge[:, 1]], axis=1)
        short = np.flatnonzero(length < COLLAPSE_BELOW * 0.5 * (wanted[edge[:, 0]] + wanted[edge[:, 1]]))
        links = coo_array((np.ones(len(edge), np.int32), (edge[:, 0], edge[:, 1])), shape=(n, n)).tocsr()
        links = links + links.T
        a, b = edge[short].T
        common = np.asarray(links[a].multiply(links[b]).sum(axis=1)).ravel()
        short = short[common == 2]  # the link condition: otherwise a handle or a pocket would close
        chosen = short[_apart(edge[short], links, rng)]
        chosen = chosen[_keeps_normals(vertices, faces, edge[chosen])]
        if len(chosen) == 0:
            break
        a, b = edge[chosen].T
        vertices = vertices.copy()
        vertices[a] = 0.5 * (vertices[a] + vertices[b])
        target = np.arange(n)
        target[b] = a
        faces = target[faces]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
        used, numbered = np.unique(faces, return_inverse=True)
        vertices, wanted, faces = vertices[used], wanted[used], numbered.reshape(-1, 3)
    return vertices, faces


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges, each once, and for each triangle the numbers of its three (corner to next corner)."""
    size = int(faces.max()) + 1
    start, end = faces, np.roll(faces, -1, axis=1)
    key = np.minimum(start, end).astype(np.int64) * size + np.maximum(start, end)
    found, number = np.unique(key, return_inverse=True)
    return np.stack([found // size, found % size], axis=1), number.reshape(-1, 3)


def _apart(edge: np.ndarray, links, rng: np.random.Generator) -> np.ndarray:
    """Edges no two of which have ends that are the same or neighbours, chosen at random."""
    n = links.shape[0]
    priority = rng.permutation(len(edge)) + 1.0
    at = np.zeros(n)
    np.maximum.at(at, edge[:, 0], priority)
    np.maximum.at(at, edge[:, 1], priority)
    for _ in range(2):  # the highest priority within two links: ends and their neighbours
        spread = links.astype(float).multiply(at[None, :]).tocsr().max(axis=1).toarray().ravel()
        at = np.maximum(at, spread)
    return np.flatnonzero((at[edge[:, 0]] == priority) & (at[edge[:, 1]] == priority))


def _keeps_normals(vertices: np.ndarray, faces: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Whether contracting each edge leaves the triangles around it turned as they were."""
    n = len(vertices)
    owner = np.full(n, -1)
    owner[edge[:, 0]] = owner[edge[:, 1]] = np.arange(len(edge))
    moved = vertices.copy()
    moved[edge[:, 0]] = moved[edge[:, 1]] = 0.5 * (vertices[edge[:, 0]] + vertices[edge[:, 1]])
    of_face = owner[faces]
    touched = (of_face >= 0).any(1)
    own, corner = of_face[touched], faces[touched]
    vanishing = (np.sort(own, axis=1)[:, 1] == own.max(1)) & ((own >= 0).sum(1) == 2)
    own, corner = own[~vanishing], corner[~vanishing]
    before, after = (_normal(points[corner]) for points in (vertices, moved))
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    bad = (before * after).sum(1) < LEAST_TURN * size + 1e-30
    keep = np.ones(len(edge), bool)
    keep[own[bad].max(1)] = False
    return keep


def _normal(corners: np.ndarray) -> np.ndarray:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
