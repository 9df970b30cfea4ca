"""A round tube as a colon, and a wall of exact wedges round it: the simplest lumen there is."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Surface
from haustra.models.wall.pieces.wall import Wall, WallAccuracy, WallPiece
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


def square_tube(length: float = 0.6) -> Colon:
    """Straight tube with four flat sides, a corner each towards x and y, as `wedge_wall` of four sectors."""
    return replace(straight_tube(length), lumen=_cylinder(length, RADIUS / np.cos(np.pi / 4), 4))


def folded_tube(length: float = 0.2, *, gap: float = 0.008, thickness: float = 0.002) -> Colon:
    """Straight tube with a flat fold all round in the middle, that leaves a round gap of that radius [m]."""
    tube, half = straight_tube(length), 0.5 * thickness
    steps = np.linspace(0.0, 1.0, 8)
    side = np.column_stack([RADIUS + steps * (gap - RADIUS), np.full(8, 0.5 * length - half)])
    lower = np.column_stack([np.full(16, RADIUS), np.linspace(0.0, 0.5 * length - half, 17)[:-1]])
    near = np.concatenate([lower, side])
    profile = np.concatenate([near, np.array([0, length]) + near[::-1] * [1, -1]])
    angles = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
    rings = np.stack([profile[:, :1] * np.cos(angles), profile[:, :1] * np.sin(angles)], axis=2)
    height = np.broadcast_to(profile[:, 1, None, None], (*rings.shape[:2], 1))
    vertices = np.vstack([np.concatenate([rings, height], axis=2).reshape(-1, 3), [[0, 0, 0], [0, 0, length]]])
    faces, last = [], len(profile) - 1
    for k in range(_ANGLES):
        after = (k + 1) % _ANGLES
        for ring in _ANGLES * np.arange(last):
            faces += [[ring + k, ring + after, ring + _ANGLES + k]]
            faces += [[ring + after, ring + _ANGLES + after, ring + _ANGLES + k]]
        top, caps = _ANGLES * last, len(vertices) - 2
        faces += [[caps, after, k], [caps + 1, top + k, top + after]]
    stations = tube.centreline.arc
    within = np.abs(stations - 0.5 * length) < half
    radius = np.where(within, gap, RADIUS)[:, None] * np.ones(_ANGLES)
    return replace(tube, lumen=Surface(vertices=vertices, faces=np.array(faces)), radius=radius)


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
    error = WallAccuracy(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 0)
    return Wall("prism", tuple(pieces), error, Provenance(inputs={}, configuration={}), {})


def _cylinder(length: float, radius: float = RADIUS, sides: int = _ANGLES) -> Surface:
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    lower = np.column_stack([ring, np.zeros(sides)])
    upper = np.column_stack([ring, np.full(sides, length)])
    vertices = np.vstack([lower, upper, [[0, 0, 0], [0, 0, length]]])
    faces = []
    for k in range(sides):
        after = (k + 1) % sides
        faces += [[k, after, sides + k], [after, sides + after, sides + k]]
        faces += [[2 * sides, after, k], [2 * sides + 1, sides + k, sides + after]]
    return Surface(vertices=vertices, faces=np.array(faces))
