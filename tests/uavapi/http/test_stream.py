from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest
from aiohttp import WSMsgType

from mavproxy_uavapi.http.requests import StreamFilter
from mavproxy_uavapi.http.stream import KEEP_ALIVE, QUEUED, Subscription, subscribed


async def socket_events(api: Any, query: str, count: int) -> list[dict[str, Any]]:
    """The first events of a WebSocket."""
    async with api.client.ws_connect(f"/telemetry/stream{query}") as socket:
        return [json.loads((await socket.receive()).data) for _ in range(count)]


async def server_sent_events(api: Any, query: str, count: int) -> list[dict[str, Any]]:
    """The first Server-Sent Events, comments left out."""
    found: list[dict[str, Any]] = []
    async with api.client.get(f"/telemetry/stream{query}") as response:
        assert response.status == 200
        assert response.headers["Content-Type"].startswith("text/event-stream")
        name = ""
        async for line in response.content:
            field, _, value = line.decode().strip().partition(": ")
            if field == "event":
                name = value
            elif field == "data":
                found.append(json.loads(value))
                assert found[-1]["name"] == name
            if len(found) == count:
                break
    return found


both = pytest.mark.parametrize("events", [socket_events, server_sent_events])


@both
@pytest.mark.parametrize("slash", ["", "/"])
def test_messages_come_as_they_arrive(flying: Any, api: Any, loop: Any, events: Any, slash: str) -> None:
    found = loop.run(events(api, slash, 9))
    assert {event["name"] for event in found} >= {"HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT"}
    for event in found:
        assert (event["system"], event["component"], event["dropped"]) == (1, 1, 0)
        assert event["fields"]["mavpackettype"] == event["name"]
    (position,) = [event["fields"] for event in found if event["name"] == "GLOBAL_POSITION_INT"]
    assert (position["relative_alt"], position["hdg"]) == (20_000, None)


@both
def test_names_are_a_filter(flying: Any, api: Any, loop: Any, events: Any) -> None:
    found = loop.run(events(api, "?names=attitude,%20VFR_HUD", 6))
    assert {event["name"] for event in found} == {"ATTITUDE", "VFR_HUD"}


@both
def test_system_is_a_filter(flying: Any, make_drone: Any, api: Any, loop: Any, events: Any) -> None:
    make_drone(2)
    found = loop.run(events(api, "?sysid=2", 12))
    assert {event["system"] for event in found} == {2}
    found = loop.run(events(api, "?names=ATTITUDE", 4))
    assert {event["system"] for event in found} == {1, 2}


@both
def test_rate_is_a_limit_for_each_name(flying: Any, api: Any, loop: Any, events: Any) -> None:
    started = loop.time()
    loop.run(events(api, "?names=ATTITUDE&rate=1", 4))
    assert loop.time() - started >= 3.0


@pytest.mark.parametrize("query", ["?rate=0", "?rate=nan", "?sysid=300", "?sysid=x"])
def test_filter_that_makes_no_sense_is_422(api: Any, query: str) -> None:
    assert api.get(f"/telemetry/stream{query}").status == 422


@both
def test_client_that_leaves_is_forgotten(flying: Any, api: Any, loop: Any, host: Any, events: Any) -> None:
    loop.run(events(api, "", 3))
    api.until(lambda: not host.listeners)


def test_websocket_that_is_closed_by_its_client_ends_cleanly(flying: Any, api: Any, loop: Any, host: Any) -> None:
    async def close() -> int | None:
        socket = await api.client.ws_connect("/telemetry/stream")
        await socket.receive()
        assert len(host.listeners) == 1
        await socket.close()
        return socket.close_code

    assert loop.run(close()) == 1000
    api.until(lambda: not host.listeners)


def test_quiet_stream_says_that_it_is_still_there(flying: Any, api: Any, loop: Any) -> None:
    async def first_line() -> tuple[bytes, float]:
        started = loop.time()
        async with api.client.get("/telemetry/stream?names=RAW_PRESSURE") as response:
            return await response.content.readline(), loop.time() - started

    line, took = loop.run(first_line())
    assert line.startswith(b":")
    assert took == pytest.approx(KEEP_ALIVE, abs=1.0)


def test_slow_reader_delays_nobody(flying: Any, api: Any, loop: Any, host: Any, msg: Any) -> None:
    async def slow() -> None:
        async with api.client.ws_connect("/telemetry/stream?names=STATUSTEXT"):
            await asyncio.sleep(30.0)  # reads nothing

    reader = loop.create_task(slow())
    api.until(lambda: host.listeners)
    for number in range(3 * QUEUED):
        host.bridge.feed(msg("statustext", text=f"{number:050d}"))
        host.bridge.turn()
    started = loop.time()
    assert api.get("/telemetry/gps").status == 200
    assert loop.time() - started < 0.5
    reader.cancel()
    api.until(lambda: not host.listeners)


# -- one subscription -------------------------------------------------------------------------------------


def take(loop: Any, subscription: Subscription) -> dict[str, Any]:
    return loop.run(subscription.next())


def test_reader_that_falls_behind_loses_the_oldest_and_is_told_how_many(loop: Any, host: Any, msg: Any) -> None:
    state = host.fleet.update(msg("heartbeat"), 0.0)
    subscription = Subscription(frozenset(), None, None)
    for number in range(QUEUED + 25):
        subscription.offer(state, msg("attitude", time_boot_ms=number), 1.0)
    assert subscription.dropped == 25
    assert take(loop, subscription)["fields"]["time_boot_ms"] == 25
    for _ in range(QUEUED - 1):
        last = take(loop, subscription)
    assert last["fields"]["time_boot_ms"] == QUEUED + 24
    assert last["dropped"] == 25


def test_rate_lets_the_first_through_and_counts_components_apart(loop: Any, host: Any, msg: Any) -> None:
    state = host.fleet.update(msg("heartbeat"), 0.0)
    subscription = Subscription(frozenset(), None, 2.0)
    heard = []
    for tenth in range(11):
        for component in (1, 154):
            message = msg("attitude", component=component)
            before = subscription._queue.qsize()
            subscription.offer(state, message, tenth / 10)
            heard += [(tenth, component)] * (subscription._queue.qsize() - before)
    assert heard == [(tenth, component) for tenth in (0, 5, 10) for component in (1, 154)]


def test_subscription_ends_with_its_context(host: Any) -> None:
    with pytest.raises(KeyError), subscribed(host, StreamFilter()):
        assert len(host.listeners) == 1
        raise KeyError
    assert host.listeners == []


def test_client_is_not_expected_to_say_anything(flying: Any, api: Any, loop: Any) -> None:
    async def talk() -> WSMsgType:
        async with api.client.ws_connect("/telemetry/stream?names=HEARTBEAT") as socket:
            await socket.send_str("hello")
            return (await socket.receive()).type

    assert loop.run(talk()) is WSMsgType.TEXT
