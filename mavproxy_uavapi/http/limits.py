"""Limits that keep one client from holding up the others, and MAVProxy: requests per second, slow senders."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any, ClassVar

from aiohttp import web

from mavproxy_uavapi.errors import TooManyRequests
from mavproxy_uavapi.http.call import SERVICE
from mavproxy_uavapi.http.responses import Handler

BURST = 2.0  # s of the long-run rate that a client may use up at once
CLIENTS_KEPT = 1000
COMMANDS = ("/command/", "/movement/")  # paths that command by GET too
HEADER_TIMEOUT = 10.0  # s from the first byte of a connection, or of its next request, to the end of the headers


class Bucket:
    """A token bucket for each client. Pure: the clock is an argument."""

    def __init__(self) -> None:
        self._used: dict[str, tuple[float, float]] = {}  # client -> (tokens used up, at)

    def take(self, client: str, rate: float, now: float) -> float:
        """Take one request of `client`; 0, or the seconds to wait when it has used up its share.

        Args:
            client: its address.
            rate: requests per second in the long run.
            now: s.
        """
        used, at = self._used.pop(client, (0.0, now))
        used = max(0.0, used - (now - at) * rate)
        capacity = max(BURST * rate, 1.0)
        if used + 1 > capacity:
            self._used[client] = used, now
            return (used + 1 - capacity) / rate
        self._used[client] = used + 1, now
        if len(self._used) > CLIENTS_KEPT:
            del self._used[next(iter(self._used))]
        return 0.0


BUCKET = web.AppKey("bucket", Bucket)


@web.middleware
async def give_way(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Let MAVProxy's main loop finish what it is at: its messages are not to wait for our answers.

    What commands does not wait: it is short, and a vehicle is to hear of it at once.
    """
    if request.method == "GET" and not request.path.startswith(COMMANDS):
        await request.app[SERVICE].host.bridge.calm()
    return await handler(request)


@web.middleware
async def at_a_bearable_rate(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse a client that asks more often than it may."""
    service = request.app[SERVICE]
    wait = request.app[BUCKET].take(request.remote or "", service.settings.max_rate, service.host.clock())
    if wait:
        raise TooManyRequests(f"more than {service.settings.max_rate:g} requests a second", math.ceil(wait))
    return await handler(request)


class Patience(asyncio.Protocol):
    """Wraps aiohttp's protocol: closes a connection whose headers do not arrive in time.

    aiohttp itself waits for the rest of a request line for ever.
    """

    _of: ClassVar[dict[Any, Patience]] = {}  # by aiohttp's protocol, while the connection lasts

    def __init__(self, inner: Any) -> None:
        self._inner = inner
        self._transport: Any = None
        self._timer: asyncio.TimerHandle | None = None
        self._answering = False

    @classmethod
    def of(cls, request: web.Request) -> Patience | None:
        """The wrapper of a request's connection."""
        return cls._of.get(request.protocol)

    def began(self) -> None:
        """The headers are here."""
        self._answering = True
        self._stop()

    def ended(self) -> None:
        """The answer is out; the connection may idle until the next request's first byte."""
        self._answering = False

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _give_up(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def _expect(self) -> None:
        if self._timer is None and not self._answering:
            self._timer = asyncio.get_running_loop().call_later(HEADER_TIMEOUT, self._give_up)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See asyncio.Protocol."""
        self._transport = transport
        self._of[self._inner] = self
        self._expect()
        self._inner.connection_made(transport)

    def data_received(self, data: bytes) -> None:
        """See asyncio.Protocol."""
        self._expect()
        self._inner.data_received(data)

    def eof_received(self) -> Any:
        """See asyncio.Protocol."""
        return self._inner.eof_received()

    def pause_writing(self) -> None:
        """See asyncio.Protocol."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """See asyncio.Protocol."""
        self._inner.resume_writing()

    def connection_lost(self, error: Exception | None) -> None:
        """See asyncio.Protocol."""
        self._stop()
        self._of.pop(self._inner, None)
        self._inner.connection_lost(error)


def patient(factory: Callable[[], Any]) -> Callable[[], Patience]:
    """A protocol factory whose connections give up on slow headers."""
    return lambda: Patience(factory())


@web.middleware
async def headers_are_here(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Tell the connection's patience that a request has begun, and when it is answered."""
    patience = Patience.of(request)
    if patience is None:
        return await handler(request)
    patience.began()
    try:
        return await handler(request)
    finally:
        patience.ended()
