"""Clients of /telemetry/stream: those that read it as they should, and bytes for those that do not."""

from __future__ import annotations

import json
import socket
from typing import Any

from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    "Sec-WebSocket-Extensions": "permessage-deflate",
}


async def socket_events(api: Any, query: str, count: int) -> list[dict[str, Any]]:
    """The first events of a WebSocket."""
    async with api.client.ws_connect(f"/telemetry/stream{query}") as websocket:
        return [json.loads((await websocket.receive()).data) for _ in range(count)]


async def server_sent_events(api: Any, query: str, count: int) -> list[dict[str, Any]]:
    """The first Server-Sent Events, comments left out."""
    events: list[dict[str, Any]] = []
    async with api.client.get(f"/telemetry/stream{query}") as response:
        assert response.status == 200
        assert response.headers["Content-Type"].startswith("text/event-stream")
        name = ""
        async for line in response.content:
            field, _, value = line.decode().strip().partition(": ")
            if field == "event":
                name = value
            elif field == "data":
                events.append(json.loads(value))
                assert events[-1]["name"] == name
            if len(events) == count:
                break
    return events


async def all_bytes(loop: FastLoop, client: socket.socket) -> bytes:
    """What is sent to a client until its connection is closed."""
    data = b""
    while chunk := await loop.sock_recv(client, 1 << 16):
        data += chunk
    return data


async def bytes_until(loop: FastLoop, client: socket.socket, text: bytes) -> bytes:
    """What is sent to a client until that comes."""
    data = b""
    while text not in data:
        data += await loop.sock_recv(client, 1 << 16)
    return data


def pour(api: Any, loop: FastLoop, count: int) -> None:
    """Let so many long messages arrive, with a breath after each hundred."""
    for number in range(count):
        api.service.host.bridge.feed(message_of("statustext", text=f"{number:050d}"))
        if number % 100 == 99:
            api.service.host.bridge.turn()
            loop.settle()
