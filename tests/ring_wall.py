"""A wall straight from a colon's radius field, quick to make: for tests that need a lumen and not its exact error."""

from itertools import pairwise

import numpy as np

from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.tube import tube
from haustra.models.wall.pieces.wall import Wall, WallAccuracy, WallPiece
from haustra.provenance import Provenance


def ring_wall(colon: Colon, *, sectors: int = 16, slab: float = 0.005, thickness: float = 0.006) -> Wall:
    """Wedges between neighbouring rings of the radius field; their hulls stand in the lumen by some 0.2 mm."""
    line = colon.centreline
    step = max(1, round(slab / (line.arc[1] - line.arc[0])))
    columns = np.linspace(0, colon.radius.shape[1], sectors + 1).round().astype(int)
    pieces = []
    for low, high in pairwise([*range(0, len(line.arc) - 1, step), len(line.arc) - 1]):
        for first, last in pairwise(columns):
            corners = []
            for station in (low, high):
                for column in (first, last):
                    angle = 2 * np.pi * column / colon.radius.shape[1]
                    across = line.frames[station] @ [np.cos(angle), np.sin(angle), 0]
                    radius = colon.radius[station, column % colon.radius.shape[1]]
                    corners += [line.points[station] + (radius + depth) * across for depth in (0, thickness)]
            pieces.append(WallPiece(np.array(corners), start=float(line.arc[low]), end=float(line.arc[high])))
    error = WallAccuracy(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 0)
    return Wall("prism", tuple(pieces), error, Provenance(inputs={}, configuration={}), {})


def bent_colon(
    *, bend: float, leg: float = 0.1, turn: float = np.pi / 2, radius: float = 0.016, length: float = 0.4
) -> Colon:
    """A round tube from +z to +x: a straight leg, a bend of radius `bend` by `turn`, and straight on [m, rad]."""
    arc = np.linspace(0, length, 600)
    angle = np.clip((arc - leg) / bend, 0, turn)
    after = np.maximum(arc - leg - bend * turn, 0)
    x = bend * (1 - np.cos(angle)) + after * np.sin(turn)
    z = np.minimum(arc, leg) + bend * np.sin(angle) + after * np.cos(turn)
    line = centreline_through(np.column_stack([x, np.zeros(600), z]), 0.002)
    field = np.full((len(line.points), 48), radius)
    return Colon(
        name="bent tube",
        lumen=tube(line.points, line.frames, field),
        centreline=line,
        radius=field,
        segments=(ColonSegment("rectum", 0.0, line.length),),
        provenance=Provenance(inputs={}, configuration={}),
    )
