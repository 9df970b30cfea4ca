"""How fast hands are served: a control step and a picture alone, the page in a headless browser, the haptic port."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from haustra.envs.console.session import Session
from haustra.envs.console.vehicles import make_vehicle
from haustra.scripts.bench.browser import chromium
from haustra.scripts.bench.hands_haptic import measure_haptic
from haustra.scripts.bench.hands_keys import measure_keys
from haustra.scripts.bench.hands_page import measure_page

Part = Literal["steps", "haptic", "page", "keys"]
"""What is measured."""
_LONGEST_WAY_IN = 300.0
"""Longest time in which keys alone are to bring the scope past the sigmoid [s]."""


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


def measured(
    colon: Path, configuration: dict[str, Any], *, seconds: float, folder: Path | None, only: Part | None = None
) -> dict[str, Any]:
    """All of it, or one part; pictures of the page go into the folder."""
    found: dict[str, Any] = {}
    if only in (None, "steps"):
        found |= measure_steps(colon, configuration)
    if only in (None, "haptic"):
        found |= measure_haptic(colon, configuration, seconds=seconds)
    if only in (None, "page", "keys") and chromium() is None:
        return found | {"page": "no Chromium is installed"}
    if only in (None, "page"):
        place = None if folder is None else folder / "page.png"
        found |= measure_page(colon, configuration, seconds=seconds, size=360, picture=place)
    if only in (None, "keys"):
        found |= measure_keys(colon, configuration, seconds=_LONGEST_WAY_IN, folder=folder)
    return found
