"""`haustra dataset`: pictures with every ground truth."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole

_OWN = ("colons", "clips", "frames", "noise", "exposure", "gain", "gamma", "stool", "mucus")
"""Options that stand in place of the data set's own."""


@dataclass(frozen=True)
class Dataset:
    """Make a data set: pictures with depth, normals, flow, occlusion, poses, moving surface, masks, forces and hands.

    quick: some tens of pictures within a minute. standard: 2,400 pictures at half the size of C3VD's. full: 40,000 at
    C3VD's size. A data set that was interrupted goes on where it was.
    """

    name: Annotated[str, tyro.conf.Positional]
    """Which data set: quick, standard or full."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the data set."""
    seed: int = whole(0, 2**62, default=0)
    """Seed of the first colon; each further one has the next. The same seed makes the same data set."""
    colons: int | None = whole(1, 1000, default=None)
    """Number of colons, each with one run; that of the data set's name when not given."""
    clips: int | None = whole(1, 1000, default=None)
    """Stretches of each run that are shown; that of the data set's name when not given."""
    frames: int | None = whole(2, 9999, default=None)
    """Pictures in each clip; that of the data set's name when not given."""
    noise: float | None = number("1", 0.0, 0.5, default=None)
    """Standard deviation of the camera's noise at full light, of the most that fits [1]; none when not given."""
    exposure: float | None = number("s", 0.0, 0.04, default=None)
    """Time for which a picture is exposed, for motion blur [s]; its ground truth is of the middle. None when not
    given."""
    gain: float | None = number("1", 1e-9, 1.0, default=None)
    """Fixed exposure of light [1], 0.001 or so; automatic for each picture when not given."""
    gamma: float | None = number("1", 0.5, 5.0, default=None)
    """Power of the camera's curve [1]; 2.2 when not given."""
    stool: float | None = number("1", 0.0, 1.0, default=None)
    """Share of the lower wall under stool [1]; none when not given."""
    mucus: float | None = number("1", 0.0, 1.0, default=None)
    """Share of the wall under mucus [1]; none when not given."""
    run: Path | None = None
    """Folder of a run by `haustra run` to take pictures of, instead of growing colons; a withdrawal by --inspect is
    taken too. Its colon is to be named by --colon."""
    colon: Path | None = None
    """Folder of the colon that --run was in."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Make it, measure it, and return how exact it is."""
        from haustra.envs.view.dataset.make import make_dataset
        from haustra.envs.view.dataset.recorded import recorded
        from haustra.envs.view.dataset.settings import find_preset
        from haustra.errors import InvalidOptionError
        from haustra.provenance import file_hash
        from haustra.scripts.console import progress_bar

        given = {name: value for name in _OWN if (value := getattr(self, name)) is not None}
        settings = replace(find_preset(self.name), **given)
        total = settings.colons * settings.clips * settings.frames
        own: dict[str, Any] = {}
        if self.run is not None and self.colon is not None:
            if self.colons is not None:
                raise InvalidOptionError("A run is in one colon: leave --colons out.")
            own = {"sources": recorded(self.run, self.colon), "of": file_hash(self.run / "scores.json")}
        elif self.run is not None or self.colon is not None:
            raise InvalidOptionError("Pictures of a recorded run need both: give --run and --colon.")
        with progress_bar("rendering", total, unit="pictures") as advance:
            return make_dataset(self.output, settings, name=self.name, seed=self.seed, progress=advance, **own)
