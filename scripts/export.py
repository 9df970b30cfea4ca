"""`haustra export`: recordings for other programs."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.errors import InvalidOptionError
from haustra.fields import number, whole


@dataclass(frozen=True, kw_only=True)
class Export:
    """Export recordings as a Minari data set, in LeRobot's layout, or as a film."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of a recording, or of folders of recordings, which become episodes."""
    to: Literal["minari", "lerobot", "mp4", "gif"]
    """Format: a Minari data set, the layout of LeRobotDataset v3.0, or a film."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder or file to write; beside the recording when not given. Of Minari: the folder of data sets, as
    MINARI_DATASETS_PATH names it; the user's own when not given."""
    name: str = "haustra/drive-v0"
    """Name of the Minari data set."""
    fps: float = number("1/s", 1.0, 60.0, default=10.0)
    """Pictures of a film in a second [1/s]."""
    speed: float = number("1", 0.05, 100.0, default=1.0)
    """Simulated time over a film's [1]."""
    pictures: bool = True
    """Draw the endoscope's pictures for LeRobot."""
    size: int = whole(16, 720, default=128)
    """Rows and columns of those pictures [pixels]."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Write."""
        from haustra.envs.console.recording import ABOUT, load_recording
        from haustra.scripts.console import progress_bar

        inner = sorted(path.parent for path in self.folder.glob(f"*/{ABOUT}"))
        whole = (self.folder / ABOUT).is_file() or not inner
        recordings = [load_recording(one) for one in ([self.folder] if whole else inner)]
        if self.to == "minari":
            from haustra.envs.console.to_minari import export_minari

            return export_minari(recordings, self.name, self.output)
        place = self.output or self.folder / ("lerobot" if self.to == "lerobot" else f"film.{self.to}")
        if self.to != "lerobot":
            if len(recordings) > 1:
                raise InvalidOptionError(f"'{self.folder}' holds {len(recordings)} recordings: name one for a film.")
            if place.suffix != f".{self.to}":
                raise InvalidOptionError(f"'{place.name}' does not end in .{self.to}: name it so.")
        with progress_bar("draw", 1, unit="films") as advance:
            tell = lambda done, total: advance(done / total, f"{done} of {total}")  # noqa: E731
            if self.to == "lerobot":
                from haustra.envs.console.to_lerobot import export_lerobot

                return export_lerobot(recordings, place, size=self.size, pictures=self.pictures, progress=tell)
            from haustra.envs.console.film import write_film

            return write_film(place, recordings[0], fps=self.fps, speed=self.speed, progress=tell)
