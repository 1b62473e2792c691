"""One connection: its timeout for slow headers, and the state that decides whether it may stay."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import Any, ClassVar

from aiohttp import web

from mavproxy_uavapi.http.contract.responses import Handler

Repeat = Callable[[], bytes | None]
HEADER_TIMEOUT = 10.0  # s from the first byte of a request to the end of its headers
IDLE_TIMEOUT = 30.0  # s that a connection may wait for its next request
LONGEST_REPEATED = 2048  # bytes of a request that is remembered
LINGER = 1.0  # s in which the rest of a refused body is discarded; an immediate close would lose the answer
LINGER_SIZE = 4 * 1024 * 1024  # bytes that are discarded at most


class Connection(asyncio.Protocol):
    """Wraps aiohttp's protocol and closes a connection whose headers do not arrive in time.

    aiohttp itself waits without limit for the rest of a request line.

    Args:
        factory: makes aiohttp's protocol.
        peer: the socket, not yet read; None if the transport exists already.
        group: the caller's group (`caller.group_of`).
        on_lost: called when the connection is over.

    Attributes:
        group: see above.
        silent: whether the peer has sent nothing yet.
        admitted: whether the last request has passed the door check.
        refused: whether the last request has failed it; the connection is about to be closed.
        answering: whether a request is being answered.
        idle_since: s, of the loop's clock: when it was made, or when its last answer was ready.
        closing: whether it is being closed.
    """

    _of: ClassVar[dict[Any, Connection]] = {}  # by aiohttp's protocol, for open connections

    def __init__(
        self,
        factory: Callable[[], Any],
        peer: socket.socket | None = None,
        group: str = "",
        on_lost: Callable[[Connection], object] | None = None,
    ) -> None:
        self.peer = peer
        self.group = group
        self.silent = self.admitted = self.refused = self.answering = self.closing = False
        self._loop = asyncio.get_running_loop()
        self.idle_since = self._loop.time()
        self._factory = factory
        self._on_lost = on_lost
        self._inner: Any = None
        self._transport: Any = None
        self._timer: asyncio.TimerHandle | None = None
        self._thrown_away = 0
        self._request = b""  # the last one, if it came alone and in one piece, as all before it
        self._awaited = False  # whether an answer to it is awaited
        self._mixed = False
        self._repeat: Repeat | None = None

    @classmethod
    def of(cls, request: web.BaseRequest) -> Connection | None:
        """The wrapper of a request's connection; None under another server."""
        return cls._of.get(request.protocol)

    def began(self) -> None:
        """The headers have arrived."""
        self.answering = True
        self._stop_timer()

    def ended(self) -> None:
        """The answer is ready; the connection may idle until the next request's first byte."""
        self.answering = self._awaited = False
        self.idle_since = self._loop.time()

    def judged(self, admitted: bool) -> None:
        """The door check has passed or refused the request."""
        self.admitted, self.refused = admitted, not admitted

    def await_first_byte(self, on_ready: Callable[[Connection], object]) -> None:
        """Call `on_ready` when the peer has sent something; until then a connection needs no more than a socket."""
        assert self.peer is not None
        self.silent = True
        self._loop.add_reader(self.peer, self._first_byte, on_ready)
        self._expect_headers()

    def _first_byte(self, on_ready: Callable[[Connection], object]) -> None:
        assert self.peer is not None
        self.silent = False
        self._loop.remove_reader(self.peer)
        on_ready(self)

    def abort(self) -> None:
        """Close the connection at once."""
        self.closing = True
        if self._transport is not None:
            self._transport.abort()
        elif self.peer is not None and self.silent:
            self._loop.remove_reader(self.peer)
            self.peer.close()
            self._lost()
        elif self.peer is not None:
            with contextlib.suppress(OSError):  # the peer closed it first
                self.peer.shutdown(socket.SHUT_RDWR)  # this ends a wait for the handshake

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _expect_headers(self) -> None:
        if self._timer is None and not self.answering:
            self._timer = self._loop.call_later(HEADER_TIMEOUT, self.abort)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See asyncio.Protocol."""
        self._transport = transport
        if self.closing:  # its place has been given away
            self.abort()
            return
        self._inner = self._factory()
        self._of[self._inner] = self
        self._expect_headers()
        self._inner.connection_made(transport)

    def remember(self, repeat: Repeat) -> None:
        """Answer the present request by `repeat` when it comes again, if this connection has had such ones only."""
        if self._request:
            self._repeat = repeat

    def _answers_again(self, data: bytes) -> bool:
        """Answer the bytes of the last request if they come again; otherwise prepare for another one."""
        if self._repeat is not None and data == self._request and not self._transport.get_write_buffer_size():
            answer = self._repeat()
            if answer is not None:
                self.idle_since = self._loop.time()
                self._transport.write(answer)
                return True
        self._repeat = None
        # One request line and the end of its headers: with nothing before it, this is a whole request.
        whole = data.count(b" HTTP/1.") == 1 and data.endswith(b"\r\n\r\n") and len(data) <= LONGEST_REPEATED
        self._mixed = self._mixed or self._awaited or not whole
        self._awaited = True
        self._request = b"" if self._mixed else data
        return False

    def data_received(self, data: bytes) -> None:
        """See asyncio.Protocol."""
        if self._inner is None or self._answers_again(data):
            return
        if self.refused:
            self._thrown_away += len(data)
            if self._thrown_away > LINGER_SIZE:
                self.abort()
                return
        self._expect_headers()
        self._inner.data_received(data)

    def eof_received(self) -> Any:
        """See asyncio.Protocol."""
        return None if self._inner is None else self._inner.eof_received()

    def pause_writing(self) -> None:
        """See asyncio.Protocol."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """See asyncio.Protocol."""
        self._inner.resume_writing()

    def connection_lost(self, error: Exception | None) -> None:
        """See asyncio.Protocol."""
        self.closing = True
        if self._inner is not None:
            self._of.pop(self._inner, None)
            self._inner.connection_lost(error)
        self._lost()

    def abandon(self) -> None:
        """The TLS handshake failed; aiohttp never learns of the connection."""
        self.closing = True
        self._lost()

    def _lost(self) -> None:
        self._stop_timer()
        if self._on_lost is not None:
            self._on_lost(self)


async def headers_are_here(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Mark a request as begun and later as answered; close its connection if the body was not read."""
    connection = Connection.of(request)
    if connection is not None:
        connection.began()
    try:
        response = await handler(request)
    finally:
        if connection is not None:
            connection.ended()
    if not request.content.is_eof():
        response.force_close()
    return response
