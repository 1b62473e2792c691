"""A subscription at a real broker, where strangers publish."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from mavproxy_gradys.net.mqtt_subscription import MqttSubscription
from mavproxy_gradys.net.outage_log import Outage
from tests.support.fleet import Broker

pytest.importorskip("aiomqtt")
pytestmark = pytest.mark.needs("mosquitto")
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


def test_no_message_ends_it(broker: Broker) -> None:
    assert taken(broker, [b"poison", b"good", b"poison"]) == [b"poison", b"good", b"poison", b"last"]


def test_a_packet_that_is_too_large_does_not_come(broker: Broker) -> None:
    assert taken(broker, [b"[]," * 2_000_000, b"good"]) == [b"good", b"last"]
