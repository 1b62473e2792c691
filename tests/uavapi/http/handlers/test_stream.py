from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from aiohttp import WSCloseCode, WSMsgType

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.streaming import KEEP_ALIVE, LINGER, MOST_OPEN, UNREAD
from mavproxy_uavapi.http.handlers.stream import HEARD_EVERY
from mavproxy_uavapi.http.stream.subscription import QUEUED
from tests.support.drone import Drone
from tests.support.messages import message_of
from tests.support.stream_clients import UPGRADE, all_bytes, bytes_until, pour, server_sent_events, socket_events
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

both = pytest.mark.parametrize("read", [socket_events, server_sent_events])


@both
@pytest.mark.parametrize("slash", ["", "/"])
def test_messages_come_as_they_arrive(flying: Drone, api: Api, loop: FastLoop, read: Any, slash: str) -> None:
    events = loop.run(read(api, slash, 9))
    assert {event["name"] for event in events} >= {"HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT"}
    for event in events:
        assert (event["system"], event["component"], event["dropped"]) == (1, 1, 0)
        assert event["fields"]["mavpackettype"] == event["name"]
    (position,) = [event["fields"] for event in events if event["name"] == "GLOBAL_POSITION_INT"]
    assert (position["relative_alt"], position["hdg"]) == (20_000, None)


@both
def test_names_are_a_filter(flying: Drone, api: Api, loop: FastLoop, read: Any) -> None:
    events = loop.run(read(api, "?names=attitude,%20VFR_HUD", 6))
    assert {event["name"] for event in events} == {"ATTITUDE", "VFR_HUD"}


@both
def test_system_is_a_filter(
    flying: Drone, make_drone: Callable[..., Drone], api: Api, loop: FastLoop, read: Any
) -> None:
    make_drone(2)
    events = loop.run(read(api, "?sysid=2", 12))
    assert {event["system"] for event in events} == {2}
    events = loop.run(read(api, "?names=ATTITUDE", 4))
    assert {event["system"] for event in events} == {1, 2}


@both
def test_several_vehicles_are_a_filter(
    flying: Drone, make_drone: Callable[..., Drone], api: Api, loop: FastLoop, read: Any
) -> None:
    for system in (2, 3):
        make_drone(system)
    events = loop.run(read(api, "?names=ATTITUDE&vehicles=1,%203", 12))
    assert {event["system"] for event in events} == {1, 3}
    events = loop.run(read(api, "?names=ATTITUDE&vehicles=3&sysid=2", 12))
    assert {event["system"] for event in events} == {2, 3}


@both
def test_rate_is_a_limit_for_each_name(flying: Drone, api: Api, loop: FastLoop, read: Any) -> None:
    started = loop.time()
    loop.run(read(api, "?names=ATTITUDE&rate=1", 4))
    assert loop.time() - started >= 3.0


@pytest.mark.parametrize(
    "query",
    [
        "?rate=0",
        "?rate=nan",
        "?sysid=300",
        "?sysid=x",
        "?vehicles=0",
        "?vehicles=1,",
        "?vehicles=256",
        "?vehicles=all",
        "?view=gsp",
        "?events=mode,moods",
    ],
)
def test_filter_that_makes_no_sense_is_422(api: Api, query: str) -> None:
    assert api.get(f"/telemetry/stream{query}").status == 422


@both
def test_client_that_leaves_is_forgotten(flying: Drone, api: Api, loop: FastLoop, host: Host, read: Any) -> None:
    loop.run(read(api, "", 3))
    api.until(lambda: not host.listeners)


def test_websocket_that_is_closed_by_its_client_ends_cleanly(
    flying: Drone, api: Api, loop: FastLoop, host: Host
) -> None:
    async def close() -> int | None:
        socket = await api.client.ws_connect("/telemetry/stream")
        await socket.receive()
        assert len(host.listeners) == 1
        await socket.close()
        return socket.close_code

    assert loop.run(close()) == 1000
    api.until(lambda: not host.listeners)


def test_quiet_stream_says_that_it_is_still_there(flying: Drone, api: Api, loop: FastLoop) -> None:
    async def first_line() -> tuple[bytes, float]:
        started = loop.time()
        async with api.client.get("/telemetry/stream?names=RAW_PRESSURE") as response:
            return await response.content.readline(), loop.time() - started

    line, took = loop.run(first_line())
    assert line.startswith(b":")
    assert took == pytest.approx(KEEP_ALIVE, abs=1.0)


def test_slow_reader_delays_nobody(flying: Drone, api: Api, loop: FastLoop, host: Host) -> None:
    async def slow() -> None:
        async with api.client.ws_connect("/telemetry/stream?names=STATUSTEXT"):
            await asyncio.sleep(30.0)  # reads nothing

    reader = loop.create_task(slow())
    api.until(lambda: host.listeners)
    for number in range(3 * QUEUED):
        host.bridge.feed(message_of("statustext", text=f"{number:050d}"))
        host.bridge.turn()
    started = loop.time()
    assert api.get("/telemetry/gps").status == 200
    assert loop.time() - started < 0.5
    reader.cancel()
    api.until(lambda: not host.listeners)


def test_client_is_not_expected_to_say_anything(flying: Drone, api: Api, loop: FastLoop) -> None:
    async def talk() -> WSMsgType:
        async with api.client.ws_connect("/telemetry/stream?names=HEARTBEAT") as socket:
            await socket.send_str("hello")
            return (await socket.receive()).type

    assert loop.run(talk()) is WSMsgType.TEXT


def test_websocket_is_not_compressed(flying: Drone, loop: FastLoop, unread: Callable[..., socket.socket]) -> None:
    client = unread(**UPGRADE)
    assert b"deflate" not in loop.run(bytes_until(loop, client, b"\r\n\r\n"))


def test_websocket_that_says_too_much_at_once_is_closed(flying: Drone, api: Api, loop: FastLoop, host: Host) -> None:
    async def shout() -> int | None:
        async with api.client.ws_connect("/telemetry/stream?names=NONE") as socket:
            await socket.send_bytes(bytes(1 << 20))
            await socket.receive()
            return socket.close_code

    assert loop.run(shout()) == WSCloseCode.MESSAGE_TOO_BIG
    api.until(lambda: not host.listeners)


def test_websocket_that_talks_without_end_has_to_wait(flying: Drone, api: Api, loop: FastLoop) -> None:
    output = 0

    async def talk() -> None:
        nonlocal output
        async with api.client.ws_connect("/telemetry/stream?names=NONE") as socket:
            while True:
                await socket.send_bytes(bytes(4000))
                output += 4000

    talking = loop.create_task(talk())
    loop.pass_time(10.0)
    talking.cancel()
    assert 0 < output < 20e6  # what the buffers on the way hold, rather than all that it has to say


def test_quiet_websocket_is_pinged(flying: Drone, api: Api, loop: FastLoop) -> None:
    async def first() -> tuple[WSMsgType, float]:
        began = loop.time()
        async with api.client.ws_connect("/telemetry/stream?names=NONE", autoping=False) as socket:
            return (await socket.receive()).type, loop.time() - began

    kind, took = loop.run(first())
    assert kind is WSMsgType.PING
    assert took == pytest.approx(KEEP_ALIVE, abs=1.0)


def test_websocket_that_pings_without_end_has_to_wait(flying: Drone, api: Api, loop: FastLoop) -> None:
    async def echoes() -> tuple[list[bytes], float]:
        began = loop.time()
        async with api.client.ws_connect("/telemetry/stream?names=NONE", autoping=False) as socket:
            for number in range(20):
                await socket.send_frame(bytes([number]), WSMsgType.PONG)
                await socket.ping(bytes([number]))
            messages = [await socket.receive() for _ in range(20)]
        return [message.data for message in messages if message.type is WSMsgType.PONG], loop.time() - began

    pongs, took = loop.run(echoes())
    assert pongs == [bytes([number]) for number in range(20)]
    assert took > 39 * HEARD_EVERY - 0.05


@pytest.mark.parametrize(("headers", "says"), [({}, b"event: end"), (UPGRADE, b"\x03\xf0nothing was read")])
def test_client_that_reads_nothing_is_dropped_and_gets_the_reason(
    flying: Drone,
    api: Api,
    loop: FastLoop,
    host: Host,
    unread: Callable[..., socket.socket],
    headers: dict[str, str],
    says: bytes,
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT", **headers)
    api.until(lambda: host.listeners)
    began = loop.time()
    pour(api, loop, 3000)
    loop.pass_time(UNREAD - 2.0)
    assert host.listeners
    api.until(lambda: not host.listeners)
    assert loop.time() - began == pytest.approx(UNREAD, abs=2.0)
    data = loop.run(all_bytes(loop, client))
    assert says in data
    assert b"nothing was read for 30 s" in data[-200:]


def test_client_that_reads_slowly_is_kept(
    flying: Drone, api: Api, loop: FastLoop, host: Host, unread: Callable[..., socket.socket]
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT")
    api.until(lambda: host.listeners)

    async def read_slowly() -> None:
        for _ in range(10):
            await asyncio.sleep(UNREAD / 2)
            for _ in range(30):
                with suppress(BlockingIOError):
                    client.recv(4096)
                await asyncio.sleep(0.001)

    pour(api, loop, 3000)
    loop.run(read_slowly())
    assert host.listeners


def test_slow_reader_with_a_rate_gets_little_that_is_old(
    flying: Drone, api: Api, loop: FastLoop, host: Host, unread: Callable[..., socket.socket]
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT&rate=100")
    api.until(lambda: host.listeners)
    for number in range(1000):  # for 20 s, of which it reads nothing
        host.bridge.feed(message_of("statustext", text=f"{number:050d}"))
        host.bridge.turn()
        loop.pass_time(0.02)
    data = loop.run(bytes_until(loop, client, f"{999:050d}".encode()))
    assert data.count(b"event: STATUSTEXT") < 300  # what fills the buffers on the way, and the newest
    assert b'"dropped": 0' in data[-400:]


def test_client_that_never_reads_holds_no_connection(
    flying: Drone, api: Api, loop: FastLoop, host: Host, unread: Callable[..., socket.socket]
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT")
    api.until(lambda: host.listeners)
    pour(api, loop, 3000)
    loop.pass_time(UNREAD + LINGER + 5.0)
    assert b"event: end" not in loop.run(all_bytes(loop, client))


def test_streams_beyond_a_callers_share_are_429_and_a_place_is_free_again(
    flying: Drone, api: Api, loop: FastLoop, unread: Callable[..., socket.socket]
) -> None:
    share = MOST_OPEN // 2
    clients = [unread("/telemetry/stream?names=HEARTBEAT") for _ in range(share)]
    api.until(lambda: api.service.streams.count == share)
    refused = api.get("/telemetry/stream")
    assert (refused.status, refused.body["code"]) == (429, "too_many_requests")
    assert refused.body["detail"] == f"{share} streams are open to this caller already; {share} are left for others"
    clients[0].close()
    api.until(lambda: api.service.streams.count < share)
    assert loop.run(server_sent_events(api, "", 1))


def test_scripts_open_streams_keep_no_page_of_the_machine_from_one(
    flying: Drone, api: Api, unread: Callable[..., socket.socket]
) -> None:
    for _ in range(MOST_OPEN // 2 + 5):
        unread("/telemetry/stream?names=HEARTBEAT")
    api.until(lambda: api.service.streams.count == MOST_OPEN // 2)
    unread("/telemetry/stream?names=HEARTBEAT", **{"User-Agent": "Mozilla/5.0 (X11) Firefox/127.0"})
    api.until(lambda: api.service.streams.count == MOST_OPEN // 2 + 1)
