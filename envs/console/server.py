"""The console's server: one page, one socket, for whoever knows the token.

It listens on this machine only unless asked otherwise. Every address needs the token; a page of another origin is
refused, so is whoever calls this machine by a name that is not its own; what a page says is short, and longer messages
end the connection. Bytes of the page come from the package: nothing is loaded from elsewhere.
"""

import asyncio
import contextlib
import hmac
import json
import secrets
import time
from collections.abc import Callable
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

from haustra.envs.console.source import Drive, Source
from haustra.envs.console.wire import pack
from haustra.errors import MissingDependencyError, OutputError

try:
    from aiohttp import WSCloseCode, WSMsgType, web
except ImportError as error:  # pragma: no cover - what is missing is named
    raise MissingDependencyError("The console needs aiohttp: 'pip install haustra[drive]'.") from error

LONGEST = 4096
"""Most that a page says at once [bytes]."""
PATIENCE = 0.5
"""A page that has not said for so long that it has drawn what it was sent is sent more [s]; engineering choice."""
MOST_REFUSALS = 64
"""Refusals that wait for a page that does not read, then the oldest give way; engineering choice."""
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src blob: data:; connect-src 'self'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
_LOCAL = ("127.0.0.1", "localhost", "::1")


def page() -> str:
    """The page as one file, scripts and styles inside it."""
    folder = files("haustra.envs.console.page")
    style, script = (folder.joinpath(name).read_text(encoding="utf-8") for name in ("console.css", "console.js"))
    frame = folder.joinpath("console.html").read_text(encoding="utf-8")
    script = script.replace("</script", "<\\/script")
    return frame.replace("/*STYLE*/", style).replace("/*SCRIPT*/", script)


class _Client:
    """One page; of what it has not been sent yet, the newest of each kind waits.

    A page that says what it has drawn is sent more of a kind only then: otherwise seconds of pictures would queue in
    the buffers between a quick server and a slow browser, and hands would see the past. Pictures do not wait for views
    from outside, which take a browser longer.
    """

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self.socket = socket
        self._waiting: dict[str, bytes] = {}
        self._woken, self._says, self._refusals = asyncio.Event(), False, 0
        self._owed: dict[str, tuple[int, float]] = {}

    def tell(self, what: str, message: bytes) -> None:
        self._waiting[what] = message
        self._woken.set()

    def refuse(self, message: bytes) -> None:
        """Tell what cannot be done; refusals do not replace each other, so that none is lost before it is sent."""
        self.tell(f"refused {self._refusals % MOST_REFUSALS}", message)
        self._refusals += 1

    async def send(self) -> None:
        """Send until the connection ends."""
        while not self.socket.closed:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._woken.wait(), PATIENCE)
            self._woken.clear()
            for what in [what for what in self._waiting if self._awaits(what.split()[0])]:
                kind, message = what.split()[0], self._waiting.pop(what)
                self._owed[kind] = self._owed.get(kind, (0, 0.0))[0] + 1, time.monotonic()
                await self.socket.send_bytes(message)

    def drew(self, kind: str) -> None:
        """Hear that the page has drawn one more of that kind."""
        self._says = True
        if kind in self._owed:
            owed, since = self._owed[kind]
            self._owed[kind] = max(owed - 1, 0), since
            self._woken.set()

    def _awaits(self, kind: str) -> bool:
        """Whether the page has drawn all that it was sent of a kind, or will not say so."""
        owed, since = self._owed.get(kind, (0, 0.0))
        if self._says and owed and time.monotonic() < since + PATIENCE:
            return False
        self._owed[kind] = 0, since
        return True


class Server:
    """Serves one source."""

    def __init__(self, source: Source, *, host: str = "127.0.0.1", port: int = 0) -> None:
        """Prepare to serve on a port of this machine, any free one when 0."""
        self.source, self.host, self._port = source, host, port
        self.token = secrets.token_urlsafe(24)
        self._clients: list[_Client] = []
        self._page = page()
        self.url = ""
        """Address with the token, once it listens."""

    async def run(self, ready: Callable[[str], None], ends: asyncio.Event) -> None:
        """Serve until `ends` is set; `ready` is told the address once pictures can be drawn.

        Raises:
            OutputError: when the port is taken.
        """
        application = web.Application(middlewares=[self._guard], client_max_size=LONGEST)
        application.add_routes([web.get("/", self._show), web.get("/socket", self._talk)])
        runner = web.AppRunner(application, access_log=None)
        await runner.setup()
        try:
            site = web.TCPSite(runner, self.host, self._port)
            try:
                await site.start()
            except OSError as error:
                raise OutputError(f"Cannot listen on {self.host}:{self._port}: {error.strerror or error}.") from error
            port = runner.addresses[0][1]
            shown = f"[{self.host}]" if ":" in self.host else self.host
            self.url = f"http://{shown}:{port}/?token={self.token}"
            loop = asyncio.get_running_loop()

            def publish(what: str, message: bytes) -> None:
                with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                    loop.call_soon_threadsafe(self._spread, what, message)

            self.source.start(publish)
            while not self.source.ready and not ends.is_set() and self.source.failed is None:
                await asyncio.sleep(0.02)
            if self.source.failed is not None:
                raise self.source.failed
            ready(self.url)
            await ends.wait()
        finally:
            self.source.mute()
            for client in list(self._clients):
                await client.socket.close(code=WSCloseCode.GOING_AWAY)
            await runner.cleanup()

    def _spread(self, what: str, message: bytes) -> None:
        for client in self._clients:
            client.tell(what, message)

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse whoever has no token, comes from elsewhere, or calls this machine by another name."""
        given = request.query.get("token", "")
        origin = request.headers.get("Origin")
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            raise web.HTTPForbidden(text="403: the address lacks its token.\n")
        if origin is not None and urlsplit(origin).netloc != request.host:
            raise web.HTTPForbidden(text="403: a page of another origin.\n")
        if self.host in _LOCAL and urlsplit(f"//{request.host}").hostname not in _LOCAL:
            raise web.HTTPForbidden(text="403: this machine is called by another name.\n")
        return await handler(request)

    async def _show(self, request: web.Request) -> web.Response:
        return web.Response(text=self._page, content_type="text/html", headers=_HEADERS)

    async def _talk(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=15.0, compress=False)
        await socket.prepare(request)
        client = _Client(socket)
        for number, scene in enumerate(self.source.scenes()):
            client.tell(f"scene {number}", scene)
        self._clients.append(client)
        sending = asyncio.create_task(client.send())
        try:
            async for message in socket:
                if message.type is not WSMsgType.TEXT:
                    break
                self._hear(client, message.data)
        finally:
            self._clients.remove(client)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sending
            # Nobody is there any more: the hand lets go, and the drive waits for the page to come back.
            if not self._clients and isinstance(self.source, Drive):
                self.source.let_go()
        return socket

    def _hear(self, client: _Client, text: str) -> None:
        loop = asyncio.get_running_loop()

        def answer(said: str) -> None:
            message = pack({"kind": "refused", "say": said[:300]})
            loop.call_soon_threadsafe(client.refuse, message)

        try:
            said = json.loads(text)
        except (ValueError, RecursionError):
            said = None
        if not isinstance(said, dict):
            answer("that is no message")
            return
        if "drawn" in said:
            client.drew(str(said["drawn"]))
            return
        if client is self._clients[-1]:  # the page that came last has the hand
            self.source.command(said, answer)
        elif said.get("hand"):
            answer("another page has the hand")
