"""Triangles as a set of sheets: consistent winding, and edges where more than two triangles meet taken apart."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True)
class Sheets:
    """Triangles in which every vertex has one fan, so that open edges form simple loops."""

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "triangles 3"]
    rims: tuple[tuple[int, ...], ...]
    """Vertices around each opening, in the direction of the triangles' own edges."""
    turned: int
    """Triangles whose winding was changed to agree with their neighbours'."""
    parted: int
    """Edges at which more than two triangles met."""


def make_sheets(vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "triangles 3"]) -> Sheets:
    """Wind neighbours alike and give every fan of triangles its own vertex.

    Where an even number of triangles shares an edge they are joined in pairs with the inside between them: two lumens
    that touch along an edge part there. Of an odd number the straightest pairs are joined; what is left over, a fin,
    becomes part of a rim.
    """
    edges = _Edges(faces)
    flip = _disagreeing(edges, len(faces))
    if flip.sum() * 2 > len(faces):
        flip = ~flip  # the fewer are turned; which side is out is decided later
    faces = np.where(flip[:, None], faces[:, ::-1], faces)
    edges = _Edges(faces)
    one, two = edges.partners(vertices, faces)
    vertices, faces, open_halves = _with_own_vertices(vertices, faces, one, two)
    return Sheets(vertices, faces, _loops(faces, open_halves), int(flip.sum()), edges.crowded)


def part_doubled_edges(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "triangles 3"]
) -> tuple[Float[np.ndarray, "more_vertices 3"], Int[np.ndarray, "more_triangles 3"]]:
    """Give sheets that run along the same edge, joined at both its ends, an edge of their own: a vertex halfway.

    Edges with more than four triangles, or with an odd number, are left as they are.
    """
    edges = _Edges(faces)
    added, new_faces, used = [], faces.tolist(), set()
    for edge in np.flatnonzero(edges.count == 4):
        halves = edges.order[edges.first[edge] : edges.first[edge] + 4]
        pairs = _pair_around(vertices, faces, halves, edges.forward[halves])
        if len(pairs) < 2 or used & {half // 3 for half in pairs[1]}:
            continue
        middle = len(vertices) + len(added)
        added.append(vertices[faces[halves[0] // 3, [halves[0] % 3, (halves[0] % 3 + 1) % 3]]].mean(0))
        for half in pairs[1]:
            face, corner = half // 3, half % 3
            used.add(face)
            u, v, w = (int(faces[face, (corner + k) % 3]) for k in range(3))
            new_faces[face] = [u, middle, w]
            new_faces.append([middle, v, w])
    if not added:
        return vertices, faces
    return np.concatenate([vertices, added]), np.array(new_faces, dtype=faces.dtype)


class _Edges:
    """Half-edges of triangles, sorted so that those on the same edge stand together."""

    def __init__(self, faces: Int[np.ndarray, "triangles 3"]):
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        self.forward = start < end
        low, high = np.minimum(start, end).astype(np.int64), np.maximum(start, end).astype(np.int64)
        key = low * (int(faces.max()) + 1) + high
        self.order = np.argsort(key, kind="stable")
        ordered = key[self.order]
        self.first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
        self.count = np.diff(np.append(self.first, len(key)))

    @property
    def crowded(self) -> int:
        """Number of edges with more than two triangles."""
        return int((self.count > 2).sum())

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """The two half-edges of each edge that has exactly two."""
        at = self.first[self.count == 2]
        return self.order[at], self.order[at + 1]

    def partners(self, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of half-edges that join two triangles; both run along the edge in opposite directions."""
        one, two = self.pairs()
        opposite = self.forward[one] != self.forward[two]
        joined = [(one[opposite], two[opposite])]
        for edge in np.flatnonzero(self.count > 2):
            halves = self.order[self.first[edge] : self.first[edge] + self.count[edge]]
            found = _pair_around(vertices, faces, halves, self.forward[halves])
            if found:
                joined.append(tuple(np.array(found, dtype=np.int64).T))
        return np.concatenate([a for a, _ in joined]), np.concatenate([b for _, b in joined])


def _disagreeing(edges: _Edges, count: int) -> Bool[np.ndarray, " triangles"]:
    """Triangles to turn so that neighbours across plain edges are wound alike.

    Every triangle stands twice in a graph, as it is and turned; neighbours are linked in the states that agree. Of the
    two mirrored components of each sheet, the first is taken. On a one-sided sheet both are one: nothing is turned.
    """
    one, two = edges.pairs()
    alike = edges.forward[one] != edges.forward[two]
    a, b = one // 3, two // 3
    rows = np.concatenate([a, a + count])
    columns = np.concatenate([np.where(alike, b, b + count), np.where(alike, b + count, b)])
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(2 * count,) * 2)
    _, label = connected_components(graph, directed=False)
    return label[:count] > label[count:]


def _pair_around(
    vertices: np.ndarray, faces: np.ndarray, halves: np.ndarray, forward: np.ndarray
) -> list[tuple[int, int]]:
    """Join half-edges around a crowded edge, each forward one to one backward one."""
    face, corner = halves // 3, halves % 3
    ends = faces[face, corner], faces[face, (corner + 1) % 3]
    base = vertices[np.where(forward, *ends)]
    along = vertices[np.where(forward, ends[1], ends[0])][0] - base[0]
    along = along / max(float(np.linalg.norm(along)), 1e-30)
    away = vertices[faces[face, (corner + 2) % 3]] - base
    away = away - (away @ along)[:, None] * along
    other = np.eye(3)[np.argmin(np.abs(along))]
    axis = np.cross(along, other)
    axis /= np.linalg.norm(axis)
    angle = np.arctan2(away @ np.cross(along, axis), away @ axis)
    # The normal of a forward triangle points to larger angles, out of the body; the inner angle to a backward one:
    one, two = np.flatnonzero(forward), np.flatnonzero(~forward)
    inner = (angle[one][:, None] - angle[two]) % (2 * np.pi)
    # Bodies that touch part: the smallest inner angle first. With a fin among them: those that go on straight.
    cost = np.abs(inner - np.pi) if len(halves) % 2 else inner
    found: list[tuple[int, int]] = []
    for _ in range(min(len(one), len(two))):
        i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
        found.append((int(halves[one[i]]), int(halves[two[j]])))
        cost[i], cost[:, j] = np.inf, np.inf
    return found


def _with_own_vertices(
    vertices: np.ndarray, faces: np.ndarray, one: np.ndarray, two: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices such that only corners joined by paired edges share one; and the half-edges without a partner."""
    corners = faces.size
    after = np.arange(corners) + np.where(np.arange(corners) % 3 == 2, -2, 1)
    rows, columns = np.concatenate([one, after[one]]), np.concatenate([after[two], two])
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(corners, corners))
    count, label = connected_components(graph, directed=False)
    source = np.empty(count, np.int64)
    source[label] = faces.ravel()
    lonely = np.ones(corners, bool)
    lonely[one], lonely[two] = False, False
    halves = np.flatnonzero(lonely)
    return vertices[source], label.reshape(-1, 3).astype(np.int64), halves


def _loops(faces: np.ndarray, halves: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """Closed chains of half-edges without a partner; each vertex has one fan, so it begins at most one."""
    start = faces.ravel()[halves]
    end = faces[halves // 3, (halves % 3 + 1) % 3]
    following = dict(zip(start.tolist(), end.tolist(), strict=True))
    loops = []
    while following:
        loop = [next(iter(following))]
        while (after := following.pop(loop[-1])) != loop[0]:
            loop.append(after)
        loops.append(tuple(loop))
    return tuple(loops)
