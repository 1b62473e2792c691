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

from tests.support.ports import free_port
from tests.support.processes import Process

TIMEOUT = 60.0  # s
PROGRAMS = ("chromium-headless-shell", "chromium")  # the first takes a third of the processor time to start
# Chromium asks its makers' hosts for updates, hundreds of times where there is no internet; no test needs them.
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--disable-quic"]
FLAGS += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]


def command(profile: Path, *more: str) -> list[str]:
    """What starts headless Chromium with a profile in that folder, and more flags or an address."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    assert program is not None, f"apt-get install one of {', '.join(PROGRAMS)}"
    return [program, *FLAGS, f"--user-data-dir={profile}", *more]


class Page:
    """A page in headless Chromium, by its DevTools protocol."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._number = 0
        self.complaints: list[str] = []  # errors of scripts, and what the page's policy refused
        self.failed_requests: list[str] = []
        self.requests: list[str] = []  # the addresses that were asked

    async def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """One command; its result."""
        self._number += 1
        await self._socket.send_json({"id": self._number, "method": method, "params": params})
        async for message in self._socket:
            answer = json.loads(message.data)
            self._note(answer)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result
        raise AssertionError("Chromium has gone")

    def _note(self, event: dict[str, Any]) -> None:
        if event.get("method") == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(event["params"]["exceptionDetails"]))
        elif event.get("method") == "Network.requestWillBeSent":
            self.requests.append(event["params"]["request"]["url"])
        elif event.get("method") == "Log.entryAdded":
            entry = event["params"]["entry"]
            if entry["source"] == "network":
                self.failed_requests.append(f"{entry.get('url')}: {entry['text']}")
            else:
                self.complaints.append(entry["text"])

    async def visit(self, url: str, width: int = 1440, height: int = 900) -> None:
        """Open an address, in a window of that size, and begin to note complaints."""
        for domain in ("Page", "Log", "Network", "Runtime"):
            await self.ask(f"{domain}.enable")
        await self.resize(width, height)
        await self.evaluate("window.isBefore = true")
        await self.ask("Page.navigate", url=url)
        await self.until("!window.isBefore")  # until then the page before would take what is typed

    async def resize(self, width: int, height: int) -> None:
        """Make the window as large as that, in CSS pixels."""
        await self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    async def middle(self, element: str) -> tuple[float, float]:
        """Where the middle of an element is, which the script `element` gives; it is scrolled to.

        What a page learns later makes it, and moves it: it must stand still, else the click would meet another one.
        """
        await self.until(f"Boolean({element})")
        script = (
            f"{{const e = {element}; e.scrollIntoView({{block: 'nearest'}}); const r = e.getBoundingClientRect(); "
            "JSON.stringify([r.x + r.width / 2, r.y + r.height / 2])}"
        )
        deadline, before, place = time.monotonic() + TIMEOUT, None, await self.evaluate(script)
        while place != before:
            assert time.monotonic() < deadline, f"{element} does not stand still"
            await asyncio.sleep(0.1)
            before, place = place, await self.evaluate(script)
        x, y = json.loads(place)
        return x, y

    async def press(self, x: float, y: float) -> None:
        """Press the mouse's button there, and keep it down."""
        await self.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        await self.ask("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)

    async def release(self, x: float, y: float) -> None:
        """Let the mouse's button go."""
        await self.ask("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)

    async def touch(self, x: float, y: float) -> None:
        """Put a finger there."""
        await self.ask("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])

    async def lift(self) -> None:
        """Take the finger away."""
        await self.ask("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    async def choose_file(self, element: str, file: Path) -> None:
        """Choose a file in the file input that the script `element` gives."""
        reference = await self.ask("Runtime.evaluate", expression=element)
        await self.ask("DOM.setFileInputFiles", files=[str(file)], objectId=reference["result"]["objectId"])

    async def click(self, element: str, right: float = 0, down: float = 0) -> None:
        """Click an element, so many pixels from its middle."""
        x, y = await self.middle(element)
        await self.press(x + right, y + down)
        await self.release(x + right, y + down)

    async def key(self, kind: str, key: str, code: int) -> None:
        """A `keyDown` or `keyUp`."""
        await self.ask("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    async def evaluate(self, script: str) -> Any:
        """What a script gives, as JSON has it."""
        result = await self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    async def until(self, script: str, seconds: float = TIMEOUT) -> None:
        """Wait until a script gives something true; a page that is being loaded has none to run it in."""
        deadline = time.monotonic() + seconds
        while True:
            with contextlib.suppress(AssertionError):
                if await self.evaluate(script):
                    return
            if time.monotonic() > deadline:
                text = await self.evaluate("document.body.innerText")
                raise AssertionError(
                    f"{script}: the page says {text!r}; complaints {self.complaints}, failed {self.failed_requests}"
                )
            await asyncio.sleep(0.1)

    async def picture(self) -> bytes:
        """A screenshot, PNG."""
        result = await self.ask("Page.captureScreenshot", format="png")
        return base64.b64decode(result["data"])


@contextlib.asynccontextmanager
async def chromium(directory: Path) -> AsyncIterator[Page]:
    """An empty page of a browser."""
    port = free_port()
    flags = ["--window-size=1400,900", f"--remote-debugging-port={port}", "about:blank"]
    process = Process(command(directory / "profile", *flags), directory / "chromium.log", directory)
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
