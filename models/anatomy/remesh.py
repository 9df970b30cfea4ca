"""Triangles whose size follows the wall's curvature and the lumen's radius.

After the virtual-reality simulator's colon model, whose triangles take their edges from the local radius of curvature.
There a front of triangles grows over points; here the surface that exists is split, collapsed and relaxed, which keeps
it closed and keeps its handles: Botsch, Kobbelt 2004, A Remeshing Approach to Multiresolution Modeling.
"""

from dataclasses import replace

import manifold3d
import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_array
from scipy.spatial import KDTree

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.edge_operations import collapse_short, split_long
from haustra.models.anatomy.lumen_grid import surface_samples
from haustra.models.anatomy.rays import LumenRays, lumen_table
from haustra.models.anatomy.repair import genus, is_watertight

SAGITTA = 0.05
"""Edges stand off a wall of radius of curvature R by e^2 / 8R; they are chosen so that this is the share below of R."""
OF_CURVATURE = float(np.sqrt(8 * SAGITTA))
"""Edge length over radius of curvature, 0.63: ten edges round a circle."""
OF_RADIUS = 0.3
"""Edge length over the lumen's radius at most: twenty-one round a cross-section."""
SHORTEST, LONGEST = 1.5e-3, 8e-3
"""Edges [m]: shorter ones are finer than a CT's voxels, longer ones than haustra allow."""
ROUNDS = 4
"""Rounds of splitting, collapsing and relaxing; more change the number of triangles by less than 2 %."""
HAUSDORFF_SPACING = 5e-4
"""Spacing of the samples between which the distance is measured [m]."""


def remeshed(colon: Colon) -> tuple[Colon, dict[str, float]]:
    """The colon with scale-adaptive triangles, and what that changed.

    Returns:
        The colon (same centreline, radius measured anew), and a report: `triangles_before`, `triangles`, and the
        distance between both surfaces `hausdorff_m`, `p95_m` and `rms_m`.

    Raises:
        InvalidMeshError: when the new surface lost its shape.
    """
    size = target_edges(colon)
    surface = fit_triangles(colon.lumen, size)
    if not is_watertight(surface.faces) or genus(surface.faces) != genus(colon.lumen.faces):
        raise InvalidMeshError("Remeshing changed the surface's topology: import it without --remesh.")
    distance = _distance(colon.lumen, surface)
    report = {
        "triangles_before": float(len(colon.lumen.faces)),
        "triangles": float(len(surface.faces)),
        "hausdorff_m": float(distance.max()),
        "p95_m": float(np.percentile(distance, 95)),
        "rms_m": float(np.sqrt((distance**2).mean())),
    }
    line = colon.centreline
    rays = LumenRays(surface)
    if not rays.clear(line.points[:-1], line.points[1:]).all():
        raise InvalidMeshError("Remeshing moved the wall across the centreline: import it without --remesh.")
    note = (
        f"Remeshed from {len(colon.lumen.faces)} to {len(surface.faces)} triangles; both surfaces are within "
        f"{report['hausdorff_m'] * 1e3:.2f} mm of each other (95 %: {report['p95_m'] * 1e3:.2f} mm)."
    )
    radius = lumen_table(rays, line.points, line.frames, colon.radius.shape[1])
    return replace(colon, lumen=surface, radius=radius, warnings=(*colon.warnings, note)), report


def target_edges(colon: Colon) -> Float[np.ndarray, " vertices"]:
    """Edge length [m] wanted at each vertex of the lumen: by curvature, never more than a share of the radius."""
    vertices, faces = colon.lumen.vertices, colon.lumen.faces
    _, station = KDTree(colon.centreline.points).query(vertices)
    by_radius = OF_RADIUS * np.sqrt((colon.radius**2).mean(1))[station]
    mesh = manifold3d.Mesh64(vert_properties=np.ascontiguousarray(vertices), tri_verts=faces.astype(np.uint64))
    bent = manifold3d.Manifold(mesh).calculate_curvature(-1, 0).to_mesh64()
    if len(bent.vert_properties) != len(vertices):
        return np.clip(by_radius, SHORTEST, LONGEST)
    mean = np.asarray(bent.vert_properties)[:, 3]
    order = KDTree(np.asarray(bent.vert_properties)[:, :3]).query(vertices)[1]
    smooth = _smoothed(np.abs(mean[order]), faces, len(vertices))
    by_curvature = OF_CURVATURE / np.maximum(smooth, 1e-9)
    wanted = np.clip(np.minimum(by_radius, by_curvature), SHORTEST, LONGEST)
    return _smoothed(wanted, faces, len(vertices))


def fit_triangles(surface: Surface, size: Float[np.ndarray, " vertices"]) -> Surface:
    """Split, collapse and relax until edges have about the wanted length [m] at their ends.

    Vertices stay on the samples of the original surface.
    """
    vertices, faces = surface.vertices, surface.faces
    anchor = KDTree(surface.vertices)
    samples = KDTree(surface_samples(surface, HAUSDORFF_SPACING))

    def wanted(points: np.ndarray) -> np.ndarray:
        return size[anchor.query(points)[1]]

    for _ in range(ROUNDS):
        vertices, faces = split_long(vertices, faces, wanted(vertices))
        vertices, faces = collapse_short(vertices, faces, wanted(vertices))
        vertices = _relaxed(vertices, faces, samples)
    return Surface(vertices, faces)


def _relaxed(vertices: np.ndarray, faces: np.ndarray, samples: KDTree) -> np.ndarray:
    """Move each vertex within its tangent plane towards its neighbours' mean, then onto the original surface."""
    normals = _normals(vertices, faces)
    move = _smoothed(vertices, faces, len(vertices)) - vertices
    move -= (move * normals).sum(1)[:, None] * normals
    tried = vertices + 0.5 * move
    distance, index = samples.query(tried)
    onto = samples.data[index]
    # Sideways the samples are half a millimetre apart: only the way along the normal is taken from them.
    back = ((onto - tried) * normals).sum(1)[:, None] * normals
    moved = np.where((distance < HAUSDORFF_SPACING * 2)[:, None], tried + back, vertices)
    before, after = _face_normals(vertices, faces), _face_normals(moved, faces)
    turned = (before * after).sum(1) < 0.5 * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    moved[faces[turned].ravel()] = vertices[faces[turned].ravel()]
    return moved


def _smoothed(values: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """Mean of each vertex's neighbours."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count)).tocsr()
    degree = np.asarray(links.sum(axis=1)).ravel()
    total = links @ values
    return total / (degree if values.ndim == 1 else degree[:, None])


def _face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals of vertices, weighted by area."""
    normals = np.zeros_like(vertices)
    area = _face_normals(vertices, faces)
    for k in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(faces[:, k], weights=area[:, axis], minlength=len(vertices))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def _distance(one: Surface, other: Surface) -> Float[np.ndarray, " samples"]:
    """Distances [m] between samples of both surfaces, both ways; too large by at most half the spacing."""
    a, b = surface_samples(one, HAUSDORFF_SPACING), surface_samples(other, HAUSDORFF_SPACING)
    return np.concatenate([KDTree(b).query(a)[0], KDTree(a).query(b)[0]])
