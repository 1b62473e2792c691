"""/telemetry/stream: every message as it arrives, by WebSocket or Server-Sent Events."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from aiohttp import WSMsgType, web

from mavproxy_uavapi.host.host import Host
from mavproxy_uavapi.host.patience import within
from mavproxy_uavapi.host.state import VehicleState
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import StreamFilter
from mavproxy_uavapi.http.responses import dumps
from mavproxy_uavapi.http.telemetry_views import fields

QUEUED = 1000  # messages; a client that reads slower than that loses the oldest
KEEP_ALIVE = 15.0  # s; a comment or ping after such a silence, so that dead clients are noticed


class Subscription:
    """What one client wants to hear, and what it has not read yet."""

    def __init__(self, names: frozenset[str], system: int | None, rate: float | None) -> None:
        self._names = names
        self._system = system
        self._interval = 1.0 / rate if rate else 0.0
        self._last: dict[tuple[int, int, str], float] = {}
        self._queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue(QUEUED)
        self.dropped = 0

    def offer(self, state: VehicleState, message: Any, now: float) -> None:
        """Queue a message that arrived at `now` (s), if it is wanted."""
        name = message.get_type()
        if (self._names and name not in self._names) or self._system not in (None, state.system):
            return
        key = state.system, message.get_srcComponent(), name
        if now - self._last.get(key, -self._interval) < self._interval:
            return
        self._last[key] = now
        if self._queue.full():
            self._queue.get_nowait()
            self.dropped += 1
        self._queue.put_nowait(self._event(message))

    def _event(self, message: Any) -> dict[str, Any]:
        return {
            "system": message.get_srcSystem(),
            "component": message.get_srcComponent(),
            "name": message.get_type(),
            "time": round(time.time(), 3),
            "dropped": self.dropped,
            "fields": fields(message),
        }

    async def next(self) -> dict[str, Any]:
        """The next event."""
        return await self._queue.get()


@contextmanager
def subscribed(host: Host, wanted: StreamFilter) -> Iterator[Subscription]:
    """A subscription for as long as the context lasts."""
    names = frozenset(name.strip().upper() for name in wanted.names.split(",") if name.strip())
    subscription = Subscription(names, wanted.sysid, wanted.rate)
    host.listeners.append(subscription.offer)
    try:
        yield subscription
    finally:
        host.listeners.remove(subscription.offer)


async def stream(call: Call) -> web.StreamResponse:
    """Messages as they arrive, filtered by name, system and rate."""
    with subscribed(call.service.host, call.params(StreamFilter)) as subscription:
        if call.request.headers.get("Upgrade", "").lower() == "websocket":
            return await _websocket(call.request, subscription)
        return await _events(call.request, subscription)


async def _websocket(request: web.Request, subscription: Subscription) -> web.StreamResponse:
    socket = web.WebSocketResponse(heartbeat=KEEP_ALIVE)
    await socket.prepare(request)
    sender = asyncio.create_task(_send_all(socket, subscription))
    try:
        async for message in socket:  # nothing is expected of the client but its closing
            if message.type is WSMsgType.ERROR:
                break
    finally:
        sender.cancel()
        with suppress(asyncio.CancelledError, ConnectionError):
            await sender
    return socket


async def _send_all(socket: web.WebSocketResponse, subscription: Subscription) -> None:
    while not socket.closed:
        await socket.send_str(dumps(await subscription.next()))


async def _events(request: web.Request, subscription: Subscription) -> web.StreamResponse:
    response = web.StreamResponse(headers={"Content-Type": "text/event-stream", "Cache-Control": "no-store"})
    await response.prepare(request)
    with suppress(ConnectionError):  # the client has gone: that is how a stream ends
        while True:
            try:
                event = await within(KEEP_ALIVE, subscription.next())
            except asyncio.TimeoutError:
                await response.write(b": still here\n\n")
            else:
                await response.write(f"event: {event['name']}\ndata: {dumps(event)}\n\n".encode())
    return response
