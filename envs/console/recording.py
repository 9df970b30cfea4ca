"""One recorder for persons, drivers and policies: what was asked, what came of it, and enough to do it again.

A recording is a folder: `recording.json` says what was driven, `colon/` is where, and `rows-000000.npz` and so on hold
some seconds each. A row is one control step; what is drawn is kept some ten times a second. Chunks are written at
once or not at all, so that what was recorded before a crash is kept, and memory holds one chunk.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.vehicle import Look, Vehicle
from haustra.errors import OutputError, UnreadableFileError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.anatomy.store import colon_hash, load_colon, save_colon
from haustra.provenance import Provenance, backend_record
from haustra.reading import LARGEST_RECORD, read_arrays, read_document

ABOUT, COLON = "recording.json", "colon"
FORMAT = "haustra recording 1"
CHUNK_SECONDS = 10.0
"""Time that a chunk holds [s]."""
FRAME_RATE = 10.0
"""Frames in a second of simulated time [Hz]."""
_FRAME = "frame_"
"""Names of what is drawn begin so in a chunk."""
_LARGEST_CHUNK = 100_000_000
_MOST_CHUNKS = 100_000


class Recorder:
    """Writes a recording while it is made."""

    def __init__(self, folder: Path, vehicle: Vehicle, *, driver: str, seed: int = 0) -> None:
        """Begin a recording in a folder that holds none.

        Args:
            folder: where to.
            vehicle: what is driven.
            driver: who drives: 'hand', 'follower', a policy's name.
            seed: of all that is drawn at random.

        Raises:
            OutputError: when the folder holds a recording, or cannot be written to.
        """
        prepare_folder(folder)
        if (folder / ABOUT).exists():
            raise OutputError(f"'{folder}' holds a recording already: name another folder.")
        save_colon(vehicle.given, folder / COLON)
        self.folder = folder
        self._chunk = max(1, round(CHUNK_SECONDS / vehicle.interval))
        self._every = max(1, round(1 / FRAME_RATE / vehicle.interval))
        self._rows: list[dict[str, Any]] = []
        self._frames: list[dict[str, Any]] = []
        self._chunks = self.count = 0
        configuration = vehicle.configuration()
        provenance = Provenance(
            inputs={"colon": colon_hash(vehicle.given), "colon_name": vehicle.given.name},
            configuration=configuration,
            backend=backend_record(vehicle.backend),
        )
        self._about: dict[str, Any] = {
            "format": FORMAT,
            "driver": driver,
            "seed": seed,
            "interval": vehicle.interval,
            "levers": [vars(lever) for lever in vehicle.levers],
            "conditions": [vars(condition) for condition in vehicle.conditions],
            "vehicle": configuration,
            "length": vehicle.around.colon.centreline.length,
            "provenance": provenance.to_json(),
            "finished": False,
        }
        write_json(folder / ABOUT, self._about)

    def add(self, step: int, look: Look, **asked: Any) -> None:
        """Note one control step and what came of it; a step that was noted before takes the place of all from it on.

        Args:
            step: number of the step.
            look: what was seen after it.
            asked: what was asked for.
        """
        self._rows.append({"step": step, **look.row, **asked})
        if step % self._every == 0:
            self._frames.append({"step": step, **look.frame})
        self.count += 1
        if len(self._rows) >= self._chunk:
            self._write()

    def close(self, **said: Any) -> dict[str, Any]:
        """Write what is left, and what is said of it at the end."""
        self._write()
        self._about |= {"finished": True, "chunks": self._chunks, "rows": self.count, **said}
        write_json(self.folder / ABOUT, self._about)
        return self._about

    def _write(self) -> None:
        if not self._rows:
            return
        arrays = _columns(self._rows) | {f"{_FRAME}{name}": values for name, values in _columns(self._frames).items()}
        kept = {name: _kept(name, values) for name, values in arrays.items()}
        path = self.folder / f"rows-{self._chunks:06d}.npz"
        write_atomically(path, lambda file: np.savez_compressed(file, allow_pickle=False, **kept))
        self._rows, self._frames = [], []
        self._chunks += 1


def _columns(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    return {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else {}


def _kept(name: str, values: np.ndarray) -> np.ndarray:
    """What is drawn needs single precision only; what is done again needs all."""
    return values.astype(np.float32) if name.startswith(_FRAME) and values.dtype == np.float64 else values


@dataclass(frozen=True)
class Recording:
    """A recording that was read."""

    folder: Path
    about: Mapping[str, Any]
    """What `recording.json` says."""
    rows: Mapping[str, np.ndarray]
    """Arrays of all control steps, by name; `step` counts from 0, where nothing was asked yet."""
    frames: Mapping[str, np.ndarray]
    """Arrays of what is drawn, by name, with the `step` of each."""

    @property
    def levers(self) -> tuple[str, ...]:
        """Names of levers, as columns of `rows['levers']`."""
        return tuple(str(lever["name"]) for lever in self.about["levers"])

    @property
    def interval(self) -> float:
        """Control step [s]."""
        return float(self.about["interval"])

    def corrections(self) -> list[float]:
        """Times at which the person began to correct a driver [s]."""
        by = self.rows["by_person"].any(axis=1) & self.rows["assisted"]
        begun = np.flatnonzero(by & ~np.concatenate([[False], by[:-1]]))
        return [float(time) for time in self.rows["time"][begun]]


def load_recording(folder: Path) -> Recording:
    """Read a recording; of what was done again from an earlier step, only the last way is kept.

    Raises:
        UnreadableFileError: when the folder holds none, or a damaged one.
    """
    if not (folder / ABOUT).is_file():
        raise UnreadableFileError(
            f"'{folder}' holds no recording ({ABOUT} is missing): make one with `haustra record`."
        )
    about = read_document(folder / ABOUT, "recording", largest=LARGEST_RECORD)
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise UnreadableFileError(f"'{folder / ABOUT}' is no recording that this haustra reads: record it again.")
    paths = sorted(folder.glob("rows-*.npz"))[:_MOST_CHUNKS]
    if not paths:
        raise UnreadableFileError(f"'{folder}' holds a recording without a single row.")
    rows: dict[str, list[np.ndarray]] = {}
    frames: dict[str, list[np.ndarray]] = {}
    for path in paths:
        for name, values in _read_chunk(path).items():
            place, key = (frames, name.removeprefix(_FRAME)) if name.startswith(_FRAME) else (rows, name)
            place.setdefault(key, []).append(values)
    try:
        found = Recording(folder, about, _last_way(rows), _last_way(frames))
        _require_whole(found)
    except (KeyError, ValueError, TypeError) as error:
        raise UnreadableFileError(f"The recording in '{folder}' is damaged ({error}).") from error
    if colon_hash(load_colon(folder / COLON)) != about["provenance"]["inputs"]["colon"]:
        raise UnreadableFileError(f"The colon in '{folder}' is not the one that was driven in: record it again.")
    return found


def _read_chunk(path: Path) -> dict[str, np.ndarray]:
    from zipfile import BadZipFile, ZipFile

    try:
        with ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist()]
    except (OSError, BadZipFile) as error:
        raise UnreadableFileError(f"'{path}' is damaged ({error}).") from error
    return read_arrays(path, names, largest=_LARGEST_CHUNK)


def _last_way(parts: Mapping[str, list[np.ndarray]]) -> dict[str, np.ndarray]:
    """Chunks one behind the other, without steps that were gone back on."""
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    step = columns["step"]
    later = np.minimum.accumulate(np.append(step, np.iinfo(np.int64).max)[::-1])[::-1][1:]
    return {name: values[step < later] for name, values in columns.items()}


def _require_whole(recording: Recording) -> None:
    rows, about = recording.rows, recording.about
    count = len(rows["step"])
    if (rows["step"] != np.arange(count)).any():
        raise ValueError("steps are missing")
    for name, width in (("levers", len(about["levers"])), ("conditions", len(about["conditions"]))):
        if rows[name].shape != (count, width):
            raise ValueError(f"{name} are of shape {rows[name].shape}")
    for name in ("time", "tip_arc", "wall_force", "digest", "assisted", "tip"):
        if len(rows[name]) != count:
            raise ValueError(f"{name} has {len(rows[name])} of {count} rows")
