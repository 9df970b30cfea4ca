"""`haustra record`: record what a driver, a policy or a script of keys does."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.errors import InvalidOptionError
from haustra.fields import number, whole
from haustra.scripts.drivable import Drivable


@dataclass(frozen=True, kw_only=True)
class Record(Drivable):
    """Record drives without a browser: by follower, endoscopist, a device's own driver, policy, or script of keys."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the recording; of several episodes, for folders of recordings."""
    driver: str = "follower"
    """Name of who drives: follower (of other devices than scopes, their own driver), endoscopist (its assistant presses
    and turns the patient, but in episodes of a task), a policy's folder or name, or a JSON file of keys: a list of
    {"at": seconds, "hand": {lever: share}, "change": {condition: value}, "assist": bool, "back": seconds}."""
    episodes: int = whole(1, 10_000, default=1)
    """Number of recordings; of episodes of a task, from --seed on."""
    seconds: float = number("s", 0.02, 36_000.0, default=60.0)
    """Longest recording, in simulated time [s]; a tip in the caecum and the end of an episode end it, too."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Record."""
        from haustra.envs.control.laws import DRIVERS
        from haustra.files import prepare_folder
        from haustra.scripts.console import progress_bar

        keys = _keys(Path(self.driver)) if self.driver.endswith(".json") else None
        if self.episodes > 1 and self.task is None and (keys is not None or self.driver in DRIVERS):
            raise InvalidOptionError("Drives without a task are all the same: give --task, or one episode.")
        from haustra.envs.console.vehicles import make_vehicle

        vehicle = make_vehicle(self.colon, self.configuration("follower" if keys is not None else self.driver))
        start, found = vehicle.keep(), []
        prepare_folder(self.output)
        with progress_bar("record", self.episodes * self.seconds, unit="s") as advance:
            for episode in range(self.episodes):
                folder = self.output / f"episode-{episode:04d}" if self.episodes > 1 else self.output
                vehicle.begin(start, self.seed + episode)
                found.append(self._record(vehicle, folder, keys, episode, lambda time: advance(time, "")))
        vehicle.close()
        arcs = [one["tip_arc_m"] for one in found]
        total = {"episodes": len(found), "rows": sum(one["rows"] for one in found), "tip_arc_m": max(arcs)}
        return total | {"simulated_s": sum(one["simulated_s"] for one in found), "recording": str(self.output)}

    def _record(
        self, vehicle: Any, folder: Path, keys: list[dict[str, Any]] | None, episode: int, tell: Any
    ) -> dict[str, Any]:
        """One recording."""
        from haustra.envs.console.recording import Recorder
        from haustra.envs.console.script import obey
        from haustra.envs.console.session import Session
        from haustra.envs.runs.outcome import CAECUM_MARGIN

        name = self.driver if keys is None else "keys"
        recorder = Recorder(folder, vehicle, driver=name, seed=self.seed + episode)
        session = Session(vehicle, recorder, assisted=keys is None)
        end = vehicle.around.colon.centreline.length - CAECUM_MARGIN
        waiting = list(keys or ())
        while session.time < self.seconds - vehicle.interval / 2:
            waiting = obey(session, waiting)
            row = session.look.row
            over = row.get("terminated") or row.get("truncated") or row["tip_arc"] >= end
            if over or not session.tick():
                break
            if session.step % 25 == 0:
                tell(episode * self.seconds + session.time)
        return session.end()


def _keys(path: Path) -> list[dict[str, Any]]:
    from haustra.envs.console.script import read_script

    return read_script(path)
