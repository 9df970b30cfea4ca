"""Two beside each other: recordings on one slider, vehicles under one hand, as the verbs serve them to a page."""

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from haustra.envs.console.recording import load_recording
from haustra.envs.console.wire import unpack
from haustra.models.devices.scope.library import named_design
from haustra.scripts.main import SUCCESS, main

aiohttp = pytest.importorskip("aiohttp")

ROOT = Path(__file__).parents[3]
LONGEST = 30.0
"""What a conversation with the server may take on a busy machine [s]."""

_Shown = dict[tuple[str, int], tuple[dict[str, Any], dict[str, np.ndarray]]]


@contextmanager
def _served(*call: str) -> Iterator[str]:
    """Address of what a verb serves; it ends by Ctrl-C, without a word more."""
    words = [sys.executable, "-m", "haustra.scripts.main", *call, "--no-browser", "--json", "--picture", "64"]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    running = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment)
    try:
        assert running.stdout is not None
        yield json.loads(running.stdout.readline())["url"]
    finally:
        running.send_signal(signal.SIGINT)
        rest, _ = running.communicate(timeout=30)
    assert running.returncode == 0 and not rest


class _Page:
    """What a page was sent last, by kind and view."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self.shown: _Shown = {}

    async def until(self, holds: Callable[[], bool], **said: Any) -> None:
        """Say something until what is shown holds."""
        while not holds():
            await self._socket.send_json(said)
            header, arrays = unpack((await self._socket.receive()).data)
            assert header["kind"] != "refused", header
            self.shown[header["kind"], header.get("view", 0)] = header, arrays

    def rows(self) -> list[dict[str, Any]]:
        """What both views tell."""
        return [self.shown["frame", view][0]["row"] for view in (0, 1)]


def _meet(url: str, page: Callable[[_Page], Awaitable[None]]) -> None:
    async def talk() -> None:
        base, _, token = url.partition("?token=")
        address = f"{base}socket?token={token}"
        async with asyncio.timeout(LONGEST), aiohttp.ClientSession() as client, client.ws_connect(address) as socket:
            await page(_Page(socket))

    asyncio.run(talk())


def _whole(page: _Page) -> bool:
    """Whether both views have shown all that there is."""
    return len(page.shown) >= 6 and {("scene", 0), ("scene", 1), ("picture", 0), ("picture", 1)} <= page.shown.keys()


def _there(page: _Page, ends: tuple[float, float]) -> bool:
    """Whether both views are at these times, to the time between two control steps."""
    times = [row["time"] for row in page.rows()]
    return times == pytest.approx(list(ends), abs=1e-3)


def test_two_recordings_are_played_beside_each_other_on_one_slider(colon_folder, tmp_path):
    """Both show the same time; the shorter one stays where it ended."""
    (keys := tmp_path / "keys.json").write_text(json.dumps([{"at": 0, "hand": {"magnet_x": 1.0}}]))
    for name, driver, seconds in (("long", "follower", "0.6"), ("short", str(keys), "0.3")):
        call = ["record", "--colon", str(colon_folder), "--device", "capsule", "--seconds", seconds]
        assert main([*call, "--driver", driver, "-o", str(tmp_path / name), "--json"]) == SUCCESS
    rows = [load_recording(tmp_path / name).rows for name in ("long", "short")]
    assert abs(rows[0]["tip_arc"][10] - rows[1]["tip_arc"][10]) > 1e-4, "they tell the same"

    async def look(page: _Page) -> None:
        await page.until(lambda: _whole(page))
        for view, one in enumerate(rows):
            scene, arrays = page.shown["scene", view]
            assert (scene["views"], scene["mode"], scene["duration"]) == (2, "replay", pytest.approx(0.6))
            assert len(arrays["rest"]) > 100
            assert page.rows()[view]["tip_arc"] == pytest.approx(one["tip_arc"][0], abs=1e-5)
        for at, ends in ((0.21, (0.2, 0.2)), (9.0, (0.6, 0.3)), (0.11, (0.1, 0.1))):
            await page.until(partial(_there, page, ends), pause=True, seek=at)
            for one, shown, end in zip(rows, page.rows(), ends, strict=True):
                there = one["tip_arc"][np.abs(one["time"] - end).argmin()]
                assert shown["tip_arc"] == pytest.approx(there, abs=1e-5)
        await page.until(partial(_there, page, (0.6, 0.3)), pause=False)
        await page.until(lambda: page.shown["frame", 0][0]["paused"])  # played, it waits at the end

    with _served("replay", str(tmp_path / "long"), str(tmp_path / "short")) as url:
        _meet(url, look)


def test_two_vehicles_are_driven_beside_each_other_by_one_hand(colon_folder, tmp_path):
    """Both follow at once, step by step, each in a colon of its own; the first is the one that is recorded."""

    async def drive(page: _Page) -> None:
        await page.until(lambda: _whole(page))
        for view, name in enumerate(("paediatric", "adult")):
            scene, _ = page.shown["scene", view]
            assert (scene["views"], scene["mode"]) == (2, "drive")
            assert scene["radius"] == pytest.approx(named_design(name).diameter / 2)
        begun = page.rows()

        def apart() -> bool:
            """Whether both have gone on, and come to walls: before one, both go just where the hand goes."""
            one, other = page.rows()
            together = one["time"] == pytest.approx(other["time"])
            on = [now["insertion"] > was["insertion"] + 0.01 for now, was in zip((one, other), begun, strict=True)]
            return together and all(on) and abs(one["insertion"] - other["insertion"]) > 1e-4  # to last the pause

        await page.until(apart, pause=False, hand={"push": 1.0, "left": 0.5})
        assert page.shown["frame", 0][0]["knobs"] == page.shown["frame", 1][0]["knobs"] != [0.0] * 5
        await page.until(
            lambda: page.shown["frame", 0][0]["paused"] and page.shown["frame", 1][0]["paused"], pause=True
        )
        one, other = page.rows()
        assert one["time"] == pytest.approx(other["time"]) and one["time"] > 0.1
        assert one["insertion"] != other["insertion"], "they are two vehicles"

    call = "drive", "--colon", str(colon_folder), "--device", "paediatric", "--beside", "adult", "--preset", "fast"
    with _served(*call, "-o", str(tmp_path / "drive")) as url:
        _meet(url, drive)
    recording = load_recording(tmp_path / "drive")
    assert recording.rows["by_person"].any()
    assert recording.about["vehicle"]["design"]["diameter"] == named_design("paediatric").diameter
