"""A headless Chromium that is driven by real key events, over its own debugging socket, without further packages."""

import asyncio
import base64
import contextlib
import json
import os
import shutil
import signal
import tempfile
from pathlib import Path
from typing import Any, Self

import aiohttp

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--disable-background-networking",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
)
_LONGEST_START = 30.0
"""To begin with [s]."""
_CODES = {"ArrowUp": 38, "ArrowDown": 40, "ArrowLeft": 37, "ArrowRight": 39, "Space": 32, "Backspace": 8}


def chromium() -> str | None:
    """Path of an installed Chromium; None where there is none."""
    return next((path for name in _NAMES if (path := shutil.which(name))), None)


def typed(code: str) -> str:
    """What a key writes, by its place on the keyboard; its own name where it writes nothing."""
    return code.removeprefix("Key").lower() if code.startswith("Key") else {"Space": " "}.get(code, code)


class Browser:
    """One page of a headless browser."""

    def __init__(self, *, width: int = 1280, height: int = 760, webgl: bool = True) -> None:
        """Prepare one with a window of that size [pixels], which may do without WebGL."""
        self._size = width, height
        self._options = _OPTIONS if webgl else (*_OPTIONS, "--disable-3d-apis")
        self._folder = tempfile.TemporaryDirectory(prefix="haustra-browser-", ignore_cleanup_errors=True)
        self._next = 0
        self._process: asyncio.subprocess.Process | None = None
        self._session: aiohttp.ClientSession | None = None
        self.folder = Path(self._folder.name)
        """Where its profile is, until it ends."""
        self.process = 0
        """Number of the browser's process, once it has started."""
        self.errors: list[str] = []
        """What the page complained about."""

    async def __aenter__(self) -> Self:
        """Start it; what was started is ended if it does not begin in time."""
        try:
            async with asyncio.timeout(_LONGEST_START):
                await self._start()
        except BaseException:
            await self._end()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        """End it."""
        await self._end()

    async def _start(self) -> None:
        path = chromium()
        assert path is not None, "no Chromium is installed"
        size = f"--window-size={self._size[0]},{self._size[1]}"
        await self._run(path, *self._options, size, f"--user-data-dir={self.folder}", "about:blank")
        port = int((await self._told("DevToolsActivePort")).split()[0])
        async with aiohttp.ClientSession() as session, session.get(f"http://127.0.0.1:{port}/json/list") as answer:
            pages = [one for one in await answer.json() if one["type"] == "page"]
        await self._connect(pages[0]["webSocketDebuggerUrl"])
        await self.call("Page.enable")
        await self.call("Runtime.enable")
        await self.call("Log.enable")

    async def _run(self, *words: str) -> None:
        """Start the program, with all that it starts in a group of their own."""
        nowhere = asyncio.subprocess.DEVNULL
        self._process = await asyncio.create_subprocess_exec(
            *words, stdout=nowhere, stderr=nowhere, start_new_session=True
        )
        self.process = self._process.pid

    async def _told(self, name: str) -> str:
        """What the program writes into a file of its profile once it listens, when it is written."""
        told, before = self.folder / name, ""
        while not (text := told.read_text(encoding="utf-8") if told.is_file() else "") or text != before:
            assert self._process is not None and self._process.returncode is None, "the browser has ended"
            before = text
            await asyncio.sleep(0.05)
        return text

    async def _connect(self, address: str) -> None:
        self._session = aiohttp.ClientSession()
        self._socket = await self._session.ws_connect(address, max_msg_size=0)

    async def _end(self) -> None:
        """End the connection, the program and all that it started, and remove its profile."""
        try:
            if self._session is not None:
                await self._session.close()
        finally:
            if self._process is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self._process.pid, signal.SIGKILL)
                await self._process.wait()
            self._folder.cleanup()

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One call of the debugging protocol."""
        self._next += 1
        await self._socket.send_json({"id": self._next, "method": method, "params": parameters})
        while True:
            message = await self._socket.receive()
            assert message.type is aiohttp.WSMsgType.TEXT, "the browser has ended"
            said = json.loads(message.data)
            if said.get("id") == self._next:
                assert "error" not in said, said
                return said["result"]
            self._hear(said)

    def _hear(self, said: dict[str, Any]) -> None:
        """Note what the page complains about."""
        if said.get("method") == "Runtime.exceptionThrown":
            self.errors.append(str(said["params"]["exceptionDetails"].get("exception", {}).get("description")))
        if said.get("method") == "Log.entryAdded" and said["params"]["entry"]["level"] == "error":
            self.errors.append(said["params"]["entry"]["text"])

    async def open(self, url: str) -> None:
        """Open an address."""
        await self.call("Page.navigate", url=url)

    async def ask(self, expression: str) -> Any:
        """Value of an expression in the page."""
        found = await self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    async def until(self, expression: str, *, seconds: float = 20.0) -> Any:
        """Wait until an expression holds in the page, and say what it is."""
        for _ in range(round(seconds / 0.05)):
            if found := await self.ask(expression):
                return found
            await asyncio.sleep(0.05)
        raise TimeoutError(f"{expression} does not hold in the page; {self.errors}")

    async def key(self, code: str, *, down: bool) -> None:
        """Press or let go a key, by its place on the keyboard, such as 'KeyW'."""
        key = typed(code)
        number = ord(key.upper()) if len(key) == 1 else _CODES[code]
        kind = "keyDown" if down else "keyUp"
        await self.call("Input.dispatchKeyEvent", type=kind, code=code, key=key, windowsVirtualKeyCode=number)

    async def press(self, code: str) -> None:
        """Press a key and let it go."""
        await self.key(code, down=True)
        await self.key(code, down=False)

    async def picture(self, path: Path) -> Path:
        """A picture of the page."""
        found = await self.call("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(found["data"]))
        return path
