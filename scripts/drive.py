"""`haustra drive`: drive a device yourself, in the browser."""

import contextlib
import json
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.errors import InvalidOptionError
from haustra.fields import whole
from haustra.scripts.drivable import Drivable, require_extra


@dataclass(frozen=True, kw_only=True)
class Drive(Drivable):
    """Drive a device through a colon yourself, in the browser: keys, sticks on the screen, a gamepad.

    The page is served on this machine only, to whoever has the token in the address. Ctrl-C ends the drive.
    """

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for a recording of the drive; nothing is recorded when not given."""
    driver: str = "follower"
    """Name of who helps: follower (of other devices than scopes, their own driver), endoscopist, or a policy's name or
    folder."""
    assist: bool = False
    """Let the driver drive from the start while you correct; the key T does so at any time."""
    beside: str | None = None
    """Name of a second device that the same hand drives beside the first, in the same colon."""
    picture: int = whole(64, 720, default=360)
    """Rows and columns of the endoscope's picture [pixels]."""
    host: str = "127.0.0.1"
    """Address to listen on; other machines can reach it when it is not 127.0.0.1."""
    port: int = whole(0, 65535, default=0)
    """Number of the port to listen on; any free one when 0."""
    haptic: int | None = whole(0, 65535, default=None)
    """Number of the port for a haptic device on this machine (docs/how-to/haptic.md); none when not given."""
    spacemouse: bool = False
    """Let a SpaceMouse on this desk move the hand, beside the page; needs the extra 'spacemouse'."""
    browser: bool = True
    """Open the browser."""
    json: bool = field(default=False)
    """Print one line, {"url"}, once the page is ready."""

    def __call__(self) -> dict[str, Any] | None:
        """Serve until interrupted."""
        require_extra("drive", ("aiohttp",))
        from haustra.envs.console.recording import Recorder
        from haustra.envs.console.session import Session
        from haustra.envs.console.source import Drive as Source
        from haustra.envs.console.vehicles import make_vehicle

        device = self._device()
        vehicle = make_vehicle(self.colon, self.configuration(self.driver))
        recorder = None
        if self.output is not None:
            recorder = Recorder(self.output, vehicle, driver="hand", seed=self.seed)
        sessions = [Session(vehicle, recorder, assisted=self.assist)]
        if self.beside is not None:
            other = make_vehicle(self.colon, replace(self, device=self.beside).configuration(self.driver))
            sessions.append(Session(other, assisted=self.assist))
        source = Source(sessions, size=self.picture)
        return serve(source, self, haptic=self.haptic, device=device)

    def _device(self) -> Any:
        """The SpaceMouse that is asked for; None where none is."""
        if not self.spacemouse:
            return None
        if self.haptic is not None:
            raise InvalidOptionError("A drive has one hand: give --haptic or --spacemouse, not both.")
        from haustra.envs.console.spacemouse import find_space_mouse

        return find_space_mouse()


def serve(source: Any, asked: Any, *, haptic: int | None = None, device: Any = None) -> dict[str, Any] | None:
    """Serve a source until interrupted; `asked` says host, port, browser and json, `device` is a SpaceMouse.

    Returns:
        What came of it; None when all that was to be printed was.
    """
    import asyncio
    import signal

    from haustra.envs.console.server import Server

    server = Server(source, host=asked.host, port=asked.port)

    def ready(url: str) -> None:
        if asked.json:
            print(json.dumps({"url": url}), flush=True)
        else:
            print(f"Open {url}\nCtrl-C ends.", flush=True)
        if asked.browser:
            import webbrowser

            webbrowser.open(url)

    async def run() -> None:
        ends = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, ends.set)
        await server.run(ready, ends)

    with contextlib.ExitStack() as held:
        if haptic is not None:
            from haustra.envs.console.haptic import HapticPort

            port = held.enter_context(HapticPort(source, port=haptic)).port
            print(f"A haptic device may connect to 127.0.0.1:{port}.", file=sys.stderr)
        if device is not None:
            from haustra.envs.console.spacemouse import SpaceMouse

            held.enter_context(SpaceMouse(source, device))
        asyncio.run(run())
    found = source.close()
    return None if asked.json else found
