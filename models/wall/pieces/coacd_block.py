"""One block decomposed by CoACD (Wei et al. 2022, doi 10.1145/3528223.3530103), and made to keep the tolerance.

Runs in a child process only: CoACD ends the process on some meshes and never returns on others.
"""

from collections.abc import Iterator

import coacd
import numpy as np
from manifold3d import Manifold

from haustra.models.wall.pieces.blocks import SLIVER, Block
from haustra.models.wall.pieces.split import convex_parts, face_planes, intrusion

MILLIMETRE = 1e3
MOST_VERTICES = 64
"""Vertices of a hull at most: MuJoCo's collision cost grows with them, and blocks need far fewer."""
SEARCH = {
    "preprocess_mode": "off",  # the blocks are sound already, and preprocessing would move their shared corners
    "real_metric": True,
    "mcts_iterations": 20,
    "mcts_nodes": 6,
    "mcts_max_depth": 2,
    "resolution": 300,
    "max_ch_vertex": MOST_VERTICES,
    "seed": 0,
}
"""A reduced search: these blocks are small, and what it leaves too deep is cut further."""
THRESHOLD = 2.0
"""CoACD's concavity over the tolerance; at 1.3 it takes 2.4 times as long and leaves a fifth more pieces."""


def coacd_parts(block: Block, *, tolerance: float) -> Iterator[Manifold]:
    """Hulls whose union covers the block and stands at most `tolerance` [m] in the lumen.

    Parts that CoACD leaves deeper than that are cut further.
    """
    coacd.set_log_level("error")
    mesh = block.solid.to_mesh64()
    vertices = np.asarray(mesh.vert_properties)[:, :3] * MILLIMETRE
    faces = np.asarray(mesh.tri_verts).astype(np.int32)
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=THRESHOLD * tolerance * MILLIMETRE, **SEARCH)
    for corners, _ in parts:
        hull = Manifold.hull_points(np.asarray(corners, dtype=float) / MILLIMETRE)
        if hull.volume() <= SLIVER:
            continue
        solid = hull ^ block.solid
        planes = (*block.planes, *face_planes(hull))
        for piece in solid.decompose():
            if piece.volume() <= SLIVER:
                continue
            part = Block(piece, planes, block.site)
            if intrusion(piece, hull, planes).depth <= tolerance:
                yield hull
                break
            yield from convex_parts(part, tolerance=tolerance)
