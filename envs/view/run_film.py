"""A run as a film: what its tip saw beside the colon from outside, as animated WebP."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.film import draw_pictures
from haustra.envs.console.motion import run_surroundings
from haustra.envs.runs.insertion import Trajectory
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.files import write_atomically
from haustra.models.scene import Scene

FILM = "film.webp"
"""File of a run's folder."""
_PICTURES = 72
"""Pictures of a film: few enough for a page to load at once."""
_SHOWN_MS, _LAST_MS = 140, 2500
"""How long a picture is shown, and the last one [ms]; engineering choice: what the eye follows."""
_QUALITY = 60
"""Quality of the WebP compression, 0 to 100."""


def write_run_film(
    path: Path,
    scene: Scene,
    seen: Trajectory,
    *,
    progress: Callable[[int, int], None] = lambda done, pictures: None,
) -> Path:
    """Draw a run that has records as a film of some ten seconds.

    Raises:
        OutputError: when the file cannot be written.
    """
    recorded, moves = RecordedRun(scene, seen), bool(seen.displacement.shape[1])
    times = np.linspace(seen.time[0], seen.time[-1], min(_PICTURES, len(seen.time)))

    def moment(at: float) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
        record = min(int(np.searchsorted(seen.time, at - 1e-9)), len(seen.time) - 1)
        shape = recorded.shape(record)
        row = {name: getattr(seen, name)[record] for name in ("time", "tip", "tip_arc", "wall_force", "insertion")}
        frame = {"shape": shape} | ({"displacement": seen.displacement[record]} if moves else {})
        return row | {"tip_frame": recorded.tip_frame()}, frame

    def write(temporary: Path) -> None:
        pictures = draw_pictures(run_surroundings(scene, seen), times, moment, progress)
        first = next(pictures)
        shown = [_SHOWN_MS] * (len(times) - 1) + [_LAST_MS]
        first.save(
            temporary,
            format="WEBP",
            save_all=True,
            append_images=pictures,
            duration=shown,
            loop=0,
            quality=_QUALITY,
            method=4,
        )

    return write_atomically(path, write)
