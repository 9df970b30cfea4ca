"""`haustra bench hands`: how fast the console and the haptic port are."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number
from haustra.scripts.drivable import Drivable, require_extra


@dataclass(frozen=True, kw_only=True)
class BenchHands(Drivable):
    """Measure the console in a headless Chromium by real key events, and the haptic port."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for hands.json and pictures of the page."""
    seconds: float = number("s", 2.0, 36_000.0, default=20.0)
    """Time to drive in the page, and by the haptic port [s]."""
    only: Literal["steps", "haptic", "page", "keys"] | None = None
    """Measure one part only: a control step alone, the haptic port, the page, or an insertion by keys alone."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        require_extra("drive", ("aiohttp",))
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.hands import measured

        folder = prepare_folder(self.output) if self.output is not None else None
        found = measured(self.colon, self.configuration(), seconds=self.seconds, folder=folder, only=self.only)
        if folder is not None:
            write_json(folder / "hands.json", found)
        return found
