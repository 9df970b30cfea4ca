"""One colon as an episode needs it: its wall as a table seen from its entry, and what a camera sees of it."""

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.errors import UnreadableFileError
from haustra.files import write_atomically
from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Surface
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.scene import entry_of
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import Tables, lumen_table
from haustra.models.wall.mesentery import hang
from haustra.provenance import Provenance
from haustra.reading import read_arrays

_ARRAYS = ("points", "frames", "wall", "sight", "step", "device_radius", "axes", "borders")


@dataclass(frozen=True)
class TabulatedColon:
    """A colon, seen from its entry: the scope comes in at the origin along z."""

    name: str
    """What a person calls the colon."""
    points: Float[np.ndarray, "stations 3"]
    """The centreline [m]."""
    frames: Float[np.ndarray, "stations 3 3"]
    """Columns: first normal, second normal, tangent."""
    wall: Float[np.ndarray, "stations angles 4"]
    """As in `haustra.models.wall.lumen_table.Tables`."""
    sight: Float[np.ndarray, "stations angles"]
    """Distance from the centreline to the lumen surface itself [m]."""
    step: float
    """Distance between stations [m]."""
    device_radius: float
    """Radius of the spheres that the wall is for [m]."""
    axes: Float[np.ndarray, "3 3"]
    """Columns: axes of the entry's coordinates in the colon's own, in which gravity is given."""
    borders: Float[np.ndarray, " borders"] = field(default_factory=lambda: np.zeros(0))
    """Arc lengths where the six segments begin, and where the last ends [m]; empty when they are not known."""
    pressure: float | None = None
    """Pressure of the gas that holds the colon as wide as this [Pa]; CT colonography's when None. No file keeps it."""

    @property
    def length(self) -> float:
        """Length of the centreline [m]."""
        return self.step * (len(self.points) - 1)

    @property
    def line(self) -> Centreline:
        """The centreline as every other part of haustra knows it."""
        return Centreline(self.points, self.step * np.arange(len(self.points)), self.frames)

    @property
    def tables(self) -> Tables:
        """What the backends of many worlds look points up in."""
        return Tables(
            self.points,
            self.frames,
            self.wall,
            np.float64(self.step),
            np.int32(0),
            np.int32(len(self.points)),
            axes=self.axes,
            device_radius=np.float64(self.device_radius),
        )

    @property
    def own_axes(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
        """Where the coordinates of its tables begin in those of `colon` [m], and their axes: the same.

        Not `entry_of` that colon: its centreline has fewer stations, and so begins in a direction of its own.
        """
        return np.zeros(3), np.eye(3)

    @property
    def segments(self) -> tuple[ColonSegment, ...]:
        """Rectum to caecum, or none."""
        places = zip(SEGMENTS, pairwise(self.borders.tolist()), strict=False)
        return tuple(ColonSegment(name, start, end) for name, (start, end) in places)

    def with_mesentery(self, abdomen: Abdomen | None = None) -> Tables:
        """The tables of a colon that moves on its mesentery; in a patient as imaged when `abdomen` is None."""
        width, widest = np.median(self.sight, axis=1), self.sight.max(axis=1)
        own = hang(self.points, self.line.arc, width, self.segments, widest=widest, abdomen=abdomen)
        return self.tables._replace(mesentery=own._replace(load=own.load @ self.axes))

    def colon(self) -> Colon:
        """The case as a colon: the surface that a camera sees, ring by ring, without landmarks."""
        stations, angles = self.sight.shape
        opened = {} if self.pressure is None else {"pressure": self.pressure}
        turn = 2 * np.pi * np.arange(angles) / angles
        across = np.einsum("sij,aj->sai", self.frames[:, :, :2], np.column_stack([np.cos(turn), np.sin(turn)]))
        rings = self.points[:, None] + self.sight[..., None] * across
        vertices = np.vstack([rings.reshape(-1, 3), self.points[:1], self.points[-1:]])
        first, last = len(vertices) - 2, len(vertices) - 1
        one, beside = np.arange(angles), np.roll(np.arange(angles), -1)
        row = angles * np.arange(stations - 1)[:, None]
        low, low_beside = row + one, row + beside
        sides = np.stack([low, low_beside, low_beside + angles, low, low_beside + angles, low + angles], axis=-1)
        end = angles * (stations - 1)
        lids = np.concatenate(
            [
                np.stack([np.full(angles, first), beside, one], axis=1),
                np.stack([np.full(angles, last), end + one, end + beside], axis=1),
            ]
        )
        return Colon(
            name=self.name,
            lumen=Surface(vertices, np.concatenate([sides.reshape(-1, 3), lids]).astype(np.int64)),
            centreline=self.line,
            radius=self.sight,
            segments=self.segments,
            provenance=Provenance(inputs={}, configuration={"method": "case", "name": self.name} | opened),
        )


def case_of(colon: Colon, *, device_radius: float) -> TabulatedColon:
    """Tabulate a colon for devices of one radius [m]."""
    found = lumen_table(colon, device_radius=device_radius)
    tables = found.seen_from(*entry_of(colon))
    step = float(tables.step)
    rows = np.rint(step * np.arange(len(tables.points)) / colon.centreline.arc[1]).astype(int)
    count, angles = tables.wall.shape[1], colon.radius.shape[1]
    columns = np.rint(np.arange(count) / count * angles).astype(int) % angles
    return TabulatedColon(
        name=colon.name,
        points=tables.points,
        frames=tables.frames,
        wall=tables.wall,
        sight=colon.radius[rows.clip(0, len(colon.radius) - 1)][:, columns],
        step=step,
        device_radius=device_radius,
        axes=tables.axes,
        borders=np.array([*(each.start for each in colon.segments), colon.segments[-1].end])
        if [each.name for each in colon.segments] == list(SEGMENTS)
        else np.zeros(0),
    )


def save_case(path: Path, case: TabulatedColon) -> Path:
    """Write a case as one file of arrays, in one step."""

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            np.savez_compressed(file, name=np.array(case.name), **{key: getattr(case, key) for key in _ARRAYS})

    return write_atomically(path, write)


def load_case(path: Path) -> TabulatedColon:
    """Read a case; nothing in the file is run.

    Raises:
        UnreadableFileError: when it is no case.
    """
    try:
        arrays: dict[str, Any] = read_arrays(path, (*_ARRAYS, "name"))
        name = str(arrays.pop("name"))
        step, radius = float(arrays.pop("step")), float(arrays.pop("device_radius"))
        case = TabulatedColon(name=name, step=step, device_radius=radius, **arrays)
        shaped = case.points.shape[1:] == (3,) and case.wall.shape[:2] == (*case.points.shape[:1], case.sight.shape[1])
    except (ValueError, TypeError, IndexError, AttributeError) as error:
        raise UnreadableFileError(f"'{path}' is no case ({error}): delete it.") from error
    if not shaped or not all(np.isfinite(getattr(case, key)).all() for key in _ARRAYS):
        raise UnreadableFileError(f"'{path}' is no case (its arrays do not fit): delete it.")
    return case
