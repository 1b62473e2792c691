from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.http.contract.telemetry_views import fields
from mavproxy_uavapi.http.stream import stream_event
from tests.support.drone import Drone
from tests.support.messages import message_of
from tests.support.stream_clients import UPGRADE, bytes_until, pour
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


@pytest.fixture
def encodings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the messages that were encoded."""
    names: list[str] = []

    def counting(message: Any) -> dict[str, Any]:
        names.append(message.get_type())
        return fields(message)

    monkeypatch.setattr(stream_event, "fields", counting)
    return names


def test_message_is_encoded_once_for_all_clients(
    flying: Drone, api: Api, loop: FastLoop, unread: Callable[..., socket.socket], encodings: list[str]
) -> None:
    clients = [unread("/telemetry/stream?names=STATUSTEXT") for _ in range(5)]
    clients += [unread("/telemetry/stream?names=STATUSTEXT&rate=1000", **UPGRADE) for _ in range(5)]
    api.until(lambda: api.service.streams.count == 10)
    api.service.host.bridge.feed(message_of("statustext", text="hello"))
    api.service.host.bridge.turn()

    async def greeted() -> bool:
        return all([b"hello" in await bytes_until(loop, client, b"hello") for client in clients])

    assert loop.run(greeted())
    assert encodings == ["STATUSTEXT"]


def test_what_nobody_reads_is_not_encoded(
    flying: Drone, api: Api, loop: FastLoop, unread: Callable[..., socket.socket], encodings: list[str]
) -> None:
    for _ in range(3):
        unread("/telemetry/stream?names=STATUSTEXT")
    api.until(lambda: api.service.streams.count == 3)
    pour(api, loop, 3000)  # fills what the sockets hold
    encodings.clear()
    pour(api, loop, 500)
    assert encodings == []
