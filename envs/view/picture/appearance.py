"""What is known of each place of a colon's wall for its picture: taeniae, lesions, blood, stool and places.

Everything is fixed to the colon at rest and made from one seed, for the shader (`haustra.envs.view.picture.mucosa`).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.linear.place import aligned
from haustra.envs.view.picture import mucosa
from haustra.envs.view.picture.camera import unit
from haustra.envs.view.picture.surface import LumenSurface
from haustra.models.anatomy.colon import Colon, Lesion
from haustra.models.anatomy.landmarks import VALVE
from haustra.models.wall.vectors import of

TAENIA_WIDTH = 0.005
"""Breadth of a taenia [m]; some 6 to 8 mm in adults, of which the middle shows; engineering choice."""
ORIFICE_WIDTH, VALVE_WIDTH = 0.0035, 0.011
"""Half the breadth of the appendix orifice and of the ileocaecal valve's lips [m]; engineering choice."""
STOOL_SCALE = 0.013
"""Length over which what is left of stool and mucus varies [m]; engineering choice."""


class Residue(NamedTuple):
    """What preparation has left on a wall."""

    stool: float = 0.0
    """Share of the lower wall under stool, from 0 to 1."""
    mucus: float = 0.0
    """Share of the wall under strands and veils of mucus, from 0 to 1."""


class Appearance:
    """Looks of one colon's wall."""

    def __init__(self, colon: Colon, surface: LumenSurface, *, seed: int = 0, residue: Residue | None = None) -> None:
        """Make them up.

        Args:
            colon: at rest.
            surface: its surface, in whose order vertices are counted.
            seed: of the patterns.
            residue: what lies on the wall; nothing when None.
        """
        rng = np.random.default_rng(seed)
        self.lattice: Float[np.ndarray, "16 16 16"] = rng.random((mucosa.PERIOD,) * 3).astype(np.float32)
        """Random numbers of all patterns."""
        self.wet = 1.0
        """Brightness of the highlights of the film of water on the wall [1]."""
        residue = residue or Residue()
        self.mucus = residue.mucus
        """Share of the wall under mucus [1]."""
        self._surface, line = surface, colon.centreline
        station = np.clip(np.searchsorted(line.arc, surface.arcs), 0, len(line.arc) - 1)
        offset = surface.rest - line.points[station]
        frames = line.frames[station]
        angle = np.arctan2(*(np.einsum("vi,vi->v", offset, frames[:, :, axis]) for axis in (1, 0)))
        self.wall: Float[np.ndarray, "vertices 12"] = aligned(np.zeros((len(surface.arcs), 12)), np.float32)
        """Vertices' places at rest and arc lengths [m], and what is known of each."""
        self.wall[:, :3], self.wall[:, 3] = surface.rest, surface.arcs
        self.known: Float[np.ndarray, "vertices 5"] = self.wall[:, 4:9]
        """Columns as `haustra.envs.view.picture.mucosa` names them."""
        self.known[:, mucosa.TAENIA] = _taeniae(colon, surface.arcs, angle, np.linalg.norm(offset, axis=1), rng)
        for lesion in colon.lesions:
            self._mark(lesion, line.points[int(np.searchsorted(line.arc, lesion.arc))])
        if residue.stool > 0:
            corners = mucosa.corners(self.lattice)
            heap, _ = mucosa.noise(np, lambda row: corners[row].T, of(surface.rest), 1 / STOOL_SCALE)
            low = -offset[:, 1] / np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
            self.known[:, mucosa.STOOL] = np.clip(heap + 0.45 * low + residue.stool - 0.75, 0, 1)
        self.landmarks: Float[np.ndarray, "landmarks 8"] = np.array(_landmarks(colon, rng)).reshape(-1, 8)
        """Named places that are drawn pixel by pixel."""

    @property
    def kinds(self) -> tuple[int, ...]:
        """Kinds of the landmarks."""
        return tuple(int(kind) for kind in self.landmarks[:, 0])

    def bleed(self, place: Float[np.ndarray, "3"], reach: float) -> None:
        """Let blood lie on the wall around a place of the colon at rest [m], as far as `reach` [m]."""
        away = np.linalg.norm(self._surface.rest - place, axis=1)
        wet = np.clip(1.6 * (1 - away / reach), 0, 1)
        self.known[:, mucosa.BLOOD] = np.maximum(self.known[:, mucosa.BLOOD], wet)

    def _mark(self, lesion: Lesion, middle: Float[np.ndarray, "3"]) -> None:
        """Mark the vertices of a polyp or a diverticulum, given the centreline beside it [m]."""
        if lesion.kind == "stricture":
            return
        inwards = unit(middle - np.array(lesion.position))
        offset = self._surface.rest - np.array(lesion.position)
        height = offset @ inwards
        aside = np.linalg.norm(offset - height[:, None] * inwards, axis=1)
        if lesion.kind == "polyp":
            body = (aside < 0.56 * lesion.size) & (height > -0.1 * lesion.extent) & (height < 1.3 * lesion.extent)
            rise = np.clip(height / np.maximum(0.3 * lesion.extent, 5e-4), 0, 1)
            column, value = mucosa.POLYP, np.where(body, rise, 0)
        else:
            body = (aside < 0.7 * lesion.size) & (height > -1.8 * lesion.extent)
            column, value = mucosa.DIVERTICULUM, np.where(body, np.clip(-height / 2e-3 - 0.2, 0, 1), 0)
        self.known[:, column] = np.maximum(self.known[:, column], value)


def _taeniae(
    colon: Colon, arcs: np.ndarray, angle: np.ndarray, radius: np.ndarray, rng: np.random.Generator
) -> Float[np.ndarray, " vertices"]:
    """How near each vertex is to the middle of one of three bands, which wander slowly; the rectum has none."""
    first, phase = rng.uniform(0, 2 * np.pi, 2)
    lean = first + 0.25 * np.sin(2 * np.pi * arcs / 0.35 + phase)
    off = np.abs((angle - lean + np.pi / 3) % (2 * np.pi / 3) - np.pi / 3) * radius
    rectum = next((each.end for each in colon.segments if each.name == "rectum"), 0.0)
    return np.exp(-((2 * off / TAENIA_WIDTH) ** 2)) * np.clip((arcs - rectum) / 0.03, 0, 1)


def _landmarks(colon: Colon, rng: np.random.Generator) -> list[list[float]]:
    """Appendix orifice at the caecum's pole, and ileocaecal valve where the caecum begins."""
    line, vertices = colon.centreline, colon.lumen.vertices
    caecum = next((each.start for each in colon.segments if each.name == "caecum"), None)
    if caecum is None:
        return []
    end, ahead = line.points[-1], line.frames[-1]
    turn = rng.uniform(0, 2 * np.pi)
    across = np.cos(turn) * ahead[:, 0] + np.sin(turn) * ahead[:, 1]
    pole = _hit(vertices, end, unit(ahead[:, 2] + 0.35 * across))
    found = [[mucosa.ORIFICE, *pole, ORIFICE_WIDTH, *np.cross(ahead[:, 2], across)]]
    arc = colon.landmarks.get(VALVE, caecum)
    at = min(int(np.searchsorted(line.arc, arc)), len(line.arc) - 1)
    turn = turn + rng.uniform(-0.5, 0.5)
    across = np.cos(turn) * line.frames[at][:, 0] + np.sin(turn) * line.frames[at][:, 1]
    lips = _hit(vertices, line.points[at], across)
    found.append([mucosa.VALVE, *lips, VALVE_WIDTH, *np.cross(line.frames[at][:, 2], across)])
    return found


def _hit(vertices: np.ndarray, start: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The vertex before which a ray leaves the lumen, as seen from its start: the nearest within a narrow cone."""
    offset = vertices - start
    away = np.linalg.norm(offset, axis=1)
    cosine = offset @ direction / np.maximum(away, 1e-9)
    within = cosine >= min(np.cos(0.12), np.sort(cosine)[-3])
    return vertices[np.flatnonzero(within)[int(away[within].argmin())]]
