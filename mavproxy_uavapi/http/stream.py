"""/telemetry/stream: every message as it arrives, by WebSocket or Server-Sent Events."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from aiohttp import WSCloseCode, WSMsgType, web

from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.http.broadcast import Subscription
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import StreamFilter
from mavproxy_uavapi.http.streaming import (
    COMMENT,
    KEEP_ALIVE,
    WHY,
    EventStream,
    NotRead,
    abort_later,
    limit_kernel,
    while_read,
)

MOST_SAID = 4096  # bytes of a message from a WebSocket's client; no message is expected
HEARD_EVERY = 0.1  # s between two of its messages; more of them wait on its side


async def stream(call: Call) -> web.StreamResponse:
    """Messages as they arrive, filtered by name, system and rate."""
    with call.service.streams.one_more(), call.service.broadcast.heard_by(_subscription(call)) as subscription:
        if call.request.headers.get("Upgrade", "").lower() == "websocket":
            return await _websocket(call.request, subscription)
        return await _events(call.request, subscription)


def _subscription(call: Call) -> Subscription:
    wishes = call.params(StreamFilter)
    names = frozenset(name.strip().upper() for name in wishes.names.split(",") if name.strip())
    return Subscription(names, wishes.sysid or call.named_system or None, wishes.rate)


async def _websocket(request: web.BaseRequest, subscription: Subscription) -> web.StreamResponse:
    # With compression each message would have to be encoded for each client.
    socket = web.WebSocketResponse(compress=False, max_msg_size=MOST_SAID)
    limit_kernel(request.transport)
    await socket.prepare(request)
    sender = asyncio.create_task(_send_all(socket, request, subscription))
    try:
        async for message in socket:  # until either side closes it
            if message.type is WSMsgType.ERROR:
                break
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
            try:
                events = await wait_with_timeout(KEEP_ALIVE, subscription.next())
            except asyncio.TimeoutError:
                await while_read(transport, 0, socket.ping())
                continue
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
            try:
                events = await wait_with_timeout(KEEP_ALIVE, subscription.next())
            except asyncio.TimeoutError:
                await response.write(COMMENT)
            else:
                texts = [f"event: {event.name}\ndata: {event.json(subscription.dropped)}\n\n" for event in events]
                await response.write("".join(texts).encode())
    return response
