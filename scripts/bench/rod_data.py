"""Measured or computed shapes and motions of one rod, from a folder of rod.toml, *_dataStatics.csv and *_N.txt."""

import csv
import math
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.errors import UnreadableFileError
from haustra.models.devices.scope.rods import UniformRod

_KEYS = ("length_m", "radius_m", "density_kg_m3", "youngs_modulus_Pa", "poisson_ratio", "rotation")
_ROWS_PER_SHAPE = 6
_HEAD_COLUMNS = 3
_RELEASE_COLUMNS = 13


@dataclass(frozen=True)
class RodShapes:
    """Static shapes under weight, a wrench at mid-length and a wrench at the tip; the frame has z along the clamp."""

    gravity: Float[np.ndarray, "shapes 3"]
    """[m/s^2]."""
    mid_moment: Float[np.ndarray, "shapes 3"]
    """[N m]."""
    mid_force: Float[np.ndarray, "shapes 3"]
    """[N]."""
    tip_moment: Float[np.ndarray, "shapes 3"]
    """[N m]."""
    tip_force: Float[np.ndarray, "shapes 3"]
    """[N]."""
    tip: Float[np.ndarray, "shapes 3"]
    """Where the tip is [m]."""


@dataclass(frozen=True)
class RodRelease:
    """Motion of a rod that was held by wrenches at mid-length and tip, and let go at time zero."""

    file: str
    relaxation_time: float
    """Damping over stiffness [s]."""
    gravity: Float[np.ndarray, "3"]
    mid_moment: Float[np.ndarray, "3"]
    mid_force: Float[np.ndarray, "3"]
    tip_moment: Float[np.ndarray, "3"]
    tip_force: Float[np.ndarray, "3"]
    time: Float[np.ndarray, " samples"]
    """[s]."""
    mid: Float[np.ndarray, "samples 3"]
    """Mid-length [m]."""
    tip: Float[np.ndarray, "samples 3"]
    """Tip [m]."""


@dataclass(frozen=True)
class RodData:
    """One rod and what is known of it."""

    rod: UniformRod
    shapes: RodShapes
    releases: tuple[RodRelease, ...]


def load_rod_data(folder: Path) -> RodData:
    """Read a folder of rod data.

    Raises:
        UnreadableFileError: when a file is missing or not of the documented form.
    """
    rod, turn = _rod(folder / "rod.toml")
    statics = sorted(folder.glob("*_dataStatics.csv"))
    if not statics:
        raise UnreadableFileError(f"No *_dataStatics.csv in '{folder}': name the folder that holds the rod's data.")
    releases = [path for path in folder.glob("*_*.txt") if re.search(r"_\d+\.txt$", path.name)]
    releases.sort(key=lambda path: int(path.stem.rpartition("_")[2]))
    return RodData(rod, _shapes(statics[0], turn), tuple(_release(path, turn) for path in releases))


def _rod(path: Path) -> tuple[UniformRod, Float[np.ndarray, "3 3"]]:
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
        length, radius, density, young, poisson, turn = (values[key] for key in _KEYS)
        rotation = np.array(turn, dtype=float).reshape(3, 3)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError, ValueError, TypeError) as error:
        raise UnreadableFileError(f"Cannot read '{path}': {error!r}. It needs {', '.join(_KEYS)}.") from error
    if not all(isinstance(value, int | float) and value > 0 for value in (length, radius, density, young, poisson)):
        raise UnreadableFileError(f"'{path}' holds a value that is not a positive number.")
    bending = young * math.pi * radius**4 / 4
    return (
        UniformRod(
            length=length,
            radius=radius,
            flexural_rigidity=bending,
            torsional_rigidity=bending / (1 + poisson),  # a round section: J = 2 I, G = E / (2 + 2 nu)
            mass_per_length=density * math.pi * radius**2,
        ),
        rotation,
    )


def _shapes(path: Path, turn: Float[np.ndarray, "3 3"]) -> RodShapes:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        stations = np.array([float(value) for value in rows[1][1:]])
        table = np.array([[float(value) for value in row[1:]] for row in rows[2:] if row])
        table = table.reshape(-1, _ROWS_PER_SHAPE, len(stations))
        if not np.isfinite(table).all() or not math.isclose(stations[-1], 1):
            raise ValueError("values are missing, or the last station is not the tip")
    except (OSError, UnicodeDecodeError, ValueError, IndexError) as error:
        raise UnreadableFileError(f"Cannot read shapes from '{path}': {error}.") from error
    upper, lower = table[:, :3], table[:, 3:]
    gravity, mid, tip = range(_HEAD_COLUMNS)
    return RodShapes(
        gravity=lower[:, :, gravity] @ turn.T,
        mid_moment=upper[:, :, mid] @ turn.T,
        mid_force=lower[:, :, mid] @ turn.T,
        tip_moment=upper[:, :, tip] @ turn.T,
        tip_force=lower[:, :, tip] @ turn.T,
        tip=lower[:, :, -1] @ turn.T,
    )


def _release(path: Path, turn: Float[np.ndarray, "3 3"]) -> RodRelease:
    try:
        lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
        table = np.array([[float(value) for value in line] for line in lines])
        if table.shape[1] != _RELEASE_COLUMNS or len(table) < 4 or not np.isfinite(table).all():
            raise ValueError(f"it needs rows of {_RELEASE_COLUMNS} finite numbers")
    except (OSError, UnicodeDecodeError, ValueError, IndexError) as error:
        raise UnreadableFileError(f"Cannot read a tip release from '{path}': {error}.") from error
    held, motion = table[1], table[2:]
    return RodRelease(
        file=path.name,
        relaxation_time=float(table[0, 0]),
        gravity=turn @ table[0, 10:],
        mid_moment=turn @ held[1:4],
        mid_force=turn @ held[4:7],
        tip_moment=turn @ held[7:10],
        tip_force=turn @ held[10:13],
        time=motion[:, 0],
        mid=motion[:, 4:7] @ turn.T,
        tip=motion[:, 10:13] @ turn.T,
    )
