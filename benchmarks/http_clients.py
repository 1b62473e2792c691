"""HTTP clients that cost little, in processes of their own, and a bare aiohttp server to compare with."""

from __future__ import annotations

import asyncio
import contextlib
import json
import multiprocessing
import socket
import time
from typing import Any

from rig import free_port, harness

BACKLOG = 1 << 16
TOO_MANY = 429


class Client:
    """One keep-alive connection that costs as little as an HTTP client in Python can.

    Args:
        port: where to, on the loopback.
        headers: whole lines that every request has.
    """

    def __init__(self, port: int, headers: str = "") -> None:
        self._port = port
        self._host = f"Host: 127.0.0.1:{port}\r\n{headers}".encode()

    async def open(self) -> None:
        """Connect."""
        self._reader, self._writer = await asyncio.open_connection("127.0.0.1", self._port)

    async def ask(self, path: str, body: Any = None) -> tuple[int, bytes]:
        """One request; its status and body. With `body`, a POST of that as JSON."""
        content = b"" if body is None else json.dumps(body).encode()
        method = b"GET " if body is None else b"POST "
        head = b"" if body is None else b"Content-Type: application/json\r\nContent-Length: %d\r\n" % len(content)
        self._writer.write(method + path.encode() + b" HTTP/1.1\r\n" + self._host + head + b"\r\n" + content)
        answer = await self._reader.readuntil(b"\r\n\r\n")
        length = int(answer.lower().partition(b"content-length:")[2].partition(b"\r")[0] or 0)
        return int(answer[9:12]), await self._reader.readexactly(length)

    def close(self) -> None:
        """Hang up."""
        self._writer.close()


async def poll(port: int, path: str, seconds: float, times: list[float]) -> None:
    """Read `path` again and again on one connection; notes how long (s) each answer took.

    An answer that says "too many" is no read, and no reason for this client to pause.
    """
    client = Client(port)
    await client.open()
    end = time.monotonic() + seconds
    while (before := time.monotonic()) < end:
        status, body = await client.ask(path)
        assert status in (200, TOO_MANY), body
        if status != TOO_MANY:
            times.append(time.monotonic() - before)
    client.close()


async def wait_in_vain(port: int, target: dict[str, float]) -> None:
    """A client of a verb that goes so far away that it will not arrive."""
    client = Client(port)
    await client.open()
    try:
        answer = await client.ask("/movement/go_to_ned_wait", target)
        raise AssertionError(f"a waiting verb ended: {answer}")
    finally:
        client.close()


async def listen(port: int) -> None:
    """A telemetry stream's client, by Server-Sent Events, which reads all that comes."""
    client = Client(port)
    await client.open()
    client._writer.write(b"GET /telemetry/stream HTTP/1.1\r\n" + client._host + b"\r\n")
    try:
        while await client._reader.read(BACKLOG):
            pass
    finally:
        client.close()


FAR_AWAY = {"x": 50_000, "y": 0, "z": -10}


async def _load(port: int, *, path: str, seconds: float, pollers: int, waiting: int, streams: int) -> list[float]:
    others = [asyncio.ensure_future(wait_in_vain(port, FAR_AWAY)) for _ in range(waiting)]
    others += [asyncio.ensure_future(listen(port)) for _ in range(streams)]
    times: list[float] = []
    if waiting:
        await asyncio.sleep(0.3)  # until they all wait
    if pollers:
        await asyncio.gather(*(poll(port, path, seconds, times) for _ in range(pollers)))
    else:
        await asyncio.sleep(seconds)
    for task in others:
        assert not task.done(), task.exception()
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)
    return times


def _run_load(pipe: Any) -> None:
    while (job := pipe.recv()) is not None:
        pipe.send(asyncio.run(_load(**job)))


def _run_bare(port: int) -> None:
    from aiohttp import web  # noqa: PLC0415  the other processes need none

    body = {"device": "uav", "id": "1", "result": "success", "info": {"position": {"lat": -35.3, "lon": 149.1}}}

    async def answer(_: web.Request) -> web.Response:
        return web.json_response(body)

    app = web.Application()
    app.router.add_get("/telemetry/gps", answer)
    web.run_app(app, host="127.0.0.1", port=port, print=None, access_log=None)


class Clients:
    """HTTP clients in a process of their own."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_run_load, args=(theirs,), daemon=True)
        self._process.start()

    def begin(
        self,
        port: int,
        seconds: float,
        *,
        path: str = "/telemetry/gps",
        pollers: int = 0,
        waiting: int = 0,
        streams: int = 0,
    ) -> None:
        """Start: `pollers` read `path` as fast as they can, `waiting` wait for a verb, `streams` listen."""
        job = {"port": port, "path": path, "seconds": seconds, "pollers": pollers}
        self._pipe.send({**job, "waiting": waiting, "streams": streams})

    def end(self) -> list[float]:
        """Wait until they are done; how long (s) each answer to a poller took."""
        times: list[float] = self._pipe.recv()
        return times

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self._process.join(10)


class Bare:
    """An aiohttp server with nothing behind it, in a process of its own: what HTTP in Python costs here."""

    def __init__(self) -> None:
        self.port = free_port()
        self._process = multiprocessing.get_context("spawn").Process(target=_run_bare, args=(self.port,), daemon=True)
        self._process.start()
        harness.eventually(self._is_up, what="the bare server's start")

    def _is_up(self) -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
            return True
        return False

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join(10)
