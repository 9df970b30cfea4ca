"""A headless Firefox that is driven by real key events over WebDriver BiDi, without further packages."""

import base64
import json
import shutil
from pathlib import Path
from typing import Any

from haustra.scripts.bench.browser import Browser, typed

_NAMES = ("firefox-esr", "firefox")
_OPTIONS = ("--headless", "--no-remote", "--remote-debugging-port=0")
_PREFERENCES = {
    "app.normandy.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "webgl.disabled": True,
}
"""A new profile asks nothing and calls nobody; a Firefox without a display has no WebGL in any case."""
_KEYS = {
    "ArrowUp": "\ue013",
    "ArrowDown": "\ue015",
    "ArrowLeft": "\ue012",
    "ArrowRight": "\ue014",
    "Backspace": "\ue003",
}
"""Letters that WebDriver has for keys which write none."""


def firefox() -> str | None:
    """Path of an installed Firefox; None where there is none."""
    return next((path for name in _NAMES if (path := shutil.which(name))), None)


class Firefox(Browser):
    """One page of a headless Firefox, which has no WebGL."""

    def __init__(self, *, width: int = 1280, height: int = 760) -> None:
        """Prepare one with a window of that size [pixels]."""
        super().__init__(width=width, height=height, webgl=False)
        self._context = ""

    async def _start(self) -> None:
        path = firefox()
        assert path is not None, "no Firefox is installed"
        lines = [f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in _PREFERENCES.items()]
        (self.folder / "user.js").write_text("".join(lines), encoding="utf-8")
        await self._run(path, *_OPTIONS, "--profile", str(self.folder), "about:blank")
        server = json.loads(await self._told("WebDriverBiDiServer.json"))
        await self._connect(f"ws://{server['ws_host']}:{server['ws_port']}/session")
        await self.call("session.new", capabilities={})
        await self.call("session.subscribe", events=["log.entryAdded"])
        self._context = (await self.call("browsingContext.getTree"))["contexts"][0]["context"]
        size = dict(zip(("width", "height"), self._size, strict=True))
        await self.call("browsingContext.setViewport", context=self._context, viewport=size)

    def _hear(self, said: dict[str, Any]) -> None:
        if said.get("method") == "log.entryAdded" and said["params"]["level"] == "error":
            self.errors.append(said["params"]["text"])

    async def open(self, url: str) -> None:
        """Open an address."""
        await self.call("browsingContext.navigate", context=self._context, url=url, wait="complete")

    async def ask(self, expression: str) -> Any:
        """Value of an expression in the page, if JSON has such."""
        found = await self.call(
            "script.evaluate",
            expression=f"(async () => JSON.stringify(await ({expression})))()",
            target={"context": self._context},
            awaitPromise=True,
        )
        assert found["type"] == "success", found["exceptionDetails"]
        value = found["result"].get("value")
        return None if value is None else json.loads(value)

    async def key(self, code: str, *, down: bool) -> None:
        """Press or let go a key, by its place on the keyboard, such as 'KeyW'."""
        doing = {"type": "keyDown" if down else "keyUp", "value": _KEYS.get(code, typed(code))}
        actions = [{"type": "key", "id": "keyboard", "actions": [doing]}]
        await self.call("input.performActions", context=self._context, actions=actions)

    async def picture(self, path: Path) -> Path:
        """A picture of the page."""
        found = await self.call("browsingContext.captureScreenshot", context=self._context)
        path.write_bytes(base64.b64decode(found["data"]))
        return path
