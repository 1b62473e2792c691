"""HTTP over a transport in memory: no socket, no waiting."""

from __future__ import annotations

import asyncio
import json
from typing import Any, NamedTuple

CLIENT = 50000  # a client's port


class Reply(NamedTuple):
    """An answer: HTTP status, parsed body (None for what is no JSON), when it came (s), and as it was."""

    status: int
    body: Any
    at: float
    headers: dict[str, str]
    raw: bytes

    @property
    def outcome(self) -> str:
        """`200`, or the status and the code, such as `409 superseded`."""
        return f"{self.status} {self.body['code']}" if "code" in self.body else str(self.status)


class Wire(asyncio.Transport):
    """One HTTP connection in memory; `reply` is there when the server has closed it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, protocol: Any, port: int = CLIENT) -> None:
        super().__init__({"peername": ("127.0.0.1", port), "sockname": ("127.0.0.1", 8000)})
        self._loop = loop
        self._protocol = protocol
        self._written = bytearray()
        self._closing = False
        self.reply: asyncio.Future[Reply | None] = loop.create_future()
        protocol.connection_made(self)

    def ask(self, request: bytes) -> None:
        """The client's request arrives."""
        self._protocol.data_received(request)

    def hang_up(self) -> None:
        """The client goes away."""
        self.close()

    def write(self, data: Any) -> None:
        self._written += data

    def is_closing(self) -> bool:
        return self._closing

    def close(self) -> None:
        if not self._closing:
            self._closing = True
            self._loop.call_soon(self._closed)

    abort = close

    def _closed(self) -> None:
        self._protocol.connection_lost(None)
        if not self.reply.done():
            self.reply.set_result(self._parsed())

    def _parsed(self) -> Reply | None:
        head, _, body = bytes(self._written).partition(b"\r\n\r\n")
        if not head:
            return None
        status, *lines = head.decode("latin-1").split("\r\n")
        headers = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
        is_json = headers.get("content-type", "").startswith("application/json")
        content = json.loads(body, parse_constant=_no_json) if is_json and body else None
        return Reply(int(status.split()[1]), content, self._loop.time(), headers, body)

    def get_write_buffer_size(self) -> int:
        return 0

    def pause_reading(self) -> None:
        """The requests here are short."""

    def resume_reading(self) -> None:
        """The requests here are short."""


def _no_json(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")
