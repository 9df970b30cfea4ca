"""What a colon measures."""

from dataclasses import asdict

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from haustra.models.anatomy.centring import LONGEST_LEAD
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.frames import curvature
from haustra.models.anatomy.lumen_grid import surface_samples
from haustra.models.anatomy.repair import genus, is_watertight, signed_volume
from haustra.models.anatomy.section import effective_diameter

CLEARANCE_SAMPLES = 1e-3
"""Spacing of the surface samples for the clearance [m]: it is too large by at most 0.06 mm where it is 2 mm."""
_SEARCH_ERROR = 0.005
"""Relative error that the search for the nearest sample may make: the middle of a tube is as far from most of them."""


_LEAF = 32
"""Samples in a leaf of the search tree: in the middle of a tube most leaves are opened, and larger ones are faster."""


class Clearance:
    """Distance from positions to a surface [m], by samples on it; never too small, and too large by at most 0.5 %."""

    def __init__(self, surface: Surface, *, spacing: float = CLEARANCE_SAMPLES):
        """Sample the surface at `spacing` [m]."""
        self._tree = KDTree(surface_samples(surface, spacing), leafsize=_LEAF)

    def __call__(self, positions: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """Distance of each position to the surface [m]."""
        return self._tree.query(positions, eps=_SEARCH_ERROR)[0]


def describe(colon: Colon) -> dict:
    """Measures of a colon as JSON values, units in the names; the clearance is that between the ends, not at them."""
    line = colon.centreline
    diameter = effective_diameter(line, colon.radius)
    between = line.points[(line.arc >= LONGEST_LEAD) & (line.arc <= line.length - LONGEST_LEAD)]
    segments = {}
    for segment in colon.segments:
        inside = (line.arc >= segment.start) & (line.arc <= segment.end)
        segments[segment.name] = {
            "start_m": segment.start,
            "end_m": segment.end,
            "mean_diameter_m": float(np.sqrt((diameter[inside] ** 2).mean())),
        }
    return {
        "name": colon.name,
        "length_m": line.length,
        "volume_m3": signed_volume(colon.lumen.vertices, colon.lumen.faces),
        "triangles": len(colon.lumen.faces),
        "watertight": is_watertight(colon.lumen.faces),
        "genus": genus(colon.lumen.faces),
        "segments": segments,
        "landmarks_m": dict(colon.landmarks),
        "centreline_min_clearance_m": float(Clearance(colon.lumen)(between).min()),
        "turning_deg": float(np.degrees(np.trapezoid(curvature(line.points), line.arc))),
        "lesions": [asdict(lesion) for lesion in colon.lesions],
        "warnings": list(colon.warnings),
    }
