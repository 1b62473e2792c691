"""A subscription at a real broker, where strangers publish, and at scripted ones."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from mavproxy_gradys.net.mqtt_subscription import KEEP_ALIVE, PAUSE, MqttSubscription
from mavproxy_gradys.net.outage_log import Outage
from tests.support.fleet import Broker
from tests.support.virtual_time import FastLoop

at_a_broker = pytest.mark.needs("mosquitto")
TIMEOUT = 20.0  # s


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    made = Broker(tmp_path, max_packet_size="50000000")  # a stranger's, which is not set up as ours
    made.start()
    yield made
    made.stop()


def taken(broker: Broker, messages: list[bytes]) -> list[bytes]:
    """What the subscription passes on of these messages and a last one; its receiver fails at `poison`."""
    from paho.mqtt import publish

    came: list[bytes] = []

    def take(_topic: str, payload: object) -> None:
        assert isinstance(payload, bytes)
        came.append(payload)
        if payload == b"poison":
            raise OverflowError("int too large to convert to float")

    async def listen() -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda *_: None)  # the defect is reported; it ends nothing
        outage = Outage(logging.getLogger("test"), "down", "up")
        subscription = MqttSubscription((urlsplit(broker.url), broker.port), "fleet/#", outage, 5.0, "")
        listening = asyncio.ensure_future(subscription.run(take))
        deadline = time.monotonic() + TIMEOUT
        while not came and time.monotonic() < deadline:  # until it has subscribed
            await asyncio.to_thread(publish.single, "fleet/x", b"first", 1, port=broker.port)
            await asyncio.sleep(0.05)
        every = [("fleet/x", payload, 1, False) for payload in (*messages, b"last")]
        await asyncio.to_thread(publish.multiple, every, port=broker.port)
        while came[-1] != b"last" and time.monotonic() < deadline:  # noqa: ASYNC110  the broker tells nobody
            await asyncio.sleep(0.02)
        listening.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await listening

    asyncio.run(listen())
    return [payload for payload in came if payload != b"first"]


@at_a_broker
def test_no_message_ends_it(broker: Broker) -> None:
    assert taken(broker, [b"poison", b"good", b"poison"]) == [b"poison", b"good", b"poison", b"last"]


@at_a_broker
def test_a_packet_that_is_too_large_does_not_come(broker: Broker) -> None:
    assert taken(broker, [b"[]," * 2_000_000, b"good"]) == [b"good", b"last"]


class ScriptedBroker:
    """Answers each packet by a script; it is the transport, too.

    Attributes:
        written: what each connection has sent, a packet each.
        is_paused: whether the last connection does not read just now.
    """

    def __init__(self, answer: Callable[[int], bytes | None]) -> None:
        self._answer = answer
        self.written: list[list[bytes]] = []
        self.is_paused = self._is_closing = False
        self._protocol: Any = None

    async def create_connection(self, factory: Any, *_: Any, **__: Any) -> None:
        self.written.append([])
        self._is_closing, self._protocol = False, factory()
        self._protocol.connection_made(self)

    def write(self, packet: bytes) -> None:
        self.written[-1].append(packet)
        self.say(self._answer(packet[0] >> 4))

    def say(self, data: bytes | None) -> None:
        """The broker sends bytes; None ends the connection."""
        if data is None:
            asyncio.get_running_loop().call_soon(self._protocol.connection_lost, None)
        elif data:
            asyncio.get_running_loop().call_soon(self._protocol.data_received, data)

    def pause_reading(self) -> None:
        self.is_paused = True

    def resume_reading(self) -> None:
        self.is_paused = False

    def is_closing(self) -> bool:
        return self._is_closing

    def close(self) -> None:
        self._is_closing = True

    @property
    def kinds(self) -> list[list[int]]:
        """The kinds of the packets that each connection has sent."""
        return [[packet[0] >> 4 for packet in packets] for packets in self.written]


TAKEN = {1: b"\x20\x03\x00\x00\x00", 8: b"\x90\x04\x00\x01\x00\x00", 12: b"\xd0\x00", 14: b""}
HELLO = b"\x30\x06\x00\x01a\x00hi"


def subscribed(
    loop: FastLoop, monkeypatch: pytest.MonkeyPatch, answers: dict[int, bytes | None]
) -> tuple[ScriptedBroker, list[bytes], Any]:
    """A broker with these answers in the place of TAKEN's, what comes from it, and the subscription."""
    broker, came = ScriptedBroker(lambda kind: {**TAKEN, **answers}[kind]), list[bytes]()
    monkeypatch.setattr(loop, "create_connection", broker.create_connection)
    monkeypatch.setattr("mavproxy_gradys.net.mqtt_subscription.random.random", lambda: 0.0)
    outage = Outage(logging.getLogger("test"), "down", "up")
    subscription = MqttSubscription((urlsplit("mqtt://me:a%20b@127.0.0.1"), 1883), "fleet/#", outage, 5.0, "")
    return broker, came, loop.create_task(subscription.run(lambda _, payload: came.append(payload)))


@pytest.mark.parametrize(
    ("answers", "why"),
    [
        ({1: b"\x20\x03\x00\x86\x00"}, "it refuses the user name or the password"),
        ({1: b"\x20\x02\x00\x01"}, "it does not know MQTT 5"),
        ({1: b"\x20\x03\x00\x88\x00"}, "it refuses the connection (0x88)"),
        ({1: b"\x20\x00"}, "it speaks no MQTT 5: an answer is cut off"),
        ({1: b"HTTP/1.1" + 90 * b" "}, "it speaks no MQTT 5: a packet of kind 4"),
        ({1: None}, "it closed the connection"),
        ({1: b""}, "no answer"),
        ({8: b"\x90\x04\x00\x01\x00\x87"}, "it refuses the topic fleet/# (0x87)"),
        ({8: b""}, "no answer"),
        ({8: b"\xe0\x02\x8b\x00"}, "it ends the connection (0x8b)"),
    ],
)
def test_a_broker_that_does_not_take_it_is_told_once_and_tried_again(
    loop: FastLoop, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture,
    answers: dict[int, bytes | None], why: str
) -> None:  # fmt: skip
    broker, _, _ = subscribed(loop, monkeypatch, answers)
    loop.pass_time(60)
    assert len(broker.written) >= 4
    (record,) = caplog.records
    assert record.getMessage().startswith(f"down: {why}")


def test_a_broker_that_falls_silent_is_left_and_tried_again(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    silent: dict[int, bytes | None] = {12: b""}
    broker, _, _ = subscribed(loop, monkeypatch, silent)
    loop.pass_time(KEEP_ALIVE / 2 + 2)
    assert broker.kinds == [[1, 8, 12, 14], [1, 8, 12]]


def test_a_broker_without_messages_is_kept_by_pings(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    broker, _, _ = subscribed(loop, monkeypatch, {})
    loop.pass_time(10 * KEEP_ALIVE)
    (kinds,) = broker.kinds
    assert kinds[:2] == [1, 8] and len(kinds) == kinds.count(12) + 2 >= 20


def test_messages_are_read_a_few_times_a_second(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many come: each wake of the loop costs more than ten messages."""
    broker, came, _ = subscribed(loop, monkeypatch, {8: TAKEN[8] + HELLO})
    loop.pass_time(1)
    assert came == [b"hi"] and not broker.is_paused

    async def say() -> None:
        broker.say(HELLO + HELLO)

    loop.run(say())
    loop.pass_time(PAUSE / 2)
    assert came == [b"hi"] * 3 and broker.is_paused
    loop.pass_time(PAUSE)
    assert not broker.is_paused


def test_what_the_broker_has_retained_is_left_out(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    _, came, _ = subscribed(loop, monkeypatch, {8: TAKEN[8] + b"\x31" + HELLO[1:]})
    loop.pass_time(1)
    assert came == []


def test_the_end_says_goodbye(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    broker, _, listening = subscribed(loop, monkeypatch, {})
    loop.pass_time(1)
    listening.cancel()
    loop.pass_time(1)
    assert broker.kinds == [[1, 8, 12, 14]]
    assert broker.is_closing()
    assert b"\x00\x02me\x00\x03a b" in broker.written[0][0]
