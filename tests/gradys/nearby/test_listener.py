"""The listener goes on, whatever the broker, its certificates and the messages of others are like."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.nearby.listener import PositionListener
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

ATTEMPTS = 3
FRAME = LocalFrame((-35.0, 149.0))


class EnoughError(Exception):
    """Ends the listener."""


def closed_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


def host_of(separation: float, now: Callable[[], float]) -> Any:
    """A host with vehicle 1 in the air at the origin of FRAME; `said` has its warnings."""
    position = message_of("global_position_int", lat=-350000000, lon=1490000000)
    received = SimpleNamespace(message=position, at=now())
    state = SimpleNamespace(system=1, armed=True, landed=False, messages={"GLOBAL_POSITION_INT": received})
    said: list[str] = []
    return SimpleNamespace(
        clock=now,
        registry=SimpleNamespace(traffic=SimpleNamespace(separation=separation)),
        fleet=SimpleNamespace(vehicles={1: state}),
        warn=said.append,
        said=said,
    )


class Heard:
    """A listener to which messages are given; the clocks are the test's."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, separation: float = 8.0) -> None:
        self.now = 1000.0
        monkeypatch.setattr("mavproxy_gradys.nearby.listener.time", SimpleNamespace(time=self.wall), raising=False)
        self.host = host_of(separation, lambda: self.now)
        self._listener = PositionListener(self.host, "mqtt://127.0.0.1:1", 1.0, "")

    def wall(self) -> float:
        return 1_700_000_000.0 + self.now

    def say(self, payload: bytes) -> None:
        self._listener._take(payload)

    def position(self, east: float, age: float = 0.0, device: str = "uav-7", **members: Any) -> None:
        """A position 0 m north and `east` m east of ours, measured `age` s ago."""
        lat, lon = FRAME.degrees(Spot(0.0, east, 0.0))
        reading = {"device": device, "id": "7", "seq": 1, "quantity": "position", "value": [lat, lon, 30.0]}
        self.say(json.dumps({**reading, "time": self.wall() - age, **members}).encode())


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> Heard:
    return Heard(monkeypatch)


@pytest.mark.parametrize("scheme", ["mqtt", "mqtts"])
def test_no_broker_or_no_certificates_are_said_once_and_tried_again(
    scheme: str, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    attempts: list[float] = []

    def failed(_backoff: Any, now: float) -> float:
        attempts.append(now)
        if len(attempts) == ATTEMPTS:
            raise EnoughError
        return 0.0

    monkeypatch.setattr("mavproxy_gradys.net.mqtt_subscription.Backoff.failed", failed)
    host = host_of(8.0, time.monotonic)
    ca_file = str(tmp_path / "gone.pem") if scheme == "mqtts" else ""
    listener = PositionListener(host, f"{scheme}://127.0.0.1:{closed_port()}", 1.0, ca_file)
    with pytest.raises(EnoughError):
        asyncio.run(listener.run())
    said = [record.getMessage() for record in caplog.records if "no positions of others" in record.getMessage()]
    assert len(said) == 1
    assert ("gone.pem" in said[0]) == (scheme == "mqtts")


BAD_PLACES: list[Any] = [
    None, 3, [], [1], ["a", "b"], [91, 0], [0, 181], [10**400, 0], [0, -(10**400)], {"a": 1}, "ab", [True],
]  # fmt: skip


@pytest.mark.parametrize(
    "payload",
    [b"", b"\xff", b"{}", b"[]", b"null", b"[" * 50_000, b"9" * 5000]
    + [json.dumps({"device": "x", "seq": 1, "quantity": "position", "value": v, "time": 1_700_001_000.0}).encode()
       for v in BAD_PLACES]
    + [b'{"device": "x", "seq": 1, "quantity": "position", "time": 1700001000, "value": [NaN, 0]}',
       b'{"device": "x", "seq": 1, "quantity": "position", "time": 1700001000, "value": [Infinity, 0]}',
       b'{"device": "x", "seq": 1, "quantity": "position", "time": ' + b"9" * 400 + b', "value": [-35, 149]}'],
)  # fmt: skip
def test_no_message_ends_it(heard: Heard, payload: bytes) -> None:
    heard.say(payload)
    assert heard.host.said == []
    heard.position(5.0)
    assert len(heard.host.said) == 1


def test_a_pair_is_warned_of_once_until_it_is_apart_again(heard: Heard) -> None:
    for east in (30.0, 7.0, 6.0, 9.0, 7.5, 30.0, 30.0, 30.0, 6.0):
        heard.now += 1.0
        heard.host.fleet.vehicles[1].messages["GLOBAL_POSITION_INT"].at = heard.now
        heard.position(east)
    assert len(heard.host.said) == 2
    assert "uav-7 of another MAVProxy" in heard.host.said[0] and "of uav-1" in heard.host.said[0]


def test_what_was_measured_hours_ago_neither_warns_nor_hides_what_comes(heard: Heard) -> None:
    heard.position(5.0, age=7200.0)  # a backlog of a vehicle that has had no link
    assert heard.host.said == []
    heard.position(5.0)
    assert len(heard.host.said) == 1


def test_a_backlog_between_new_positions_makes_no_velocity(heard: Heard) -> None:
    """It comes nearer at 5 m/s; its old places, 500 m away, arrive in between."""
    for east in (70.0, 65.0, 60.0):
        heard.now += 1.0
        heard.position(east)
        heard.position(east + 10.0, age=2.0)
        heard.position(500.0, age=3600.0)
    assert heard.host.said == []
    heard.now += 5.0
    heard.host.fleet.vehicles[1].messages["GLOBAL_POSITION_INT"].at = heard.now
    heard.position(30.0, age=1.0)  # 5 s of 6 m/s, a second ago
    assert len(heard.host.said) == 1


def test_velocity_is_by_measurement_whatever_the_broker_delays(heard: Heard) -> None:
    heard.position(40.0, age=4.0)
    heard.position(36.0, age=0.0)  # both at once: 1 m/s, not more
    assert heard.host.said == []


def test_positions_by_a_wrong_clock_are_told(heard: Heard, caplog: pytest.LogCaptureFixture) -> None:
    for age in (100.0, 100.0, -100.0):
        heard.position(5.0, age=age)
    assert heard.host.said == []
    (record,) = caplog.records
    assert "old" in record.getMessage() and "uav-7" in record.getMessage()


def test_another_vehicle_with_a_name_of_ours_is_told(heard: Heard, caplog: pytest.LogCaptureFixture) -> None:
    """Two MAVProxys whose `device` nobody has set: the broker has our own positions by that name, too."""
    heard.position(0.0, device="uav-1")
    heard.position(3.0, age=2.0, device="uav-1")
    heard.position(500.0, age=60.0, device="uav-1")  # a backlog of ours
    assert caplog.records == []
    heard.position(200.0, device="uav-1")
    heard.position(210.0, device="uav-1")
    (record,) = caplog.records
    assert "`gradys set device`" in record.getMessage() and "200 m from ours" in record.getMessage()
    assert heard.host.said == []


def test_an_old_position_of_ours_warns_of_nothing(heard: Heard) -> None:
    heard.now += 60.0
    heard.position(5.0)
    assert heard.host.said == []


def test_a_flood_of_names_keeps_its_memory(heard: Heard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.nearby.advice.MOST", 50)
    flooded = Heard(monkeypatch)
    for number in range(1000):
        flooded.position(500.0, device=f"uav-{1000 + number}")
    assert len(flooded._listener._advice._others) <= 50
    flooded.position(5.0)
    assert len(flooded.host.said) == 1


def test_without_a_separation_it_does_not_even_listen(monkeypatch: pytest.MonkeyPatch, loop: FastLoop) -> None:
    runs: list[str] = []

    async def run(*_: Any) -> None:
        runs.append("begun")
        try:
            await asyncio.Event().wait()
        finally:
            runs.append("ended")

    monkeypatch.setattr("mavproxy_gradys.net.mqtt_subscription.MqttSubscription.run", run)
    host = host_of(0.0, loop.time)
    listening = loop.create_task(PositionListener(host, "mqtt://127.0.0.1:1", 1.0, "").run())
    loop.pass_time(10)
    assert runs == []
    host.registry.traffic.separation = 8.0
    loop.pass_time(2)
    assert runs == ["begun"]
    host.registry.traffic.separation = 0.0
    loop.pass_time(2)
    assert runs == ["begun", "ended"]
    listening.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        loop.run(listening)
