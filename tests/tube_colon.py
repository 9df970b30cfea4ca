"""A round tube as a colon, and a wall of exact wedges round it: the simplest lumen there is."""

from itertools import pairwise

import numpy as np

from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Surface
from haustra.models.wall.wall import Wall, WallError, WallPiece
from haustra.provenance import Provenance

RADIUS = 0.02
_ANGLES = 48


def straight_tube(length: float = 0.6) -> Colon:
    """Along +z from the origin."""
    stations = round(length / 0.002) + 1
    arc = np.linspace(0.0, length, stations)
    points = np.column_stack([np.zeros((stations, 2)), arc])
    frames = np.broadcast_to(np.eye(3), (stations, 3, 3)).copy()
    return Colon(
        name="straight tube",
        lumen=_cylinder(length),
        centreline=Centreline(points=points, arc=arc, frames=frames),
        radius=np.full((stations, _ANGLES), RADIUS),
        segments=(ColonSegment("rectum", 0.0, length / 2), ColonSegment("sigmoid", length / 2, length)),
        provenance=Provenance(inputs={}, configuration={}),
    )


def wedge_wall(length: float = 0.6, *, sectors: int = 12, slabs: int = 3, thickness: float = 0.03) -> Wall:
    """Wedges whose flat inner faces touch the tube's circle from outside."""
    pieces = []
    edges = np.linspace(0.0, length, slabs + 1)
    for low, high in pairwise(edges):
        for sector in range(sectors):
            angles = 2 * np.pi * (sector + np.array([0, 1])) / sectors
            inner = RADIUS / np.cos(np.pi / sectors)
            corners = [
                [radius * np.cos(angle), radius * np.sin(angle), z]
                for radius in (inner, inner + thickness)
                for angle in angles
                for z in (low, high)
            ]
            pieces.append(WallPiece(vertices=np.array(corners), start=float(low), end=float(high)))
    error = WallError(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 0)
    return Wall("prism", tuple(pieces), error, Provenance(inputs={}, configuration={}), {})


def _cylinder(length: float) -> Surface:
    angles = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
    ring = RADIUS * np.column_stack([np.cos(angles), np.sin(angles)])
    lower = np.column_stack([ring, np.zeros(_ANGLES)])
    upper = np.column_stack([ring, np.full(_ANGLES, length)])
    vertices = np.vstack([lower, upper, [[0, 0, 0], [0, 0, length]]])
    faces = []
    for k in range(_ANGLES):
        after = (k + 1) % _ANGLES
        faces += [[k, after, _ANGLES + k], [after, _ANGLES + after, _ANGLES + k]]
        faces += [[2 * _ANGLES, after, k], [2 * _ANGLES + 1, _ANGLES + k, _ANGLES + after]]
    return Surface(vertices=vertices, faces=np.array(faces))
