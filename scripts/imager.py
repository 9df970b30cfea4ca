"""`haustra imager export` and `score`: coordinates of a magnetic imager, of runs and of patients."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class ImagerExport:
    """Write a run as a magnetic imager would have recorded it, in the layout of the public CAMES coordinate set."""

    run: Annotated[Path, tyro.conf.Positional]
    """Folder that `haustra run` wrote."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for X.txt, Y.txt, Z.txt, T.txt and LogFile_P.txt."""
    colon: Path | None = None
    """Folder of the run's colon, from which the log has the times of the flexures and the caecum; no landmarks when
    not given."""
    coils: int = whole(4, 64, default=17)
    """Number of coils, 10 cm apart from the tip on; fewer on a scope that is shorter."""
    interval: float = number("s", 0.001, 10.0, default=0.1)
    """Time between two records [s]."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Write the files."""
        from haustra.envs.runs.imager_export import recording_of_run
        from haustra.envs.runs.imager_files import write_recording

        recording = recording_of_run(
            self.run, interval=self.interval, coils=self.coils, colon=self.colon and self._colon(self.colon)
        )
        written = write_recording(self.output, recording)
        return {
            "records": len(recording.time),
            "coils": recording.coils.shape[1],
            "events": dict(recording.events),
            "written": [str(path) for path in written],
        }

    def _colon(self, folder: Path):
        from haustra.errors import InvalidOptionError
        from haustra.models.anatomy.store import colon_hash, load_colon
        from haustra.reading import LARGEST_RECORD, read_document

        colon = load_colon(folder)
        scores = read_document(self.run / "scores.json", "run", largest=LARGEST_RECORD)
        try:
            known = scores["provenance"]["inputs"]["colon"]
        except (KeyError, TypeError):
            known = None
        if known != colon_hash(colon):
            raise InvalidOptionError(f"The run in '{self.run}' was not in the colon '{folder}': name its own.")
        return colon


@dataclass(frozen=True)
class ImagerScore:
    """Judge an insertion from a magnetic imager's coordinates alone, simulated or clinical."""

    recording: Annotated[Path, tyro.conf.Positional]
    """Folder with X.txt, Y.txt, Z.txt and T.txt, and LogFile_P.txt where it is known."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Score the recording."""
        from haustra.envs.runs.imager_files import read_recording
        from haustra.envs.runs.measure.imager import imager_scores

        return imager_scores(read_recording(self.recording))
