"""What of the mucosa an inspection has seen: how much, where it is blind, which landmarks, which polyps.

Mucosa counts as seen when it was in view without interruption for as long as `inspection.seen_for` says (0.5 s, as in
Zupanc 2017, doi 10.1186/s12909-017-0948-6). In view means near enough, not too oblique, lit and sharp: those rules
(`in_view`) go by the thresholds of assets/numbers/inspection.toml, for every camera. A polyp was seen when enough of
its surface was in view at once for as long; whether a person would have noticed it is not asked.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lesion_surface import lesion_of_triangles
from haustra.models.anatomy.surface_landmarks import LANDMARKS, inspection_number, landmark_of_triangles
from haustra.models.wall.signed_distance import ANUS

CELL, AROUND = 0.005, 36
"""Cells of the unrolled map: along the colon [m], and around it."""
_BRIGHT = 95
"""Percentile of the light in a picture that exposure goes by."""


def in_view(
    distance: Float[np.ndarray, "*pixels"], facing: Float[np.ndarray, "*pixels"], speed: Float[np.ndarray, "*pixels"]
) -> Bool[np.ndarray, "*pixels"]:
    """Which of the places that a picture shows can be inspected.

    The lamps are taken to be where the lens is: light falls with the square of distance and the cosine to the normal.

    Args:
        distance: from the camera [m]; not finite where there is nothing.
        facing: cosine between the normal and the line of sight [1].
        speed: of the place past the camera, across the line of sight [m/s].
    """
    there = np.isfinite(distance) & (facing > 0)
    light = np.where(there, facing, 0.0) / np.where(there, np.maximum(distance, 1e-4), 1.0) ** 2
    least = inspection_number("lit") * (np.percentile(light[there], _BRIGHT) if there.any() else 1.0)
    square_on = facing > np.cos(np.radians(inspection_number("grazing")))
    sharp = speed < inspection_number("blur")
    return there & (distance < inspection_number("near")) & square_on & (light >= least) & sharp


@dataclass(frozen=True)
class PolypSeen:
    """How a polyp fared."""

    lesion: int
    """Index in the colon's lesions."""
    seen: bool
    """Whether enough of it was in view for long enough."""
    seconds: float
    """Longest time without interruption that enough of it was [s]."""
    largest_share: float
    """Largest share of its surface that was in view at once [1]."""


class Inspection:
    """Adds up what cameras have in view of one colon's surface, triangle by triangle."""

    def __init__(self, colon: Colon, arcs: Float[np.ndarray, " vertices"]) -> None:
        """Nothing seen yet, of a colon at rest with the arc length of each vertex of its surface [m]."""
        self.colon, faces = colon, colon.lumen.faces
        corners = colon.lumen.vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.areas: Float[np.ndarray, " triangles"] = np.linalg.norm(normals, axis=1) / 2
        self.arcs: Float[np.ndarray, " triangles"] = arcs[faces].mean(axis=1)
        self._wall = self.arcs > ANUS  # the lid at the anus is no mucosa
        self.angles = self._angles(corners.mean(axis=1))
        self._since, self._visible = np.zeros(len(faces)), np.zeros(len(faces), bool)
        self.longest: Float[np.ndarray, " triangles"] = np.zeros(len(faces))
        self.seconds = 0.0
        lesions = lesion_of_triangles(colon)
        self._polyps = [
            (index, np.flatnonzero(lesions == index))
            for index, lesion in enumerate(colon.lesions)
            if lesion.kind == "polyp"
        ]
        self._polyp_since = np.zeros((2, len(self._polyps)))
        self._polyp_share, self._enough = np.zeros(len(self._polyps)), np.zeros(len(self._polyps), bool)
        landmarks = landmark_of_triangles(colon, arcs)
        self._landmarks = {name: np.flatnonzero(landmarks == index) for index, name in enumerate(LANDMARKS)}
        self.landmark_seconds = dict.fromkeys(LANDMARKS, 0.0)

    def look(self, visible: Bool[np.ndarray, " triangles"], interval: float) -> None:
        """These triangles are in view, so long after the last look [s]; what was in view at both was all the while."""
        self.seconds += interval
        self._since = np.where(visible & self._visible, self._since + interval, 0.0)
        self._visible = visible
        self.longest = np.maximum(self.longest, self._since)
        shares = np.array([self._share(visible, own) for _, own in self._polyps])
        enough = shares >= inspection_number("polyp_share")
        now, longest = self._polyp_since
        now = np.where(enough & self._enough, now + interval, 0.0)
        self._enough = enough
        self._polyp_since = np.stack([now, np.maximum(longest, now)])
        self._polyp_share = np.maximum(self._polyp_share, shares)
        for name in self.landmarks_in_view(visible):
            self.landmark_seconds[name] += interval

    def landmarks_in_view(self, visible: Bool[np.ndarray, " triangles"]) -> list[str]:
        """Landmarks enough of which is among these triangles."""
        least = inspection_number("landmark_share")
        return [name for name, own in self._landmarks.items() if len(own) and self._share(visible, own) >= least]

    @property
    def seen(self) -> Bool[np.ndarray, " triangles"]:
        """Triangles that count as seen."""
        return self.longest >= inspection_number("seen_for") - 1e-9

    @property
    def polyps(self) -> list[PolypSeen]:
        """How each polyp fared."""
        least = inspection_number("polyp_seen_for") - 1e-9
        return [
            PolypSeen(index, bool(longest >= least), float(longest), float(share))
            for (index, _), longest, share in zip(self._polyps, self._polyp_since[1], self._polyp_share, strict=True)
        ]

    def unrolled(self) -> Float[np.ndarray, "along around"]:
        """Share of the mucosa that was seen, by cells of length `CELL` along the colon; NaN where a cell has none."""
        shape = int(np.ceil(self.colon.centreline.length / CELL)), AROUND
        row = np.clip((self.arcs / CELL).astype(int), 0, shape[0] - 1)
        column = np.clip((self.angles / (2 * np.pi) * AROUND).astype(int), 0, AROUND - 1)
        cells = (row * AROUND + column)[self._wall]
        whole = np.bincount(cells, self.areas[self._wall], shape[0] * AROUND)
        part = np.bincount(cells, (self.areas * self.seen)[self._wall], shape[0] * AROUND)
        return np.where(whole > 0, part / np.maximum(whole, 1e-300), np.nan).reshape(shape)

    def scores(self) -> dict[str, Any]:
        """What was seen, as plain JSON values, units in the names."""
        names = [segment.name for segment in self.colon.segments]
        of = np.searchsorted([segment.end for segment in self.colon.segments[:-1]], self.arcs, side="right")
        by = {name: self._seen_share(self._wall & (of == index)) for index, name in enumerate(names)}
        blind = blind_spots(self.unrolled())
        polyps = self.polyps
        return {
            "inspection_s": self.seconds,
            "mucosa_seen": self._seen_share(self._wall),
            "mucosa_seen_by_site": by,
            "mucosa_cm2": float(self.areas[self._wall].sum() * 1e4),
            "blind_spots": len(blind),
            "largest_blind_spot_cells": max((size for size, _ in blind), default=0),
            "polyps": len(polyps),
            "polyps_seen": sum(polyp.seen for polyp in polyps),
            "polyp_list": [self._told(polyp) for polyp in polyps],
            "landmarks_seen": [
                name for name, time in self.landmark_seconds.items() if time >= inspection_number("seen_for") - 1e-9
            ],
            "landmark_s": dict(self.landmark_seconds),
        }

    def _told(self, polyp: PolypSeen) -> dict[str, Any]:
        lesion = self.colon.lesions[polyp.lesion]
        return {
            "segment": lesion.segment,
            "arc_m": lesion.arc,
            "size_mm": lesion.size * 1e3,
            "type": lesion.type,
            "seen": polyp.seen,
            "in_view_s": polyp.seconds,
            "largest_share": polyp.largest_share,
        }

    def _share(self, visible: np.ndarray, own: Int[np.ndarray, " some"]) -> float:
        return float(self.areas[own][visible[own]].sum() / max(self.areas[own].sum(), 1e-300))

    def _seen_share(self, own: np.ndarray) -> float:
        return float((self.areas * self.seen)[own].sum() / max(self.areas[own].sum(), 1e-300))

    def _angles(self, middles: np.ndarray) -> Float[np.ndarray, " triangles"]:
        """Direction of each triangle from the centreline, from its first normal towards the second [rad]."""
        line = self.colon.centreline
        station = np.clip(np.searchsorted(line.arc, self.arcs), 0, len(line.arc) - 1)
        away = middles - line.points[station]
        across = np.einsum("ti,tij->tj", away, line.frames[station, :, :2])
        return np.arctan2(across[:, 1], across[:, 0]) % (2 * np.pi)


def blind_spots(unrolled: Float[np.ndarray, "along around"]) -> list[tuple[int, tuple[int, int]]]:
    """Patches of the unrolled map less than half of whose cells' mucosa was seen: cells, and row and column of one.

    Cells that touch at a side belong to one patch, round the colon too; the largest comes first.
    """
    from scipy.ndimage import label

    found = np.zeros(unrolled.shape, int)
    label(np.nan_to_num(unrolled, nan=1.0) < 0.5, output=found)
    for first, last in zip(found[:, 0], found[:, -1], strict=True):  # the map is a tube
        if first and last and first != last:
            found[found == last] = first
    patches = []
    for number in np.unique(found[found > 0]):
        rows, columns = np.nonzero(found == number)
        patches.append((len(rows), (int(rows[0]), int(columns[0]))))
    return sorted(patches, reverse=True)
