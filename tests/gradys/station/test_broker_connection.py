"""The subscription of a worker at a real broker, where strangers publish."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavproxy_gradys.station.broker_connection import BrokerAddress, BrokerConnection
from mavproxy_gradys.station.inbox import Inbox
from tests.gradys.station.conftest import Run
from tests.support.fleet import Broker
from tests.support.processes import eventually

pytestmark = pytest.mark.needs("mosquitto")
TIMEOUT = 20.0  # s


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    made = Broker(tmp_path)
    made.start()
    yield made
    made.stop()


def test_a_message_that_wants_no_acknowledgement_gets_none(
    broker: Broker, run: Run, caplog: pytest.LogCaptureFixture
) -> None:
    """A broker ends the connection of who acknowledges it nevertheless."""
    from paho.mqtt import publish

    async def acknowledged() -> list[bytes]:
        inbox, came = Inbox(100, time.monotonic), []
        address = BrokerAddress(broker.url, "fleet/#", "group", "worker-1", 60, 10, "")
        connection = BrokerConnection(address, inbox)
        running = asyncio.ensure_future(connection.run())
        await asyncio.to_thread(eventually, lambda: connection.connected)
        for qos in (0, 1, 0, 1, 2):
            message = ("fleet/uav-1/alt", str(qos), qos)
            await asyncio.to_thread(publish.single, *message, port=broker.port)
            (taken,) = await asyncio.wait_for(inbox.batch(1, 0.0), TIMEOUT)
            came.append(taken.payload)
            connection.acknowledge([taken])
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return came

    assert run(acknowledged()) == [b"0", b"1", b"0", b"1", b"2"]
    assert "no messages from the broker" not in caplog.text
