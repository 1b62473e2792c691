"""The API on a real port, and connections to it, as bytes."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from mavproxy_uavapi.http.server.app import ApiServer
from tests.support.virtual_time import FastLoop

TOKEN = "a-long-and-secret-word"
OWNER = f"Authorization: Bearer {TOKEN}\r\n"
FORM = "Content-Type: multipart/form-data; boundary=b"
START = b'--b\r\nContent-Disposition: form-data; name="other"; filename="o"\r\n\r\n'


class Wire:
    """A connection to the API, as bytes."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    def send(self, method: str, path: str, *headers: str, body: bytes = b"", host: str = "127.0.0.1") -> None:
        """A request; `headers` are whole lines, and `body` is sent as it is."""
        lines = [f"{method} {path} HTTP/1.1", f"Host: {host}", *(header.rstrip("\r\n") for header in headers)]
        self.writer.write("\r\n".join([*lines, "", ""]).encode("latin-1") + body)

    async def answer(self) -> Any:
        """The next answer: `status`, `head` and `body`; None when the connection has ended."""
        try:
            head = (await self.reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        except (asyncio.IncompleteReadError, ConnectionError):
            return None
        length = int(head.lower().partition("content-length:")[2].partition("\r")[0] or 0)
        text = (await self.reader.readexactly(length)).decode()
        body = json.loads(text) if text.startswith(("{", "[")) else text
        return SimpleNamespace(status=int(head.split()[1]), head=head, body=body)

    async def ask(self, method: str, path: str, *headers: str, **options: Any) -> Any:
        """A request and its answer."""
        self.send(method, path, *headers, **options)
        return await self.answer()

    async def ended(self) -> bool:
        """Wait for the connection's end; whether nothing came before it."""
        try:
            return await self.reader.read() == b""
        except ConnectionError:
            return True


class Port:
    """A server that listens, and connections to it."""

    def __init__(self, loop: FastLoop, server: ApiServer, port: int) -> None:
        self.loop, self.server, self.port = loop, server, port
        self._wires: list[Wire] = []

    async def connect(self, source: str = "127.0.0.1") -> Wire:
        wire = Wire(*await asyncio.open_connection("127.0.0.1", self.port, local_addr=(source, 0)))
        self._wires.append(wire)
        return wire

    async def ask(self, method: str, path: str, *headers: str, **options: Any) -> Any:
        """A request on a connection of its own, and its answer."""
        wire = await self.connect()
        answer = await wire.ask(method, path, *headers, **options)
        wire.writer.close()
        return answer

    def run(self, act: Callable[[], Any]) -> Any:
        return self.loop.run(act())

    async def settled(self) -> None:
        """Wait until the server has seen what the sockets hold."""
        for _ in range(50):
            await asyncio.sleep(0)
            time.sleep(0.001)  # noqa: ASYNC251  both ends live in this loop, whose clock would jump meanwhile

    async def close(self) -> None:
        for wire in self._wires:
            wire.writer.transport.abort()
        await self.server.stop()
        await asyncio.sleep(0)
