"""Streaming answers: their number, and the end of one whose client does not read."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import struct
from collections import Counter
from collections.abc import Awaitable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from aiohttp import web
from aiohttp.abc import AbstractStreamWriter

from mavproxy_uavapi.core.errors import TooManyRequests
from mavproxy_uavapi.core.platform import POSIX

log = logging.getLogger("uavapi.http")

CORS_HEADERS: web.RequestKey[Mapping[str, str]] = web.RequestKey("cors", Mapping)  # of the answer to a trusted page
MOST_OPEN = 240  # streams at once, of all kinds
KEEP_ALIVE = 15.0  # s; silence after which a comment or ping is sent, to notice dead connections
UNREAD = 30.0  # s without reading after which a client is dropped
LINGER = 30.0  # s that it then has to read the reason
WHY = f"nothing was read for {UNREAD:g} s"
SEND_BUFFER = 128 * 1024  # bytes of a stream that the kernel buffers; a larger buffer delays the data
LOW_WATER = 16 * 1024  # bytes that wait in asyncio, or unsent in the kernel, up to which writers do not wait

AT_ONCE = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}  # nginx would collect it first

COMMENT = b": still here\n\n"
END = f"event: end\ndata: {json.dumps({'code': 'not_read', 'detail': WHY})}\n\n".encode()


class NotRead(ConnectionError):
    """The client read nothing for UNREAD seconds; its connection is about to be closed."""


class Slots:
    """Limits how many of a kind are open at once.

    Args:
        most: the limit.
        phrase: ends the text of the refusal, such as `streams are open`.

    Attributes:
        count: the number now open.
    """

    def __init__(self, most: int, phrase: str) -> None:
        self._most, self._phrase = most, phrase
        self.count = 0

    @contextmanager
    def one_more(self) -> Iterator[None]:
        """Take a slot for as long as the context lasts.

        Raises:
            TooManyRequests: all slots are taken.
        """
        if self.count >= self._most:
            raise TooManyRequests(f"{self._most} {self._phrase} already")
        self.count += 1
        try:
            yield
        finally:
            self.count -= 1


class SharedSlots(Slots):
    """Slots of which a caller may take another one while more are free than it has.

    So one caller gets half of them at most, the next one half of the rest, and there is one for a newcomer.
    """

    def __init__(self, most: int, phrase: str) -> None:
        super().__init__(most, phrase)
        self._taken: Counter[str] = Counter()

    @contextmanager
    def one_more_of(self, who: str) -> Iterator[None]:
        """Take a slot of that caller for as long as the context lasts.

        Raises:
            TooManyRequests: it has as many as are free, or all are taken.
        """
        taken, free = self._taken[who], self._most - self.count
        if taken >= free > 0:
            raise TooManyRequests(f"{taken} {self._phrase} to this caller already; {free} are left for others")
        with self.one_more():
            self._taken[who] += 1
            try:
                yield
            finally:
                self._taken -= Counter([who])  # forgets it at 0


class StreamingResponse(web.StreamResponse):
    """An answer that goes on until its client leaves or stops reading.

    Args:
        content_type: of the data.
        end_event: sent last to a client that stopped reading, in case it reads on.
    """

    def __init__(self, content_type: str, end_event: bytes = b"") -> None:
        super().__init__(headers={"Content-Type": content_type, **AT_ONCE})
        self._end_event = end_event
        self._transport: Any = None

    async def prepare(self, request: web.BaseRequest) -> AbstractStreamWriter | None:
        """Send the headers."""
        self._transport = request.transport
        limit_buffers(self._transport)
        self.headers.update(request.get(CORS_HEADERS, {}))
        return await super().prepare(request)

    async def write(self, data: bytes | bytearray | memoryview) -> None:
        """Write; wait while the client is slow.

        Raises:
            NotRead: the client has stopped reading.
            ConnectionError: the client has gone.
        """
        try:
            await while_read(self._transport, len(data), super().write(data))
        except NotRead:
            if not self._end_event:
                reset(self._transport)
                raise
            await super().write(self._end_event)
            self._transport.close()  # after it has sent its buffer
            abort_later(self._transport)
            raise


class EventStream(StreamingResponse):
    """Server-Sent Events."""

    def __init__(self) -> None:
        super().__init__("text/event-stream", END)


def limit_buffers(transport: asyncio.Transport | None) -> None:
    """Let asyncio and the kernel buffer only a little of a stream, and notice when the client's machine has gone."""
    sock = None if transport is None else transport.get_extra_info("socket")
    if transport is None or sock is None:
        return
    transport.set_write_buffer_limits(LOW_WATER)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    if hasattr(socket, "TCP_NOTSENT_LOWAT"):  # what waits with us instead can still be replaced by what is newer
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, LOW_WATER)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # on Linux; longer than UNREAD, which can give the reason
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, int(2 * UNREAD * 1000))


async def while_read(transport: asyncio.Transport, size: int, writing: Awaitable[None]) -> None:
    """Await `writing` of `size` bytes for as long as the client reads.

    Raises:
        NotRead: it read nothing for UNREAD seconds; `writing` is cancelled.
    """
    if transport.get_write_buffer_size() + size <= LOW_WATER:
        await writing  # returns at once
        return
    task = asyncio.ensure_future(writing)
    try:
        await asyncio.sleep(0)  # it hands over all bytes, then waits until most are sent
        while not task.done():
            before = transport.get_write_buffer_size()
            await asyncio.wait({task}, timeout=UNREAD)
            if not task.done() and transport.get_write_buffer_size() >= before:
                raise NotRead(WHY)
    finally:
        task.cancel()
    task.result()


def reset(transport: asyncio.Transport) -> None:
    """Close a connection in the middle of an answer so that its client does not take a part for the whole.

    To a client of HTTP/1.0, as nginx is by default, an orderly end of the connection is that of the answer.
    """
    sock = transport.get_extra_info("socket")
    if sock is not None:
        at_once = struct.pack("ii" if POSIX else "hh", 1, 0)  # on, 0 s: a RST instead of a FIN
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, at_once)
    transport.abort()


def abort_later(transport: asyncio.Transport) -> None:
    """Close a connection that is not read after LINGER seconds, even with unsent data."""
    peer = transport.get_extra_info("peername")
    log.info("a stream of %s was dropped: %s", peer[0] if peer else "a client", WHY)
    asyncio.get_running_loop().call_later(LINGER, transport.abort)
