"""Where on the wall an endoscopist finds landmarks: the anal verge, the flexures, the valve and the appendix orifice.

The flexures and the anus are places along the colon. Surfaces show neither valve nor orifice, so these two are put
where anatomy has them: the valve at the caecum's border, on the side that faces the body's middle; the orifice at the
pole of the caecum, straight ahead of the centreline's end.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from haustra.assets import asset
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.landmarks import VALVE
from haustra.quantity import load_quantities

ORIFICE, VERGE = "appendix_orifice", "anal_verge"
FLEXURES = ("splenic_flexure", "hepatic_flexure")
LANDMARKS: tuple[str, ...] = (VERGE, *FLEXURES, VALVE, ORIFICE)
"""From anus to caecum; what stands later lies over what stands before."""
NO_LANDMARK = -1
"""Number of places that belong to none."""
_BESIDE = 0.05
"""Wall farther along the colon than this from a landmark's middle is of another loop [m]."""


@dataclass(frozen=True)
class WallPlace:
    """A round place on the wall."""

    place: Float[np.ndarray, "3"]
    """Its middle [m]."""
    arc: float
    """Arc length beside it [m]."""
    radius: float
    """[m]."""


def inspection_number(name: str) -> float:
    """Value of a number of assets/numbers/inspection.toml, by its name behind 'inspection.'."""
    return float(load_quantities(asset("numbers/inspection.toml"))[f"inspection.{name}"].value)


def valve_place(colon: Colon) -> WallPlace:
    """Where the ileocaecal valve is: at the caecum's border, on the side of the body's middle."""
    line, caecum = colon.centreline, colon.segments[-1]
    station = int(np.argmin(np.abs(line.arc - colon.landmarks.get(VALVE, caecum.start))))
    vertices = colon.lumen.vertices
    across = line.frames[station, :, :2].T @ ((vertices.min(0) + vertices.max(0)) / 2 - line.points[station])
    angles = colon.radius.shape[1]
    angle = round(float(np.arctan2(across[1], across[0])) / (2 * np.pi) * angles) % angles
    turn = 2 * np.pi * angle / angles
    outwards = line.frames[station, :, :2] @ np.array([np.cos(turn), np.sin(turn)])
    place = line.points[station] + colon.radius[station, angle] * outwards
    return WallPlace(place, float(line.arc[station]), inspection_number("valve_radius"))


def orifice_place(colon: Colon) -> WallPlace:
    """Where the appendix orifice is: the wall straight ahead of the centreline's end."""
    line, vertices = colon.centreline, colon.lumen.vertices
    away = vertices - line.points[-1]
    ahead = away @ line.frames[-1, :, 2]
    aside = np.linalg.norm(away - ahead[:, None] * line.frames[-1, :, 2], axis=1)
    near = np.where((ahead > -1e-6) & (np.linalg.norm(away, axis=1) < 0.1), ahead - 2 * aside, -np.inf)
    return WallPlace(vertices[int(near.argmax())], line.length, inspection_number("orifice_radius"))


def landmark_of_points(
    colon: Colon, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"]
) -> Int[np.ndarray, " points"]:
    """Index in `LANDMARKS` of the landmark that each place of the wall belongs to, `NO_LANDMARK` where there is none.

    Args:
        colon: at rest.
        points: on its wall [m].
        arcs: arc length beside them [m].
    """
    found = np.full(len(points), NO_LANDMARK)
    found[arcs < inspection_number("verge_reach")] = LANDMARKS.index(VERGE)
    for segment, flexure in (("transverse", FLEXURES[0]), ("ascending", FLEXURES[1])):
        starts = [part.start for part in colon.segments if part.name == segment]
        for start in starts:
            found[np.abs(arcs - start) < inspection_number("flexure_reach")] = LANDMARKS.index(flexure)
    for name, where in _discs(colon).items():
        near = np.linalg.norm(points - where.place, axis=1) < where.radius
        found[near & (np.abs(arcs - where.arc) < _BESIDE)] = LANDMARKS.index(name)
    return found


def landmark_of_triangles(colon: Colon, arcs: Float[np.ndarray, " vertices"]) -> Int[np.ndarray, " triangles"]:
    """`landmark_of_points` of the triangles' middles, by the arc length of each vertex [m].

    Of a place smaller than the triangles about it, the nearest of them count.
    """
    faces = colon.lumen.faces
    middles, along = colon.lumen.vertices[faces].mean(axis=1), arcs[faces].mean(axis=1)
    found = landmark_of_points(colon, middles, along)
    for name, where in _discs(colon).items():
        if not (found == LANDMARKS.index(name)).any():
            distance = np.linalg.norm(middles - where.place, axis=1)
            found[distance < 1.1 * distance.min()] = LANDMARKS.index(name)
    return found


def _discs(colon: Colon) -> dict[str, WallPlace]:
    whole = colon.segments[-1].name == "caecum"
    return {VALVE: valve_place(colon), ORIFICE: orifice_place(colon)} if whole else {}
