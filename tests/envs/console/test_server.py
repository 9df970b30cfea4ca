"""The console as a page meets it: strangers are refused, a lost page stops the hand, real keys drive a real browser."""

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from haustra.envs.console.session import Session
from haustra.envs.console.vehicles import make_vehicle
from haustra.envs.console.wire import pack, unpack

aiohttp = pytest.importorskip("aiohttp")

ROOT = Path(__file__).parents[3]


def test_a_message_is_unpacked_as_it_was_packed():
    arrays = {"jpeg": np.arange(7, dtype=np.uint8), "places": np.arange(6.0).reshape(2, 3), "faces": np.arange(3)}
    header, found = unpack(pack({"kind": "scene", "name": "ä"}, arrays))
    assert header == {"kind": "scene", "name": "ä"}
    for name, values in arrays.items():
        np.testing.assert_array_equal(found[name], values)


def test_the_page_is_whole_and_loads_nothing():
    from haustra.envs.console.server import page

    text = page()
    assert "/*SCRIPT*/" not in text and "/*STYLE*/" not in text
    assert text.count("<script") == 1 and "src=" not in text.split("<script")[0] and "@import" not in text
    assert len(text) < 1_000_000


@asynccontextmanager
async def _served(vehicle: Any) -> AsyncIterator[tuple[Any, str]]:
    from haustra.envs.console.server import Server
    from haustra.envs.console.source import Drive

    source = Drive([Session(vehicle)], size=64)
    server, ends = Server(source), asyncio.Event()
    told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    running = asyncio.create_task(server.run(told.set_result, ends))
    try:
        yield source, await told
    finally:
        ends.set()
        await running
        source.close()


async def _until(holds: Callable[[], bool], meanwhile: Callable[[], Awaitable[None]] | None = None) -> None:
    for _ in range(1000):
        if holds():
            return
        if meanwhile:
            await meanwhile()
        await asyncio.sleep(0.01)
    raise TimeoutError


def test_strangers_are_refused_and_a_lost_page_stops_the_hand(colon_folder, capsule):
    asyncio.run(_meet(make_vehicle(colon_folder, capsule)))


async def _meet(vehicle: Any) -> None:
    async with _served(vehicle) as (source, url), aiohttp.ClientSession() as client:
        base, _, token = url.partition("?token=")
        socket = f"{base}socket?token={token}"
        for address, headers in (
            (base, {}),
            (f"{base}?token={token[:-1]}", {}),
            (f"{base}socket", {}),
            (url, {"Host": "elsewhere.example"}),
            (url, {"Origin": "http://elsewhere.example"}),
            (socket, {"Origin": "http://elsewhere.example"}),
        ):
            async with client.get(address, headers=headers) as answer:
                assert answer.status == 403, (address, headers)
        async with client.get(url) as answer:
            assert answer.status == 200 and "default-src 'none'" in answer.headers["Content-Security-Policy"]
        hand = source.sessions[0].hand
        async with client.ws_connect(socket, headers={"Origin": base[:-1]}) as page:
            scene, arrays = unpack((await page.receive()).data)
            assert scene["kind"] == "scene" and arrays["faces"].max() < len(arrays["rest"])
            pushes = {"pause": False, "hand": {"force_z": 1.0}, "t": 1.0}
            await _until(lambda: hand.share[2] == 1.0 and source.sessions[0].step > 2, lambda: page.send_json(pushes))
            await page.send_str("[" * 100)
            await page.send_json({"fly": 1, "swim": 2, "crawl": 3})
            said = set()
            while len(said) < 4:
                header, _ = unpack((await page.receive()).data)
                if header["kind"] == "refused":
                    said.add(header["say"])
            assert said == {"that is no message"} | {
                f"{name}: not known to a drive" for name in ("fly", "swim", "crawl")
            }
        await _until(lambda: source.paused and not hand.share.any())
        step = source.sessions[0].step
        async with client.ws_connect(socket) as page:
            while True:
                header, _ = unpack((await page.receive()).data)
                if header["kind"] == "frame":
                    break
            assert header["paused"] and source.sessions[0].step == step, "the page comes back to where it was"
            await _until(lambda: hand.share[2] == 1.0, lambda: page.send_json(pushes))
            await _until(lambda: not hand.share.any())  # nothing more was heard of the hand
            await page.send_str(json.dumps({"hand": {"force_z": 1.0}, "mark": "x" * 5000}))
            while (message := await page.receive()).type is aiohttp.WSMsgType.BINARY:
                pass
            assert message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
            assert message.data == 1009 and not hand.share.any()


def test_pictures_do_not_wait_for_views_from_outside(colon_folder, capsule, monkeypatch):
    """A page that is slow with one kind of message is still sent the other as soon as it has drawn it."""
    from haustra.envs.console import server

    monkeypatch.setattr(server, "PATIENCE", 1e6)
    asyncio.run(_draw_pictures_only(make_vehicle(colon_folder, capsule)))


async def _draw_pictures_only(vehicle: Any) -> None:
    async with _served(vehicle) as (_, url), aiohttp.ClientSession() as client:
        base, _, token = url.partition("?token=")
        async with client.ws_connect(f"{base}socket?token={token}") as page:
            kinds: list[str] = []
            while kinds.count("picture") < 8:
                header, _ = unpack((await page.receive()).data)
                kinds.append(header["kind"])
                if kinds[-1] == "picture":
                    await page.send_json({"drawn": "picture"})
        assert "frame" not in kinds[-4:], "it has not said that it has drawn the ones before"


@pytest.mark.parametrize("name", ["Chromium", "Firefox"])
def test_a_browser_without_webgl_shows_the_rest(name, colon_folder, capsule):
    """What the tip sees, the numbers and the hand are there; only the view from outside is not."""
    from haustra.scripts.bench.browser import Browser, chromium
    from haustra.scripts.bench.firefox import Firefox, firefox

    found, kind = {"Chromium": (chromium, partial(Browser, webgl=False)), "Firefox": (firefox, Firefox)}[name]
    if found() is None:
        pytest.skip(f"no {name} is installed")
    browser = kind()
    asyncio.run(_push_without_webgl(make_vehicle(colon_folder, capsule), browser))
    assert not browser.folder.exists(), "its profile is left behind"
    with pytest.raises(ProcessLookupError):
        os.kill(browser.process, 0)


async def _push_without_webgl(vehicle: Any, browser: Any) -> None:
    async with asyncio.timeout(90), _served(vehicle) as (source, url), browser:
        await browser.open(url)
        await browser.until("window.haustra && haustra.stats.frames > 1 && haustra.stats.pictures > 1")
        assert await browser.ask("haustra.views[0].outside.renderer === null")
        await browser.press("Space")
        await browser.until("!haustra.last.paused && haustra.stats.frames > 5")
        await browser.key("KeyW", down=True)
        await browser.until("Object.values(haustra.hand.shares()).includes(1)")
        await _until(lambda: source.sessions[0].hand.share.max() == 1)
        await browser.key("KeyW", down=False)
        await _until(lambda: not source.sessions[0].hand.share.any())
        assert not await browser.ask("haustra.stats.refused.length")
    assert [one for one in browser.errors if "WebGL" not in one] == []


def test_keys_in_a_browser_drive_past_the_sigmoid(colon_folder, tmp_path):
    """`haustra drive` prints one line; real key events of a headless Chromium bring the tip through the bend."""
    from haustra.scripts.bench.browser import chromium

    if chromium() is None:
        pytest.skip("no Chromium is installed")
    call = [
        sys.executable,
        "-m",
        "haustra.scripts.main",
        "drive",
        "--colon",
        str(colon_folder),
        "--no-browser",
        "--json",
    ]
    call += ["--device", "paediatric", "--preset", "fast", "--picture", "96", "-o", str(tmp_path / "drive")]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    running = subprocess.Popen(call, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment)
    try:
        assert running.stdout is not None
        url = json.loads(running.stdout.readline())["url"]
        row = asyncio.run(_press(url, tmp_path))
    finally:
        running.send_signal(signal.SIGINT)
        rest, _ = running.communicate(timeout=30)
    assert running.returncode == 0 and not rest, "one line is printed"
    assert row["tip_arc"] > 0.15
    from haustra.envs.console.recording import load_recording

    rows = load_recording(tmp_path / "drive").rows
    assert rows["tip_arc"].max() > 0.15 and rows["by_person"].any()


async def _press(url: str, folder: Path) -> dict[str, float]:
    from haustra.scripts.bench.browser import Browser

    async with Browser() as browser:
        await browser.open(url)
        await browser.until("window.haustra && haustra.stats.frames > 1 && haustra.stats.pictures > 1")
        await browser.press("Space")
        await browser.key("KeyW", down=True)
        await browser.key("ArrowLeft", down=True)
        await browser.until("haustra.last.row.tip_arc > 0.07")
        assert await browser.ask("haustra.last.row.bend === undefined && haustra.last.knobs[3] > 0.05")
        await browser.key("ArrowLeft", down=False)
        await browser.press("KeyT")  # the driver steers, the person pushes
        await browser.until("haustra.last.row.tip_arc > 0.16 && haustra.last.assisted")
        await browser.key("KeyW", down=False)
        await browser.key("KeyG", down=True)
        await browser.until("haustra.last.row.water_volume > 1e-6")
        await browser.key("KeyG", down=False)
        button = "document.querySelector('button[data-name=\"water G\"]')"
        poured = await browser.ask("haustra.last.row.water_volume")
        await browser.ask(f"void {button}.dispatchEvent(new PointerEvent('pointerdown', {{pointerId: 1}}))")
        await browser.until(f"haustra.last.row.water_volume > {poured} + 2e-6")
        await browser.ask(f"void {button}.dispatchEvent(new PointerEvent('pointerup', {{pointerId: 1}}))")
        await browser.until("haustra.hand.shares().water === undefined")
        row = await browser.ask("haustra.last.row")
        # A gamepad as the browser would show one: its left stick forward pushes, and its first button unlocks knobs.
        pad = "{connected: true, axes: [0, -1, 0, 0], buttons: [{value: 1, pressed: true}]}"
        await browser.ask(f"void (navigator.getGamepads = () => [{pad}])")
        await browser.until("haustra.hand.shares().push === 1 && haustra.last.correcting")
        await browser.until("!haustra.last.locked[2] && !haustra.last.locked[3]")
        await browser.ask("void (navigator.getGamepads = () => [])")
        await browser.until("haustra.hand.shares().push === undefined")
        assert await browser.ask("haustra.views[0].outside.drawn > 3 && haustra.stats.latencies.length > 0")
        await browser.picture(folder / "page.png")
        assert not browser.errors and not await browser.ask("haustra.stats.refused.length")
    return row
