"""/telemetry/stream: every message as it arrives, by WebSocket or Server-Sent Events."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from aiohttp import WSCloseCode, WSMsgType, web

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.streaming import (
    COMMENT,
    KEEP_ALIVE,
    WHY,
    EventStream,
    NotRead,
    abort_later,
    limit_buffers,
    while_read,
)
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import StreamFilter
from mavproxy_uavapi.http.stream import stream_news, stream_views
from mavproxy_uavapi.http.stream.subscription import NamePatterns, Subscription, Wishes

MOST_SAID = 4096  # bytes of a message from a WebSocket's client; no message is expected
HEARD_EVERY = 0.1  # s between two of its messages, pings too; more of them wait on its side


async def stream(call: Call) -> web.StreamResponse:
    """Messages, views and events as they arrive, filtered by name, system and rate."""
    with call.one_more_stream(), call.service.broadcast.heard_by(_subscription(call)) as subscription:
        if call.request.headers.get("Upgrade", "").lower() == "websocket":
            return await _websocket(call.request, subscription)
        return await _events(call.request, subscription)


def _subscription(call: Call) -> Subscription:
    wanted = call.params(StreamFilter)
    name, view, event = NamePatterns(wanted.names.upper()), NamePatterns(wanted.view), NamePatterns(wanted.events)
    _require_some("view", view, stream_views.NAMES)
    _require_some("events", event, stream_news.NAMES)
    if not (name or view or event):
        name = NamePatterns("*")
    systems = wanted.systems or frozenset({call.named_system} if call.named_system else ())
    call.service.host.registry.use(*systems)
    return Subscription(Wishes(name, view, event, systems, wanted.rate), asyncio.get_running_loop().call_later)


def _require_some(parameter: str, wanted: NamePatterns, known: tuple[str, ...]) -> None:
    """Raise Invalid if a name that was asked for can never come."""
    for pattern in wanted.patterns:
        if not any(one in NamePatterns(pattern) for one in known):
            raise Invalid(f"{pattern!r} is not one of {', '.join(known)}", "query", parameter)


async def _websocket(request: web.BaseRequest, subscription: Subscription) -> web.StreamResponse:
    # With compression each message would have to be encoded for each client. aiohttp would answer a flood of pings by
    # itself, and let nobody else have the loop.
    socket = web.WebSocketResponse(compress=False, autoping=False, max_msg_size=MOST_SAID)
    limit_buffers(request.transport)
    await socket.prepare(request)
    sender = asyncio.create_task(_send_all(socket, request, subscription))
    try:
        with suppress(ConnectionError):  # the client has gone
            async for message in socket:  # until either side closes it
                if message.type is WSMsgType.ERROR:
                    break
                if message.type is WSMsgType.PING:
                    await socket.pong(message.data)
                await asyncio.sleep(HEARD_EVERY)
    finally:
        sender.cancel()
        with suppress(asyncio.CancelledError, ConnectionError):
            await sender
    return socket


async def _send_all(socket: web.WebSocketResponse, request: web.BaseRequest, subscription: Subscription) -> None:
    transport = request.transport
    try:
        while transport is not None and not socket.closed:
            events = await subscription.next(KEEP_ALIVE)
            if not events:
                await while_read(transport, 0, socket.ping())
            for event in events:
                text = event.json(subscription.dropped)
                await while_read(transport, len(text), socket.send_str(text))
    except NotRead:
        assert transport is not None
        abort_later(transport)
        await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=WHY.encode(), drain=False)


async def _events(request: web.BaseRequest, subscription: Subscription) -> web.StreamResponse:
    response = EventStream()
    with suppress(ConnectionError):  # the client has gone or reads no more; a stream ends so
        await response.prepare(request)
        while True:
            events = await subscription.next(KEEP_ALIVE)
            dropped = subscription.dropped
            await response.write(b"".join([event.sse(dropped) for event in events]) or COMMENT)
    return response
