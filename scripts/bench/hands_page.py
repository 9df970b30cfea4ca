"""The console's page in a headless browser, driven by real key events for as long as wanted, and lost in the middle."""

import asyncio
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from haustra.envs.console.recording import Recorder
from haustra.envs.console.session import Session
from haustra.envs.console.source import Drive
from haustra.envs.console.vehicles import make_vehicle
from haustra.scripts.bench.browser import Browser
from haustra.scripts.bench.memory import flatness, groups
from haustra.scripts.bench.shown_drive import shown

_LONGEST_WAY = 240.0
"""The driver has as long as this to come in before the hand draws the scope back [s]."""
_BEFORE_END, _OUT = 0.05, 0.08
"""The hand draws it back from so far before the caecum, to so far from the anus [m]."""
_AWAY = 0.6
"""How long nothing may move while the page is away [s]; it calls again after 0.7 s."""


@dataclass
class _Leg:
    """What came of some driving."""

    seconds: float = 0.0
    pictures: float = 0.0
    outside: float = 0.0
    simulated: float = 0.0
    given_up: float = 0.0
    backlog: float = 0.0

    def __add__(self, other: "_Leg") -> "_Leg":
        return _Leg(*(one + more for one, more in zip(vars(self).values(), vars(other).values(), strict=True)))


def measure_page(
    colon: Path, configuration: dict[str, Any], *, seconds: float, size: int, picture: Path | None = None
) -> dict[str, Any]:
    """Drive in the page by keys, with a driver that steers: in, and out again by hand, over and over, and record it.

    In the middle the page's connection ends while a key is held.

    Args:
        colon: folder of the colon.
        configuration: of the vehicle.
        seconds: how long.
        size: rows and columns of the endoscope's pictures [pixels].
        picture: file for a picture of the page at the end.

    Returns:
        Pictures and views from outside in a second, median time from a key to the picture that shows it [ms], simulated
        time over time, time that was given up since the computer was late, and the drift of the clocks beyond that [s],
        memory and its growth [MB], how soon the hand had let go when the page was lost [ms], whether the page came back
        to the same state, how often the scope was drawn back, and how far the tip came [m].
    """
    with TemporaryDirectory(prefix="haustra-hands-") as folder:
        vehicle = make_vehicle(colon, configuration)
        recorder = Recorder(Path(folder) / "drive", vehicle, driver="hand")
        return asyncio.run(_page(Drive([Session(vehicle, recorder)], size=size), seconds, picture))


async def _page(source: Drive, seconds: float, picture: Path | None) -> dict[str, Any]:
    async with shown(source) as browser:
        await browser.press("KeyT")
        driving = _Driving(source, browser)
        first = await driving.leg(seconds / 2)
        lost = await driving.lose_the_page()
        legs = first + await driving.leg(seconds / 2)
        waits = await browser.ask("haustra.stats.latencies")
        if picture is not None:
            await browser.picture(picture)
    return {
        "seconds": legs.seconds,
        "pictures_per_s": legs.pictures / legs.seconds,
        "outside_per_s": legs.outside / legs.seconds,
        "key_to_picture_ms": float(np.median(waits)) if waits else None,
        "real_time_factor": legs.simulated / legs.seconds,
        "given_up_s": legs.given_up,
        "clock_drift_s": legs.seconds - legs.simulated - legs.given_up - legs.backlog,
        **flatness(driving.memory),
        **lost,
        "ways_out": driving.ways_out,
        "tip_arc_m": driving.furthest,
    }


class _Driving:
    """A hand on the keys of one page."""

    def __init__(self, source: Drive, browser: Browser) -> None:
        self._source, self._session, self._browser = source, source.sessions[0], browser
        self._end = source.sessions[0].vehicle.around.colon.centreline.length - _BEFORE_END
        self._out, self._turned = False, 0.0
        self.memory: list[dict[str, float]] = []
        self.ways_out, self.furthest = 0, 0.0

    async def leg(self, seconds: float) -> _Leg:
        """Let it run, drive for so long, and say what came of it."""
        browser = self._browser
        await browser.press("Space")
        await browser.until("!haustra.last.paused")
        before = await self._counted()
        begun, clock = time.perf_counter(), self._clock()
        while time.perf_counter() < begun + seconds:
            for code in ("KeyD", "KeyA"):  # turning the shaft a little, there and back
                await browser.key(code, down=True)
                await asyncio.sleep(0.3)
                await browser.key(code, down=False)
                await asyncio.sleep(0.7)
            await self._there_and_back()
            self.memory.append(groups(browser.process))
        passed, clock = time.perf_counter() - begun, self._clock() - clock
        after = await self._counted()
        shown = (after[name] - before[name] for name in ("pictures", "outside"))
        return _Leg(passed, *shown, *map(float, clock))

    def _clock(self) -> np.ndarray:
        """Simulated time, time that was given up, and backlog [s]."""
        return np.array([self._session.time, self._source.late, self._source.backlog])

    async def lose_the_page(self) -> dict[str, Any]:
        """End the page's connection while the hand pushes: it lets go, nothing moves, and the page calls again."""
        browser, source, session = self._browser, self._source, self._session
        await browser.key("KeyW", down=True)
        await browser.until("haustra.last.correcting")
        calls = await browser.ask("haustra.stats.reconnects")
        await browser.ask("haustra.socket.close()")
        lost = time.perf_counter()
        while not source.paused or session.hand.share.any():
            await asyncio.sleep(0.001)
        let_go = time.perf_counter() - lost
        step, state = session.step, session.look.row["digest"]
        await asyncio.sleep(_AWAY)
        waited = session.step == step
        await browser.until(
            f"haustra.stats.reconnects > {calls} && haustra.socket.readyState === 1 && haustra.veil.hidden"
        )
        seen = await browser.ask("haustra.stats.frames")
        await browser.until(f"haustra.stats.frames > {seen + 1}")
        row = await browser.ask("haustra.last.row")
        same = session.look.row["digest"] == state and abs(row["time"] - session.time) < session.vehicle.interval / 2
        await browser.key("KeyW", down=False)
        return {"lost_let_go_ms": 1e3 * let_go, "lost_waited": waited, "came_back_to_the_same": same}

    async def _there_and_back(self) -> None:
        """Draw the scope out by a key once it is in or had long enough, until it is nearly out."""
        arc, now = float(self._session.look.row["tip_arc"]), self._session.time
        self.furthest = max(self.furthest, arc)
        turn = arc < _OUT if self._out else arc > self._end
        if turn or now - self._turned > _LONGEST_WAY:
            self._out, self._turned = not self._out, now
            self.ways_out += self._out
            await self._browser.key("KeyS", down=self._out)

    async def _counted(self) -> dict[str, float]:
        return await self._browser.ask("({pictures: haustra.stats.pictures, outside: haustra.views[0].outside.drawn})")
