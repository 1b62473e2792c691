"""A TCP link whose other end goes, and comes back, with real sockets on the loopback."""

from __future__ import annotations

import contextlib
import select
import socket
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.mainloop import link_keeper
from mavproxy_uavapi.core.mainloop.link_keeper import ATTEMPT_TIMEOUT, PAUSE, LinkKeeper
from tests.support.clock import Clock

LOOPBACK = "127.0.0.1"


class Vehicle:
    """The other end, which listens on one port whenever it runs."""

    def __init__(self) -> None:
        self.port = 0
        self.start()

    def start(self) -> None:
        self._listening = socket.create_server((LOOPBACK, self.port))
        self.port = self._listening.getsockname()[1]
        self._listening.settimeout(5)

    def accept(self) -> None:
        self.connection, _ = self._listening.accept()

    def crash(self) -> None:
        self.connection.close()
        self._listening.close()


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    made = Vehicle()
    yield made
    made.crash()


@pytest.fixture
def link(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """MAVProxy's link to the vehicle; it must not sleep."""
    made = mavutil.mavtcp(f"{LOOPBACK}:{vehicle.port}", autoreconnect=True, retries=3)
    vehicle.accept()
    monkeypatch.setattr(mavutil.time, "sleep", lambda _: pytest.fail("the main loop sleeps"))
    yield made
    if made.port is not None:
        made.close()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def keeper(clock: Clock, link: Any) -> LinkKeeper:
    made = LinkKeeper(clock)
    made.turn([link])
    return made


def crash(vehicle: Vehicle, link: Any) -> None:
    """End the vehicle, and let MAVProxy notice it."""
    vehicle.crash()
    select.select([link.port], [], [], 5)
    with contextlib.suppress(ConnectionResetError):
        link.recv(1)


def test_link_without_other_end_is_left_out_of_the_select(vehicle: Vehicle, link: Any, keeper: LinkKeeper) -> None:
    crash(vehicle, link)
    keeper.turn([link])
    assert (link.port, link.portdead, link.fd) == (None, True, -1)
    link.write(b"a heartbeat")
    assert link.port is None


def test_link_works_again_when_the_vehicle_is_back(
    vehicle: Vehicle, link: Any, keeper: LinkKeeper, clock: Clock
) -> None:
    crash(vehicle, link)
    keeper.turn([link])
    vehicle.start()
    keeper.turn([link])
    assert link.port is None  # it was lost a moment ago
    clock.now += PAUSE
    keeper.turn([link])
    vehicle.accept()
    keeper.turn([link])
    assert (link.portdead, link.fd) == (False, link.port.fileno())
    vehicle.connection.sendall(b"telemetry")
    select.select([link.fd], [], [], 5)
    assert link.recv(100) == b"telemetry"
    link.write(b"command")
    assert vehicle.connection.recv(100) == b"command"


def test_second_crash_is_like_the_first(vehicle: Vehicle, link: Any, keeper: LinkKeeper, clock: Clock) -> None:
    for _ in range(2):
        crash(vehicle, link)
        assert link.portdead
        vehicle.start()
        clock.now += PAUSE
        keeper.turn([link])
        vehicle.accept()
        keeper.turn([link])
        assert not link.portdead


def test_attempt_without_an_answer_is_given_up(
    vehicle: Vehicle, link: Any, keeper: LinkKeeper, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    crash(vehicle, link)
    nobody = SimpleNamespace(select=lambda *_: ([], [], []))  # a computer that is switched off
    monkeypatch.setattr(link_keeper, "select", nobody)
    vehicle.start()
    clock.now += PAUSE
    keeper.turn([link])
    clock.now += ATTEMPT_TIMEOUT
    keeper.turn([link])
    assert link.port is None
    monkeypatch.undo()
    clock.now += PAUSE
    keeper.turn([link])
    assert link.port is not None


def test_link_without_other_end_is_taken_over_at_a_reload(
    vehicle: Vehicle, link: Any, keeper: LinkKeeper, clock: Clock
) -> None:
    crash(vehicle, link)
    keeper.release()
    keeper = LinkKeeper(clock)
    keeper.turn([link])
    assert link.portdead
    vehicle.start()
    clock.now += PAUSE
    keeper.turn([link])
    assert not link.portdead


def test_released_link_is_pymavlinks_again(link: Any, keeper: LinkKeeper) -> None:
    assert link.reconnect != mavutil.mavtcp.reconnect.__get__(link)
    keeper.release()
    assert link.reconnect == mavutil.mavtcp.reconnect.__get__(link)


def test_removed_link_is_given_back(link: Any, keeper: LinkKeeper) -> None:
    keeper.turn([])
    assert link.reconnect == mavutil.mavtcp.reconnect.__get__(link)


def test_other_kinds_of_links_are_left_alone(clock: Clock) -> None:
    serial = SimpleNamespace(port=None, portdead=False, fd=7)
    LinkKeeper(clock).turn([serial])
    assert vars(serial) == {"port": None, "portdead": False, "fd": 7}


def test_socket_that_is_connected_to_itself_is_no_link() -> None:
    with socket.socket() as alone:
        alone.bind((LOOPBACK, 0))
        alone.connect(alone.getsockname())
        assert not link_keeper.is_connected(alone)


@pytest.mark.parametrize("fails", ["getaddrinfo", "socket"])
def test_attempt_that_cannot_begin_is_made_again_after_a_pause(
    fails: str, vehicle: Vehicle, link: Any, keeper: LinkKeeper, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name that cannot be looked up, or no free descriptor."""
    tries: list[float] = []

    class Failing(socket.socket):
        def __init__(self, *args: Any) -> None:
            tries.append(clock())
            if fails == "socket":
                raise OSError(24, "Too many open files")
            super().__init__(*args)

        def connect_ex(self, address: Any) -> int:
            raise socket.gaierror(-2, "Name or service not known")

    crash(vehicle, link)
    monkeypatch.setattr(link_keeper.socket, "socket", Failing)
    for _ in range(30):
        keeper.turn([link])
        clock.now += 0.1
    assert len(tries) == 2
    monkeypatch.undo()
    vehicle.start()
    clock.now += PAUSE
    for _ in range(50):
        keeper.turn([link])
        select.select([], [], [], 0.01)
    assert link.port is not None
