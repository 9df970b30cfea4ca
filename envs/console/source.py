"""What the console's page shows: a drive that goes on in real time, or recordings that are played."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from haustra.envs.console.painter import Camera, Glance, Painter
from haustra.envs.console.recording import COLON, Recording
from haustra.envs.console.session import Session
from haustra.envs.console.stage import Stage
from haustra.envs.console.vehicle import Surroundings
from haustra.envs.console.vehicles import surroundings
from haustra.envs.console.wire import pack, plain
from haustra.envs.runs.measure.progress import segment_at
from haustra.errors import HaustraError, InvalidOptionError
from haustra.models.injury.perforation import perforation_probability

Publish = Callable[[str, bytes], None]
"""Called with what a message replaces if it was not sent yet, and the message."""

Seen: TypeAlias = tuple[Mapping[str, Any], Mapping[str, Any], Mapping[str, Any]]
"""A row, what is drawn with it, and what a picture of it is about."""

WATCHDOG = 0.3
"""A hand that was not heard of for this long has let go [s]; engineering choice: three beats of the page."""
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Simulated time over time."""
INTERVAL = 1 / 25
"""Least time between two messages of what is seen from outside, and between two pictures [s]; engineering choice."""
_MOST_BEHIND = 0.25
"""Backlog beyond this is given up instead of being caught up with [s]."""
_REST = 0.002
"""Sleep of a loop that has nothing to do [s]."""


class View:
    """One colon with a device, and its camera."""

    def __init__(self, around: Surroundings, number: int, size: int) -> None:
        """Show what is driven there, with pictures of that many rows and columns."""
        self.around, self.number = around, number
        self.stage, self.painter = Stage(around), Painter(Camera(around, size))
        self.pictures = 0
        """Pictures that were drawn."""
        self._asked = -math.inf

    def scene(self, **more: Any) -> bytes:
        """What does not change."""
        colon = self.around.colon
        header = {
            "kind": "scene",
            "view": self.number,
            "name": colon.name,
            "length": colon.centreline.length,
            "segments": [[one.name, one.start, one.end] for one in colon.segments],
            "landmarks": [[name, arc] for name, arc in colon.landmarks.items() if isinstance(arc, int | float)],
            "radius": self.around.radius,
            **more,
        }
        arrays = {"faces": self.stage.faces, "stations": self.stage.stations, "rest": self.stage.vertices()}
        return pack(header, arrays)

    def frame(self, row: Mapping[str, Any], frame: Mapping[str, Any], **more: Any) -> bytes:
        """What changes."""
        arc = float(row["tip_arc"])
        numbers = plain(row)
        if "load" in numbers and "p_perforation" not in numbers:
            numbers["p_perforation"] = float(perforation_probability(numbers["load"]))
        header = {"kind": "frame", "view": self.number, "row": numbers, "segment": segment_at(self.around.colon, arc)}
        moved = self.stage.vertices(frame.get("displacement"), frame.get("widths"))
        arrays = {"vertices": moved, "shape": frame["shape"], "pressed": frame["pressed"], "pain": frame["pain"]}
        if "gas_pressure" in row:
            arrays["gas"] = row["gas_pressure"]
        return pack({**header, **more}, {name: np.asarray(values, np.float32) for name, values in arrays.items()})

    def glance(self, now: float, seen: Callable[[], Seen]) -> None:
        """Ask for a picture of what is seen, unless one is being drawn or was asked for just now."""
        if now - self._asked < INTERVAL or self.painter.busy:
            return
        row, frame, about = seen()
        self.painter.ask(glance_at(row, frame), about)
        self._asked = now

    def picture(self) -> bytes | None:
        """A picture that is done."""
        if (done := self.painter.take()) is None:
            return None
        content, about = done
        self.pictures += 1
        header = {"kind": "picture", "view": self.number, **about}
        return pack(header, {"jpeg": np.frombuffer(content, np.uint8)})


def glance_at(row: Mapping[str, Any], frame: Mapping[str, Any]) -> Glance:
    """Where the camera is in a row and what is drawn with it."""
    given = {name: np.asarray(frame[name], float) for name in ("displacement", "widths", "blood") if name in frame}
    given |= {name: np.asarray(frame[name], int) for name in ("tissue",) if name in frame}
    if "blood" in given:
        given["blood"] = given["blood"][~np.isnan(given["blood"][:, 0])]
    return Glance(np.asarray(row["tip"], float), np.asarray(row["tip_frame"], float), float(row["tip_arc"]), **given)


class Source(ABC):
    """Runs in a thread of its own; commands are obeyed between two steps."""

    mode: str

    def __init__(self, views: Sequence[View]) -> None:
        """Show these."""
        self.views = list(views)
        self.paused, self.speed = True, 1.0
        self._publish: Publish = lambda what, message: None
        self._commands: deque[tuple[Mapping[str, Any], Callable[[str], None]]] = deque()
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)
        self._due, self._shown = 0.0, -math.inf
        self.late = 0.0
        """Time that was given up since the computer was too slow [s]."""
        self.failed: BaseException | None = None
        """What ended the thread, if anything did."""

    @property
    def ready(self) -> bool:
        """Whether pictures can be drawn."""
        return all(view.painter.ready for view in self.views)

    @property
    def backlog(self) -> float:
        """Simulated time that is still to be caught up with [s]."""
        return self._due

    def start(self, publish: Publish) -> None:
        """Begin."""
        self._publish = publish
        self._thread.start()

    def mute(self) -> None:
        """Tell nobody any more."""
        self._publish = lambda what, message: None

    def command(self, said: Mapping[str, Any], answer: Callable[[str], None] = lambda said: None) -> None:
        """Obey the page soon; `answer` is told what cannot be done."""
        self._commands.append((said, answer))

    def close(self) -> dict[str, Any]:
        """End thread and processes, and say what came of it."""
        self._ends.set()
        if self._thread.is_alive():
            self._thread.join(timeout=10)
        for view in self.views:
            view.painter.close()
        return {}

    @abstractmethod
    def scenes(self) -> list[bytes]:
        """What a page is told first."""

    @abstractmethod
    def obey(self, name: str, value: Any) -> None:
        """Do what one entry of a message says.

        Raises:
            HaustraError: when it cannot be done.
        """

    @abstractmethod
    def advance(self, seconds: float) -> float:
        """Go on by up to so much simulated time, and say by how much it went [s]."""

    @abstractmethod
    def seen(self, number: int) -> Seen:
        """What a view shows now."""

    @abstractmethod
    def state(self, number: int) -> dict[str, Any]:
        """What else is said of a view."""

    def _run(self) -> None:
        try:
            before = time.perf_counter()
            while not self._ends.is_set():
                while self._commands:
                    self._obey(*self._commands.popleft())
                now = time.perf_counter()
                self._due += 0.0 if self.paused else (now - before) * self.speed
                before = now
                most = _MOST_BEHIND * max(self.speed, 1.0)
                self.late += max(self._due - most, 0.0)
                self._due = min(self._due, most)
                gone = 0.0
                if self.paused:
                    self._due = 0.0
                elif self._due > 0:
                    gone = self.advance(self._due)
                    self._due -= gone
                self._look(now)
                if not gone:
                    time.sleep(_REST)
        except BaseException as error:
            self.failed = error
            self._publish("error", pack({"kind": "ended", "say": f"{type(error).__name__}: {error}"}))
            raise

    def _look(self, now: float) -> None:
        due = now - self._shown >= INTERVAL
        for view in self.views:
            if (picture := view.picture()) is not None:
                self._publish(f"picture {view.number}", picture)
            view.glance(now, partial(self.seen, view.number))
            if due:
                row, frame, _ = self.seen(view.number)
                self._publish(f"frame {view.number}", view.frame(row, frame, **self.state(view.number)))
        if due:
            self._shown = now

    def _obey(self, said: Mapping[str, Any], answer: Callable[[str], None]) -> None:
        for name, value in said.items():
            try:
                match name:
                    case "pause":
                        self.paused = bool(value)
                    case "speed":
                        if value not in SPEEDS:
                            raise InvalidOptionError(f"Speed {value!r} is not known. Known: {SPEEDS}.")
                        self.speed = float(value)
                    case _:
                        self.obey(name, value)
            except (HaustraError, TypeError, ValueError, AttributeError) as error:
                answer(f"{name}: {error}")


class Drive(Source):
    """Sessions that go on in real time under one hand."""

    mode = "drive"

    def __init__(self, sessions: Sequence[Session], *, size: int) -> None:
        """Show these sessions, with pictures of `size` rows and columns."""
        super().__init__([View(session.vehicle.around, number, size) for number, session in enumerate(sessions)])
        self.sessions = list(sessions)
        self.before_step: Callable[[float], None] | None = None
        """Called with the control step [s] before any, to move the hand: a device on the desk does."""
        self._heard, self._said_at, self._acted_on = -math.inf, 0.0, 0.0

    def scenes(self) -> list[bytes]:
        """Colons, levers and conditions."""
        told: dict[str, Any] = {"mode": self.mode, "views": len(self.views), "speeds": SPEEDS}
        found = []
        for view, session in zip(self.views, self.sessions, strict=True):
            own = {name: [vars(one) for one in getattr(session.vehicle, name)] for name in ("levers", "conditions")}
            found.append(view.scene(**told, **own))
        return found

    def let_go(self) -> None:
        """Take the hand off everything and wait: the page is gone."""
        self.command({"hand": {}, "pause": True})

    def advance(self, seconds: float) -> float:
        """Whole control steps, of all sessions alike."""
        if time.perf_counter() - self._heard > WATCHDOG:
            for session in self.sessions:
                session.hand.let_go()
        interval = self.sessions[0].vehicle.interval
        if self.before_step is not None:
            self.before_step(interval)
        if seconds < interval:
            return 0.0
        for session in self.sessions:
            count = round(interval / session.vehicle.interval)
            if not all(session.tick() for _ in range(max(1, count))):
                self.paused = True
        self._acted_on = self._said_at
        return interval

    def seen(self, number: int) -> Seen:
        """What a session has come to."""
        look = self.sessions[number].look
        return look.row, look.frame, {"time": float(look.row["time"]), "echo": self._acted_on}

    def state(self, number: int) -> dict[str, Any]:
        """What the page shows of a session beside numbers."""
        session = self.sessions[number]
        return {
            "conditions": session.conditions(),
            "marks": session.marks,
            "assisted": session.assisted,
            "correcting": session.correcting,
            "sound": session.sound,
            "paused": self.paused,
            "speed": self.speed,
            "late": round(self.late, 3),
            "knobs": session.hand.knobs.round(4).tolist(),
            "locked": session.hand.locked.tolist(),
            "echo": self._acted_on,
            "said": session.vehicle.said,
            "recording": session.recorder is not None,
        }

    def obey(self, name: str, value: Any) -> None:
        """What a page may say."""
        match name:
            case "hand":
                self._heard = time.perf_counter()
                for session in self.sessions:
                    own = [lever.name for lever in session.vehicle.levers]
                    session.hold({name: share for name, share in value.items() if name in own})
            case "t":
                self._said_at = float(value)
            case "put" | "lock":
                for session in self.sessions:
                    for lever, given in value.items():
                        if (number := session.vehicle.lever(lever)) >= 0:
                            if name == "put":
                                session.hand.put(number, float(given))
                            else:
                                session.hand.locked[number] = bool(given)
            case "assist":
                for session in self.sessions:
                    session.assisted = bool(value)
            case "back":
                for session in self.sessions:
                    session.back(float(value))
            case "mark" | "restart":
                for session in self.sessions:
                    (session.mark if name == "mark" else session.restart)(str(value)[:40])
            case "change":
                for session in self.sessions:
                    for condition, given in value.items():
                        session.change(condition, given)
            case _:
                raise InvalidOptionError("not known to a drive")
        if name in ("back", "restart"):
            self._due = 0.0

    def close(self) -> dict[str, Any]:
        """End all; what was recorded is whole."""
        super().close()
        first, *_ = [session.close() for session in self.sessions]
        return first


class Playback(Source):
    """Recordings that are played beside each other."""

    mode = "replay"

    def __init__(self, recordings: Sequence[Recording], *, size: int) -> None:
        """Play these from their beginning."""
        found = [surroundings(one.folder / COLON, one.about["vehicle"]) for one in recordings]
        super().__init__([View(around, number, size) for number, around in enumerate(found)])
        self.recordings = list(recordings)
        self.time = 0.0
        self.duration = max(float(one.rows["time"][-1]) for one in recordings)

    def scenes(self) -> list[bytes]:
        """Scenes, and how long they take."""
        told: dict[str, Any] = {"mode": self.mode, "views": len(self.views), "speeds": SPEEDS}
        told["duration"] = self.duration
        return [
            view.scene(**told, driver=one.about["driver"], corrections=one.corrections()[:1000])
            for view, one in zip(self.views, self.recordings, strict=True)
        ]

    def advance(self, seconds: float) -> float:
        """Time goes on, up to the end."""
        self.time = min(self.time + seconds, self.duration)
        if self.time >= self.duration:
            self.paused = True
        return seconds

    def seen(self, number: int) -> Seen:
        """Where a recording is at this time."""
        row, frame = moment(self.recordings[number], self.time)
        return row, frame, {"time": round(self.time, 3), "echo": 0.0}

    def state(self, number: int) -> dict[str, Any]:
        """What the slider shows."""
        return {"paused": self.paused, "speed": self.speed, "time": round(self.time, 3), "late": 0.0}

    def obey(self, name: str, value: Any) -> None:
        """What a page may say."""
        match name:
            case "seek":
                self.time = float(np.clip(value, 0.0, self.duration)) if math.isfinite(value) else self.time
            case "hand" | "t":
                return
            case _:
                raise InvalidOptionError("not known to a replay")

    def close(self) -> dict[str, Any]:
        """End all."""
        super().close()
        return {"duration_s": self.duration}


def moment(recording: Recording, at: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The row at a time [s], and what is drawn then, between two frames as far as time goes."""
    rows, frames = recording.rows, recording.frames
    step = int(np.clip(np.searchsorted(rows["time"], at, side="right") - 1, 0, len(rows["time"]) - 1))
    row = {name: values[step] for name, values in rows.items()}
    after = int(np.clip(np.searchsorted(frames["step"], step, side="right"), 0, len(frames["step"]) - 1))
    before = max(after - 1, 0)
    span = float(frames["step"][after] - frames["step"][before])
    exact = (at - float(rows["time"][0])) / recording.interval
    share = float(np.clip((exact - float(frames["step"][before])) / span, 0.0, 1.0)) if span > 0 else 0.0
    drawn = {}
    for name, values in frames.items():
        if values.dtype.kind == "f" and name != "blood":
            drawn[name] = values[before] + share * (values[after].astype(float) - values[before])
        else:  # what is counted changes at once
            drawn[name] = values[after if share >= 1.0 else before]
    return row, drawn
