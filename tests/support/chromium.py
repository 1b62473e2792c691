"""A page in headless Chromium, led by its DevTools protocol."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import shutil
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp

from tests.support.processes import Process, free_port

PATIENCE = 60.0  # s


class Page:
    """A page in headless Chromium, by its DevTools protocol."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._number = 0

    async def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """One command; its result."""
        self._number += 1
        await self._socket.send_json({"id": self._number, "method": method, "params": params})
        async for message in self._socket:
            answer = json.loads(message.data)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result
        raise AssertionError("Chromium has gone")

    async def evaluate(self, script: str) -> Any:
        """What a script gives."""
        result = await self.ask("Runtime.evaluate", expression=script, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    async def until(self, script: str) -> None:
        """Wait until a script gives something true; a page that is being loaded has none to run it in."""
        deadline = time.monotonic() + PATIENCE
        while True:
            with contextlib.suppress(AssertionError):
                if await self.evaluate(script):
                    return
            assert time.monotonic() < deadline, script
            await asyncio.sleep(0.1)

    async def picture(self) -> bytes:
        """A screenshot, PNG."""
        result = await self.ask("Page.captureScreenshot", format="png")
        return base64.b64decode(result["data"])


@contextlib.asynccontextmanager
async def chromium(directory: Path) -> AsyncIterator[Page]:
    """An empty page of a browser."""
    program = shutil.which("chromium")
    assert program is not None, "apt-get install chromium"
    port = free_port()
    command = [program, "--headless", "--no-sandbox", "--disable-gpu", "--window-size=1400,900"]
    command += [f"--remote-debugging-port={port}", f"--user-data-dir={directory / 'profile'}", "about:blank"]
    process = Process(command, directory / "chromium.log", directory)
    try:
        process.says("DevTools listening")
        async with aiohttp.ClientSession() as session:
            pages: list[dict[str, Any]] = []
            while not pages:
                async with session.get(f"http://127.0.0.1:{port}/json") as answer:
                    pages = [one for one in await answer.json(content_type=None) if one["type"] == "page"]
            async with session.ws_connect(pages[0]["webSocketDebuggerUrl"], max_msg_size=1 << 26) as socket:
                yield Page(socket)
    finally:
        process.stop()
