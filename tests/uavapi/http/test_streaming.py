from __future__ import annotations

import asyncio
import contextlib
from contextlib import suppress
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import TooManyRequests
from mavproxy_uavapi.http.streaming import LINGER, MOST_OPEN, UNREAD, SharedSlots
from tests.support.stream_clients import UPGRADE, all_bytes, bytes_until, pour, server_sent_events


@pytest.mark.parametrize(("headers", "says"), [({}, b"event: end"), (UPGRADE, b"\x03\xf0nothing was read")])
def test_client_that_reads_nothing_is_dropped_and_gets_the_reason(
    flying: Any, api: Any, loop: Any, host: Any, unread: Any, msg: Any, headers: dict[str, str], says: bytes
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT", **headers)
    api.until(lambda: host.listeners)
    began = loop.time()
    pour(api, loop, msg, 3000)
    loop.pass_time(UNREAD - 2.0)
    assert host.listeners
    api.until(lambda: not host.listeners)
    assert loop.time() - began == pytest.approx(UNREAD, abs=2.0)
    data = loop.run(all_bytes(loop, client))
    assert says in data
    assert b"nothing was read for 30 s" in data[-200:]


def test_client_that_reads_slowly_is_kept(flying: Any, api: Any, loop: Any, host: Any, unread: Any, msg: Any) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT")
    api.until(lambda: host.listeners)

    async def read_slowly() -> None:
        for _ in range(10):
            await asyncio.sleep(UNREAD / 2)
            for _ in range(30):
                with suppress(BlockingIOError):
                    client.recv(4096)
                await asyncio.sleep(0.001)

    pour(api, loop, msg, 3000)
    loop.run(read_slowly())
    assert host.listeners


def test_slow_reader_with_a_rate_gets_little_that_is_old(
    flying: Any, api: Any, loop: Any, host: Any, unread: Any, msg: Any
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT&rate=100")
    api.until(lambda: host.listeners)
    for number in range(1000):  # for 20 s, of which it reads nothing
        host.bridge.feed(msg("statustext", text=f"{number:050d}"))
        host.bridge.turn()
        loop.pass_time(0.02)
    data = loop.run(bytes_until(loop, client, f"{999:050d}".encode()))
    assert data.count(b"event: STATUSTEXT") < 300  # what fills the buffers on the way, and the newest
    assert b'"dropped": 0' in data[-400:]


def test_client_that_never_reads_holds_no_connection(
    flying: Any, api: Any, loop: Any, host: Any, unread: Any, msg: Any
) -> None:
    client = unread("/telemetry/stream?names=STATUSTEXT")
    api.until(lambda: host.listeners)
    pour(api, loop, msg, 3000)
    loop.pass_time(UNREAD + LINGER + 5.0)
    assert b"event: end" not in loop.run(all_bytes(loop, client))


def test_streams_beyond_a_callers_share_are_429_and_a_place_is_free_again(
    flying: Any, api: Any, loop: Any, unread: Any
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


def test_script_that_leaves_its_streams_open_keeps_no_page_of_its_machine_from_one(
    flying: Any, api: Any, unread: Any
) -> None:
    for _ in range(MOST_OPEN // 2 + 5):
        unread("/telemetry/stream?names=HEARTBEAT")
    api.until(lambda: api.service.streams.count == MOST_OPEN // 2)
    unread("/telemetry/stream?names=HEARTBEAT", **{"User-Agent": "Mozilla/5.0"})
    api.until(lambda: api.service.streams.count == MOST_OPEN // 2 + 1)


def test_no_few_callers_take_all_places() -> None:
    slots = SharedSlots(120, "streams are open")
    with contextlib.ExitStack() as taken:
        for who in ("first", "second", "third", "newcomer"):
            with pytest.raises(TooManyRequests, match=r"to this caller already"):
                while True:
                    taken.enter_context(slots.one_more_of(who))
        assert slots.count == 60 + 30 + 15 + 8
    assert (slots.count, slots._taken) == (0, {})


def test_places_that_are_all_taken_are_refused_to_anybody() -> None:
    slots = SharedSlots(3, "streams are open")
    with contextlib.ExitStack() as taken:
        for who in ("first", "second", "third"):
            taken.enter_context(slots.one_more_of(who))
        for who in ("first", "newcomer"):
            with pytest.raises(TooManyRequests, match=r"3 streams are open already"), slots.one_more_of(who):
                pass
