from __future__ import annotations

import asyncio
import ipaddress
import os
import resource
import socket
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.core.streaming import MOST_OPEN
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server import listener
from mavproxy_uavapi.http.server.listener import KEPT_FREE, RESERVE, SHARE, NoRoom, highest_descriptor, to_replace
from tests.support.api_port import OWNER, Port
from tests.support.drone import Drone

MOST = 200


def connection(group: str = "127.0.0.1", **changed: Any) -> Any:
    """A connection that has asked for nothing yet."""
    state = dict.fromkeys(("silent", "admitted", "refused", "answering", "closing"), False)
    return SimpleNamespace(group=group, **{**state, "idle_since": 0.0, **changed})


def busy(group: str = "127.0.0.1") -> Any:
    return connection(group, admitted=True, answering=True)


def test_there_is_room_up_to_the_reserve() -> None:
    connections = [connection() for _ in range(MOST - RESERVE - 1)]
    assert to_replace(connections, "127.0.0.1", True, MOST) is None
    connections.append(connection())
    assert to_replace(connections, "127.0.0.1", True, MOST) is connections[0]


def test_reserve_is_for_those_who_have_passed_the_door() -> None:
    connections = [connection() for _ in range(MOST - RESERVE - 1)] + [busy() for _ in range(RESERVE)]
    assert to_replace(connections, "127.0.0.1", True, MOST) is None
    assert to_replace([*connections, busy()], "127.0.0.1", True, MOST) is connections[0]


def test_silent_connection_goes_before_an_older_one_that_was_refused() -> None:
    connections = [connection(refused=True, answering=True) for _ in range(MOST)]
    connections[7] = connection(silent=True)
    assert to_replace(connections, "127.0.0.1", True, MOST) is connections[7]


def test_connection_that_ends_already_takes_no_room() -> None:
    connections = [connection(closing=True) for _ in range(MOST)]
    assert to_replace(connections, "127.0.0.1", True, MOST) is None


def test_longest_idle_caller_goes_and_a_call_in_flight_never() -> None:
    connections = [busy() for _ in range(MOST)]
    connections[5] = connection(admitted=True, idle_since=20.0)
    connections[9] = connection(admitted=True, idle_since=10.0)
    assert to_replace(connections, "127.0.0.1", True, MOST) is connections[9]
    with pytest.raises(NoRoom) as caught:
        to_replace([busy() for _ in range(MOST)], "127.0.0.1", True, MOST)
    assert caught.value.cause == "full"


def test_address_has_a_share_unless_it_is_the_loopback() -> None:
    connections = [connection("10.0.0.5") for _ in range(SHARE)]
    assert to_replace(connections, "10.0.0.6", False, MOST) is None
    assert to_replace(connections, "10.0.0.5", False, MOST) is connections[0]
    assert to_replace([connection() for _ in range(SHARE)], "127.0.0.1", True, MOST) is None
    with pytest.raises(NoRoom) as caught:
        to_replace([busy("10.0.0.5") for _ in range(SHARE)], "10.0.0.5", False, MOST)
    assert caught.value.cause == "share"


def test_scarce_descriptors_are_taken_from_a_stranger_or_not_at_all() -> None:
    connections = [busy(), connection(), connection()]
    assert to_replace(connections, "127.0.0.1", True, MOST, scarce=True) is connections[1]
    with pytest.raises(NoRoom) as caught:
        to_replace([busy()], "127.0.0.1", True, MOST, scarce=True)
    assert caught.value.cause == "descriptors"


@pytest.mark.parametrize(
    ("soft", "highest"),
    [
        (1024, 1023 - KEPT_FREE),
        (65536, 1023 - KEPT_FREE),
        (resource.RLIM_INFINITY, 1023 - KEPT_FREE),
        (256, 255 - KEPT_FREE),
        (64, 47),
    ],
)
def test_descriptors_are_left_below_the_limits_of_process_and_select(
    monkeypatch: pytest.MonkeyPatch, soft: int, highest: int
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (soft, soft))
    assert highest_descriptor() == highest


def test_socket_moves_to_a_lower_descriptor_where_one_is_free() -> None:
    hole, first = socket.socket(), socket.socket()
    number = hole.fileno()
    hole.close()
    moved = listener.lowest(first)
    assert moved.fileno() == min(number, first.fileno() if first.fileno() >= 0 else number)
    assert listener.lowest(moved) is moved
    moved.close()


@pytest.mark.skipif(not hasattr(socket, "TCP_USER_TIMEOUT"), reason="Linux only")
def test_kernel_gives_up_a_peer_that_reads_nothing() -> None:
    with listener.listening_socket("127.0.0.1", 0) as listening:
        listening.listen()
        with socket.create_connection(listening.getsockname()):
            near, _ = listening.accept()
            with near:
                assert near.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == listener.UNREAD_TIMEOUT


# -- strangers at a real port -------------------------------------------------------------------------------


def test_1100_idle_connections_leave_the_owner_in_and_the_cap_as_it_is(
    drone: Drone, port: Port, idle_strangers: Callable[[int], list[socket.socket]]
) -> None:
    async def act() -> tuple[int, int]:
        for _ in range(11):
            idle_strangers(100)
            await port.settled()
        answer = await port.ask("GET", "/telemetry/gps", OWNER)
        return answer.status, len(port.server.filenos()) - 1

    status, connections = port.run(act)
    assert status == 200
    assert connections <= MOST


def test_strangers_leave_a_reserve_to_those_who_pass_the_door(drone: Drone, port: Port) -> None:
    async def act() -> tuple[list[int], int]:
        strangers = [await port.connect() for _ in range(MOST)]
        await port.settled()
        owners = [await port.connect() for _ in range(RESERVE)]
        statuses = [(await owner.ask("GET", "/telemetry/gps", OWNER)).status for owner in owners]
        again = [(await owner.ask("GET", "/telemetry/gps", OWNER)).status for owner in owners]
        assert sum(not stranger.reader.at_eof() for stranger in strangers) >= MOST - 2 * RESERVE
        return [*statuses, *again], len(port.server.filenos()) - 1

    statuses, connections = port.run(act)
    assert set(statuses) == {200}
    assert connections <= MOST


def test_descriptors_are_left_and_the_log_has_a_line_no_tracebacks(
    drone: Drone, port: Port, idle_strangers: Callable[[int], list[socket.socket]], caplog: pytest.LogCaptureFixture
) -> None:
    async def act() -> tuple[int, int]:
        owner = await port.connect()
        await owner.ask("GET", "/telemetry/gps", OWNER)
        idle_strangers(180)
        limit = 128 + sum(int(fd) < 2000 for fd in os.listdir("/proc/self/fd"))
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
        await port.settled()
        spare = [os.dup(0) for _ in range(20)]  # as MAVProxy does to connect again
        for fd in spare:
            os.close(fd)
        return max(spare), (await owner.ask("GET", "/telemetry/gps", OWNER)).status

    highest, status = port.run(act)
    assert highest < 1024 and status == 200
    assert [record for record in caplog.records if record.exc_info] == []
    assert len(caplog.records) <= 5


def test_streams_of_one_address_leave_most_to_others(
    drone: Drone, port: Port, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stream takes a connection, so that the share of connections is one of streams too."""
    far = "127.0.0.2"  # stands for another computer
    addresses = {far: ipaddress.ip_address("10.0.0.5")}
    monkeypatch.setattr(listener, "address_of", lambda remote: addresses.get(remote, ipaddress.ip_address(remote)))
    upgrade = ("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13")
    left = MOST_OPEN // 2 - SHARE  # the limit of streams takes both for this machine
    kinds = (OWNER,), (OWNER, *upgrade, "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==")

    async def status_of_stream(source: str, *headers: str) -> int | None:
        wire = await port.connect(source)
        wire.send("GET", "/telemetry/stream", *headers)
        try:
            return int((await wire.reader.readuntil(b"\r\n")).split()[1])
        except (asyncio.IncompleteReadError, ConnectionError):
            return None

    async def act() -> tuple[list[int | None], list[int | None], int]:
        theirs = [await status_of_stream(far, *kinds[number % 2]) for number in range(2 * SHARE)]
        ours = [await status_of_stream("127.0.0.1", *kinds[number % 2]) for number in range(left + 1)]
        return theirs, ours, service.streams.count

    theirs, ours, count = port.run(act)
    assert theirs == [200, 101] * (SHARE // 2) + [None] * SHARE
    assert ours == [200, 101] * (left // 2) + [429]
    assert count == MOST_OPEN // 2
