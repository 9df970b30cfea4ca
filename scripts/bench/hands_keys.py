"""A scope that is brought in by keys alone: which keys a hand holds that sees where the lumen goes, and no more."""

import asyncio
import time
from collections.abc import Set as AbstractSet
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.session import Session
from haustra.envs.console.source import Drive
from haustra.envs.console.vehicles import make_vehicle
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.scripts.bench.shown_drive import shown

_AHEAD = 0.045
"""How far ahead of the tip the hand looks down the lumen [m]."""
_TURN, _ENOUGH, _LOST = 0.2, 0.1, 0.7
"""A knob's key is held while the lumen lies farther aside than the first, until the second; farther than the third
nothing is pushed [rad]."""
_FIRM = 30.0
"""Push at which the hand waits [N]."""
_PATIENCE, _DRAWN, _PROGRESS = 4.0, 1.2, 0.004
"""After so long without so much lumen passing it draws back for so long [s, s, m]."""
_BEAT = 0.08
"""Time between two looks [s]."""
KEYS = ("KeyW", "KeyS", "KeyA", "KeyD", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight")


class Eyes:
    """What a hand does that sees the lumen: it steers for it, pushes, and draws back and turns when it gets stuck."""

    def __init__(self, session: Session) -> None:
        """Watch a drive."""
        around = session.vehicle.around
        self._session, self._line = session, around.colon.centreline
        self._moved = None
        if around.tables is not None:
            self._moved = CurrentColon(around.colon, around.tables, around.origin, around.axes)
        self._held: frozenset[str] = frozenset()
        self._best, self._since, self._draws_until, self._turns = 0.0, 0.0, -1.0, 0

    def keys(self) -> frozenset[str]:
        """Keys that are to be held now, of `KEYS`."""
        row, frame = self._session.look.row, self._session.look.frame
        up, left = self._aside(row, frame)
        held = {key for key in self._held if key.startswith("Arrow")}
        for angle, more, less in ((up, "ArrowUp", "ArrowDown"), (left, "ArrowLeft", "ArrowRight")):
            key, other = (more, less) if angle > 0 else (less, more)
            held.discard(other)
            if abs(angle) > _TURN:
                held.add(key)
            elif abs(angle) < _ENOUGH:
                held.discard(key)
        arc, now = float(row["tip_arc"]), self._session.time
        if arc > self._best + _PROGRESS:
            self._best, self._since = arc, now
        if now - self._since > _PATIENCE:
            self._best, self._since, self._draws_until, self._turns = arc, now, now + _DRAWN, self._turns + 1
        if now < self._draws_until:
            held |= {"KeyS", "KeyD" if self._turns % 2 else "KeyA"}
            self._best = arc
        elif max(abs(up), abs(left)) < _LOST and float(row["push_force"]) < _FIRM:
            held.add("KeyW")
        self._held = frozenset(held)
        return self._held

    def _aside(self, row: Any, frame: Any) -> tuple[float, float]:
        """Angles at which the lumen ahead lies off the tip's axis, towards up and left [rad]."""
        line = self._line
        way = line.points if self._moved is None else self._moved.way(np.asarray(frame["displacement"], float))
        at = min(float(row["tip_arc"]) + _AHEAD, line.length)
        target = np.array([np.interp(at, line.arc, way[:, axis]) for axis in range(3)])
        up, left, ahead = np.asarray(row["tip_frame"]).T @ (target - np.asarray(row["tip"]))
        return float(np.arctan2(up, ahead)), float(np.arctan2(left, ahead))


def measure_keys(
    colon: Path,
    configuration: dict[str, Any],
    *,
    seconds: float,
    reach: float | None = None,
    folder: Path | None = None,
) -> dict[str, Any]:
    """Bring a scope in by real key events in the page, no driver helping, until the tip has come far enough.

    Args:
        colon: folder of the colon.
        configuration: of the vehicle.
        seconds: longest time, by the clock [s].
        reach: arc length to come to [m]; 2 cm past the sigmoid's end when None.
        folder: for pictures of the page, before and after.

    Returns:
        Whether it came there, how far [m], the simulated time [s], key events, and the largest force on the wall [N].
    """
    source = Drive([Session(make_vehicle(colon, configuration))], size=360)
    return asyncio.run(_bring_in(source, seconds, reach or _past_sigmoid(source), folder))


def _past_sigmoid(source: Drive) -> float:
    segments = source.sessions[0].vehicle.around.colon.segments
    return next(one.end for one in segments if one.name == "sigmoid") + 0.02


async def _bring_in(source: Drive, seconds: float, reach: float, folder: Path | None) -> dict[str, Any]:
    session, eyes = source.sessions[0], Eyes(source.sessions[0])
    down: AbstractSet[str] = frozenset()
    events, hardest = 0, 0.0
    async with shown(source) as browser:
        if folder is not None:
            await browser.picture(folder / "keys-before.png")
        await browser.press("Space")
        begun = time.perf_counter()
        while float(session.look.row["tip_arc"]) < reach and time.perf_counter() < begun + seconds:
            held = eyes.keys()
            for key in sorted(down ^ held):
                await browser.key(key, down=key in held)
            events, down = events + len(down ^ held), held
            hardest = max(hardest, float(session.look.row["wall_force"]))
            await asyncio.sleep(_BEAT)
        for key in down:
            await browser.key(key, down=False)
        row = session.look.row
        if folder is not None:
            await browser.picture(folder / "keys-after.png")
    return {
        "keys_reached": bool(row["tip_arc"] >= reach),
        "keys_tip_arc_m": float(row["tip_arc"]),
        "keys_goal_m": reach,
        "keys_simulated_s": float(row["time"]),
        "key_events": events,
        "keys_wall_force_max_N": hardest,
        "driver_helped": session.assisted,
    }
