"""How fast hands are served: the page in a headless browser by real key events, and the haptic port."""

import asyncio
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.haptic import HapticClient, HapticPort
from haustra.envs.console.server import Server
from haustra.envs.console.session import Session
from haustra.envs.console.source import Drive
from haustra.envs.console.vehicles import make_vehicle
from haustra.scripts.bench.browser import Browser, chromium

_FIRST, _LAST = 0.1, 1.0
"""Shares of a drive between which memory and clock are compared."""
_DEVICE_RATE = 1000.0
"""Rate at which the haptic client asks, as far as it is answered [Hz]."""
_PUSHES = """
import sys, time
from haustra.envs.console.haptic import HapticClient
client, begun = HapticClient(int(sys.argv[1])), time.perf_counter()
while True:
    client.ask(0.02 * (time.perf_counter() - begun) % 0.02, 0.0)
    print(flush=True)
    time.sleep(0.001)
"""


def measure_page(
    colon: Path, configuration: dict[str, Any], *, seconds: float, size: int, picture: Path | None = None
) -> dict[str, float | None]:
    """Drive in the page by keys, with a driver that steers.

    Args:
        colon: folder of the colon.
        configuration: of the vehicle.
        seconds: how long.
        size: rows and columns of the endoscope's pictures [pixels].
        picture: file for a picture of the page at the end.

    Returns:
        Pictures and views from outside in a second, median time from a key to the picture that shows it [ms], simulated
        time over time, growth of memory [MB], and how far the tip came [m].
    """
    return asyncio.run(_page(Drive([Session(make_vehicle(colon, configuration))], size=size), seconds, picture))


async def _page(source: Drive, seconds: float, picture: Path | None) -> dict[str, float | None]:
    server, ends = Server(source), asyncio.Event()
    told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    running = asyncio.create_task(server.run(told.set_result, ends))
    try:
        url = await told
        async with Browser() as browser:
            await browser.open(url)
            await browser.until("window.haustra && haustra.stats.pictures > 1 && haustra.stats.frames > 1")
            await browser.press("Space")
            await browser.press("KeyT")
            begun, before = time.perf_counter(), await _counted(browser)
            memory: list[float] = []
            while time.perf_counter() < begun + seconds:
                for code in ("KeyD", "KeyA"):  # turning the shaft a little, there and back
                    await browser.key(code, down=True)
                    await asyncio.sleep(0.3)
                    await browser.key(code, down=False)
                    await asyncio.sleep(0.7)
                memory.append(_memory())
            after = await _counted(browser)
            passed = after["now"] - before["now"]
            waits = await browser.ask("haustra.stats.latencies")
            if picture is not None:
                await browser.picture(picture)
            assert not browser.errors, browser.errors
    finally:
        ends.set()
        await running
        source.close()
    early = memory[min(int(_FIRST * len(memory)), len(memory) - 1)]
    rates = {name: (after[name] - before[name]) / passed for name in ("pictures", "outside", "simulated")}
    return {
        "pictures_per_s": rates["pictures"],
        "outside_per_s": rates["outside"],
        "key_to_picture_ms": float(np.median(waits)) if waits else None,
        "real_time_factor": rates["simulated"],
        "memory_growth_MB": memory[-1] - early,
        "tip_arc_m": after["arc"],
    }


async def _counted(browser: Browser) -> dict[str, float]:
    return await browser.ask(
        "({now: performance.now() / 1000, pictures: haustra.stats.pictures, outside: haustra.views[0].outside.drawn, "
        "simulated: haustra.last.row.time, arc: haustra.last.row.tip_arc})"
    )


def _memory() -> float:
    """Memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def measure_haptic(colon: Path, configuration: dict[str, Any], *, seconds: float) -> dict[str, float]:
    """Let a device push at a kilohertz, and kill another one in the middle.

    Returns:
        Answers in a second, round trip and the time between answers [ms], and how long after its client was killed the
        hand had let go [ms].
    """
    source = Drive([Session(make_vehicle(colon, configuration))], size=64)
    source.start(lambda what, message: None)
    source.command({"pause": False})
    try:
        with HapticPort(source) as port:
            client, trips, at = HapticClient(port.port), [], []
            begun = time.perf_counter()
            while (now := time.perf_counter()) < begun + seconds:
                trips.append(client.ask(0.005 * np.sin(now - begun), 0.0)[2])
                at.append(time.perf_counter())
                rest = begun + len(at) / _DEVICE_RATE - time.perf_counter()
                if rest > 0:
                    time.sleep(rest)
            client.close()
            killed = [_kill(port) for _ in range(3)]
    finally:
        source.close()
    gaps = 1e3 * np.diff(at)
    return {
        "rate_Hz": len(at) / (at[-1] - begun),
        "round_trip_median_ms": 1e3 * float(np.median(trips)),
        "round_trip_99_ms": 1e3 * float(np.quantile(trips, 0.99)),
        "gap_99_ms": float(np.quantile(gaps, 0.99)),
        "gap_max_ms": float(gaps.max()),
        "let_go_ms": 1e3 * max(killed),
    }


def _kill(port: HapticPort) -> float:
    with subprocess.Popen(
        [sys.executable, "-c", _PUSHES, str(port.port)], stdout=subprocess.PIPE, env=os.environ
    ) as pushing:
        assert pushing.stdout is not None
        while not port.holds:
            pushing.stdout.readline()
        for _ in range(100):
            pushing.stdout.readline()
        pushing.kill()
        killed = time.perf_counter()
    while port.holds:
        time.sleep(0.001)
    return port.let_go_at - killed


def measure_steps(colon: Path, configuration: dict[str, Any], *, steps: int = 200) -> dict[str, float]:
    """Time of a control step and of what is looked at after it, and of a picture, in this process alone [ms].

    A picture is drawn by as many threads as there are cores: beside its time stands the processor's.
    """
    from haustra.envs.console.painter import Camera, Eye, jpeg
    from haustra.envs.console.source import glance_at

    vehicle = make_vehicle(colon, configuration)
    session, eye = Session(vehicle, assisted=True), Eye(Camera(vehicle.around, 360))
    session.tick()

    def timed(act: Callable[[], Any], count: int) -> float:
        begun = time.perf_counter()
        for _ in range(count):
            act()
        return 1e3 * (time.perf_counter() - begun) / count

    step = timed(session.tick, steps)
    glance = glance_at(session.look.row, session.look.frame)
    eye.draw(glance)
    found = {"control_step_ms": step, "interval_ms": 1e3 * vehicle.interval}
    spent, pictures = time.process_time(), 20
    found["picture_ms"] = timed(lambda: jpeg(eye.draw(glance)), pictures)
    found["picture_processor_ms"] = 1e3 * (time.process_time() - spent) / pictures
    vehicle.close()
    return found


def measured(colon: Path, configuration: dict[str, Any], *, seconds: float, picture: Path | None) -> dict[str, Any]:
    """All of it."""
    found: dict[str, Any] = measure_steps(colon, configuration)
    found |= measure_haptic(colon, configuration, seconds=seconds)
    if chromium() is None:
        return found | {"page": "no Chromium is installed"}
    return found | measure_page(colon, configuration, seconds=seconds, size=360, picture=picture)
