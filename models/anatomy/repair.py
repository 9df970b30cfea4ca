"""From triangles as people export them to one closed, outward-wound lumen surface, saying what was done."""

from dataclasses import dataclass

import manifold3d
import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.manifold import Sheets, make_sheets, part_doubled_edges

WELD_SHARE = 1e-6
"""Vertices nearer than this share of the largest extent are one: single precision in a mesh file resolves 1e-7."""
LARGEST_OPENING = 0.35
"""Longest rim that is closed with a lid [m]: an anus or an ileum cut open has less; more is a missing wall."""
PINHOLE = 0.02
"""Openings less than this around [m] are counted apart: flaws of the meshing, not ends of the colon."""


@dataclass(frozen=True)
class Repaired:
    """A closed surface and what it took to get there."""

    surface: Surface
    notes: tuple[str, ...]
    """What was done, one line each; empty when the surface came closed."""


def repair(surface: Surface) -> Repaired:
    """Weld, wind alike, part what touches along an edge, keep the largest piece, close rims, check with manifold3d.

    Args:
        surface: Triangles with coordinates in [m].

    Raises:
        InvalidMeshError: when the result is not a closed surface.
    """
    notes: list[str] = []
    sheets = make_sheets(*_weld(surface, notes))
    if sheets.turned:
        notes.append(f"Turned {sheets.turned} triangles to agree with their neighbours.")
    if sheets.parted:
        notes.append(f"Took apart {sheets.parted} edges at which more than two triangles met.")
    vertices, faces = _close_rims(sheets, notes)
    vertices, faces = _main_piece(*part_doubled_edges(vertices, faces), notes)
    if signed_volume(vertices, faces) < 0:
        faces = faces[:, ::-1]
        notes.append("Turned the surface outwards.")
    return Repaired(_as_manifold(vertices, faces), tuple(notes))


def signed_volume(vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "triangles 3"]) -> float:
    """Enclosed volume [m^3] by the divergence theorem; negative when wound inwards."""
    a, b, c = np.moveaxis((vertices - vertices.mean(0))[faces], 1, 0)
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)


def euler_number(faces: Int[np.ndarray, "triangles 3"]) -> int:
    """Vertices less edges plus triangles, counting vertices in use."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return len(np.unique(faces)) - len(np.unique(edges, axis=0)) + len(faces)


def genus(faces: Int[np.ndarray, "triangles 3"]) -> int:
    """Number of handles of one closed surface: 0 for a tube with closed ends."""
    return (2 - euler_number(faces)) // 2


def is_watertight(faces: Int[np.ndarray, "triangles 3"]) -> bool:
    """Whether every edge is met exactly once in each direction."""
    return len(open_edges(faces)) == 0


def open_edges(faces: Int[np.ndarray, "triangles 3"]) -> Int[np.ndarray, "edges 2"]:
    """Directed edges whose opposite is missing or that occur more than once."""
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    size = int(faces.max()) + 1
    forward, count = np.unique(directed[:, 0] * size + directed[:, 1], return_counts=True)
    backward = np.unique(directed[:, 1] * size + directed[:, 0])
    bad = ~np.isin(forward, backward) | (count > 1)
    return np.stack([forward[bad] // size, forward[bad] % size], axis=1)


def _weld(surface: Surface, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    extent = float(np.ptp(surface.vertices[np.unique(surface.faces)], axis=0).max())
    if extent == 0.0:
        raise InvalidMeshError("All triangles lie in one point: the surface has no size.")
    cell = np.round((surface.vertices - surface.vertices.min(0)) / (WELD_SHARE * extent)).astype(np.int64)
    _, first, label = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    faces = label.reshape(-1)[surface.faces]
    degenerate = (faces == np.roll(faces, 1, axis=1)).any(1)
    faces = faces[~degenerate]
    _, unique = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if doubled := len(faces) - len(unique):
        notes.append(f"Removed {doubled} triangles that occurred twice.")
    if degenerate.any():
        notes.append(f"Removed {int(degenerate.sum())} triangles without area.")
    if len(unique) == 0:
        raise InvalidMeshError("No triangle of the surface has an area.")
    return _compact(surface.vertices[first], faces[np.sort(unique)])


def _main_piece(vertices: np.ndarray, faces: np.ndarray, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """The piece with the largest area: crumbs may have many triangles."""
    edges = faces[:, [0, 1, 1, 2]].reshape(-1, 2).T
    links = coo_array((np.ones(edges.shape[1], np.int8), (edges[0], edges[1])), shape=(len(vertices),) * 2)
    pieces, label = connected_components(links, directed=False)
    if pieces == 1:
        return _compact(vertices, faces)
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = np.bincount(label[faces[:, 0]], weights=area, minlength=pieces)
    kept = label[faces[:, 0]] == size.argmax()
    pieces = len(np.unique(label[faces[:, 0]]))
    if pieces > 1:
        notes.append(f"Kept the largest of {pieces} separate pieces ({kept.sum()} of {len(faces)} triangles).")
    return _compact(vertices, faces[kept])


def _close_rims(sheets: Sheets, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Close each rim by a fan about its centre; rims of main interest first, so that crumbs don't stop the repair."""
    vertices, faces = sheets.vertices, sheets.faces
    if not sheets.rims:
        return vertices, faces
    centres, lids, pinholes = [], [], 0
    for loop in sheets.rims:
        around = vertices[list(loop)]
        length = float(np.linalg.norm(around - np.roll(around, 1, axis=0), axis=1).sum())
        if length > LARGEST_OPENING:
            raise InvalidMeshError(
                f"The surface has an opening {length * 1e3:.0f} mm around, more than {LARGEST_OPENING * 1e3:.0f}: "
                "a part of the wall is missing."
            )
        pinholes += length <= PINHOLE
        centre = len(vertices) + len(centres)
        centres.append(around.mean(0))
        lids += [(b, a, centre) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
    if pinholes:
        notes.append(f"Filled {pinholes} pinholes, up to {PINHOLE * 1e3:.0f} mm around.")
    if larger := len(centres) - pinholes:
        notes.append(f"Closed {larger} openings with lids.")
    return np.concatenate([vertices, centres]), np.concatenate([faces, np.array(lids, dtype=faces.dtype)])


def _as_manifold(vertices: np.ndarray, faces: np.ndarray) -> Surface:
    if len(bad := open_edges(faces)):
        raise InvalidMeshError(f"The surface is not closed along {len(bad)} edges: repair it in a mesh editor first.")
    mesh = manifold3d.Mesh64(vert_properties=np.ascontiguousarray(vertices), tri_verts=faces.astype(np.uint64))
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        raise InvalidMeshError(f"The surface encloses no solid ({solid.status().name}): repair it in a mesh editor.")
    return Surface(vertices=vertices, faces=faces)


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop vertices that no triangle uses."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)
