"""`haustra replay`: play recordings in the browser, or do one again and compare bits."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.errors import InvalidOptionError
from haustra.fields import whole
from haustra.scripts.drivable import require_extra


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Play one or two recordings in the browser, with a time slider; or check that one repeats to the bit."""

    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders that `haustra drive -o` or `haustra record` wrote; two are shown beside each other."""
    check: bool = False
    """Do it again instead, step by step, and say whether every state is the same to the bit."""
    picture: int = whole(64, 720, default=360)
    """Rows and columns of the endoscope's picture [pixels]."""
    host: str = "127.0.0.1"
    """Address to listen on; other machines can reach it when it is not 127.0.0.1."""
    port: int = whole(0, 65535, default=0)
    """Number of the port to listen on; any free one when 0."""
    browser: bool = True
    """Open the browser."""
    json: bool = field(default=False)
    """Print one line, {"url"}, once the page is ready; of --check, what was found."""

    def __call__(self) -> dict[str, Any] | None:
        """Serve until interrupted, or check."""
        from haustra.envs.console.recording import load_recording

        if not 1 <= len(self.recordings) <= (1 if self.check else 2):
            raise InvalidOptionError(f"{len(self.recordings)} recordings were named: give one, or two to play.")
        recordings = [load_recording(folder) for folder in self.recordings]
        if self.check:
            return _checked(recordings[0])
        require_extra("drive", ("aiohttp",))
        from haustra.envs.console.source import Playback
        from haustra.scripts.drive import serve

        return serve(Playback(recordings, size=self.picture), self)


def _checked(recording: Any) -> dict[str, Any]:
    from haustra.envs.console.replay import repeat
    from haustra.scripts.console import progress_bar

    with progress_bar("replay", len(recording.rows["step"]), unit="steps") as advance:
        found = repeat(recording, progress=lambda step: advance(step, ""))
    return {
        "exact": found.exact,
        "steps": found.steps,
        "first_difference": found.first_difference,
        "same_machine": found.same_machine,
    }
