"""A drive that is served, and shown on a page of a headless browser."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from haustra.envs.console.server import Server
from haustra.envs.console.source import Drive
from haustra.scripts.bench.browser import Browser


@asynccontextmanager
async def shown(source: Drive) -> AsyncIterator[Browser]:
    """Serve a drive until the page that shows it is left; the page must not have complained by then."""
    server, ends = Server(source), asyncio.Event()
    told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    running = asyncio.create_task(server.run(told.set_result, ends))
    try:
        async with Browser() as browser:
            await browser.open(await told)
            await browser.until("window.haustra && haustra.stats.pictures > 1 && haustra.stats.frames > 1")
            yield browser
            assert not browser.errors, browser.errors
    finally:
        ends.set()
        await running
        source.close()
