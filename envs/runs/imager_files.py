"""Recordings of a magnetic imager: coordinates of the coils within a scope over time, as files.

The layout is that of the public set of 1,399 clinical and 100 simulated colonoscopies (Colonoscope Coordinates, read
from the code at github.com/CAMES-Engineering/Colonoscopy-Coordinates): a folder with X.txt, Y.txt, Z.txt and T.txt, a
line a moment, numbers that each end in a semicolon, one a coil in the first three files, the tip's first, and the time
[ms] in the last; beside them, where it is known, LogFile_P.txt, a line an event: its time [s], its name. Times of the
log end together with the recording.

The set names neither the unit of its coordinates nor its axes. Its pictures show -250 to 250 across and 0 to 500 in
depth, from the front with y pointing down: taken here as millimetres, x to the patient's left, y to the feet, z to the
back. Whether the frontal picture is seen as by a reader or a mirror is not said: were it mirrored, alpha loops of
clinical files would be called reversed alpha loops, and the other way round.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.errors import UnreadableFileError
from haustra.files import replaced_together, write_atomically
from haustra.reading import read_text

LOG = "LogFile_P.txt"
START, SPLENIC, HEPATIC, CAECUM, END = "Endoscopy started", "Fleksur L", "Fleksur R", "Cecum", "Endoscopy ended"
"""Names of events in the log."""
_AXES = "XYZ"
_TO_FILE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From left, back and up to left, down and back: a rotation, so that loops keep their hand."""
_LARGEST = 100_000_000
"""Length of one file [bytes]: an hour of 20 coils at 40 Hz takes 30 MB."""
_MOST_COILS, _MOST_RECORDS, _MOST_EVENTS = 64, 400_000, 10_000
_FURTHEST = 1e4
"""Distance from the imager that no coil has [mm]."""


@dataclass(frozen=True)
class ImagerRecording:
    """Places of a scope's coils over time."""

    time: Float[np.ndarray, " records"]
    """Times that do not fall, and rise over the whole recording [s]."""
    coils: Float[np.ndarray, "records coils 3"]
    """Places of the coils, the tip's first, then away from it [m]; x to the left, y to the back, z up."""
    events: Mapping[str, float] = field(default_factory=dict)
    """Times of events of the log, by name, the first of each [s]."""


def write_recording(folder: Path, recording: ImagerRecording) -> list[Path]:
    """Write the files of a recording; those that were there are replaced together.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    places = np.round(1e3 * recording.coils @ _TO_FILE.T, 2) + 0.0  # no -0.00
    texts = {
        f"{axis}.txt": _lines([[f"{value:.2f}" for value in row] for row in places[..., index]])
        for index, axis in enumerate(_AXES)
    }
    texts["T.txt"] = _lines([[f"{1e3 * time:.1f}"] for time in recording.time])
    end = float(recording.time[-1])
    events = sorted({**recording.events, END: end}.items(), key=lambda event: event[1])
    texts[LOG] = _lines([[f"{time:.3f}", name] for name, time in events])
    with replaced_together(folder) as place:
        for name, text in texts.items():
            write_atomically(place / name, lambda file, text=text: file.write_text(text, encoding="utf-8"))
    return [folder / name for name in texts]


def read_recording(folder: Path) -> ImagerRecording:
    """The recording in a folder.

    Raises:
        UnreadableFileError: when a file is missing, too long or damaged, or the files do not fit together.
    """
    axes = [_table(folder / f"{axis}.txt") for axis in _AXES]
    time = _table(folder / "T.txt")[:, 0] / 1e3
    shapes = {axis: values.shape for axis, values in zip(_AXES, axes, strict=True)}
    if len(set(shapes.values())) > 1 or len(time) != len(axes[0]):
        told = ", ".join(f"{axis} {rows} x {coils}" for axis, (rows, coils) in shapes.items())
        raise UnreadableFileError(f"The files in '{folder}' are not of one recording: {told}, T {len(time)} moments.")
    if len(time) < 2 or axes[0].shape[1] < 4:
        raise UnreadableFileError(f"'{folder}' holds {len(time)} moments of {axes[0].shape[1]} coils: 2 of 4 at least.")
    late = next((line for line, (one, after) in enumerate(pairwise(time), start=2) if after < one), None)
    if late is not None or time[-1] == time[0]:
        raise UnreadableFileError(f"'{folder / 'T.txt'}', line {late or len(time)}: the time does not rise.")
    places = np.stack(axes, axis=-1) @ _TO_FILE * 1e-3
    log = folder / LOG
    return ImagerRecording(time - time[0], places, _events(log, float(time[-1] - time[0])) if log.is_file() else {})


def _lines(rows: list[list[str]]) -> str:
    return "".join("".join(f"{cell};" for cell in row) + "\n" for row in rows)


def _table(path: Path) -> Float[np.ndarray, "rows columns"]:
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path, "recording", _LARGEST).splitlines(), start=1):
        cells = line.strip().rstrip(";").split(";")
        if number > _MOST_RECORDS or len(cells) > _MOST_COILS:
            raise UnreadableFileError(
                f"'{path}', line {number}: more than {_MOST_RECORDS} moments or {_MOST_COILS} coils are not taken."
            )
        rows.append([_number(path, number, cell) for cell in cells])
        if len(rows[-1]) != len(rows[0]):
            raise UnreadableFileError(
                f"'{path}', line {number}: {len(rows[-1])} numbers, but {len(rows[0])} in the first line."
            )
    if not rows:
        raise UnreadableFileError(f"'{path}' is empty.")
    return np.array(rows)


def _number(path: Path, line: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    furthest = math.inf if path.stem == "T" else _FURTHEST
    if not math.isfinite(value) or abs(value) > furthest:
        raise UnreadableFileError(f"'{path}', line {line}: {cell.strip()[:40]!r} is no coordinate or time.")
    return value


def _events(path: Path, last: float) -> dict[str, float]:
    """First time of each event, moved so that the log ends with the recording, at `last` [s]."""
    found: list[tuple[float, str]] = []
    for number, line in enumerate(read_text(path, "log", _LARGEST).splitlines(), start=1):
        time, _, rest = line.partition(";")
        if not line.strip():
            continue
        if number > _MOST_EVENTS:
            raise UnreadableFileError(f"'{path}' holds more than {_MOST_EVENTS} events.")
        found.append((_number(path.with_stem("T"), number, time), rest.partition(";")[0].strip()))
    if not found:
        return {}
    end = found[-1][0]
    events: dict[str, float] = {}
    for time, name in found:
        events.setdefault(name, last - (end - time))
    return events
