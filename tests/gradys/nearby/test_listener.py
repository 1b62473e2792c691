"""The listener for the positions of others goes on when the broker or its certificates are not there."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from urllib.parse import SplitResult

import pytest

from mavproxy_gradys.nearby.listener import PositionListener
from mavproxy_gradys.net.mqtt_subscription import MqttSubscription
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.net.schedule import Backoff

ATTEMPTS = 3
LOG = logging.getLogger("gradys.nearby")


class EnoughError(Exception):
    """Ends the listener."""


def test_a_message_that_fails_by_a_defect_does_not_end_the_listening(monkeypatch: pytest.MonkeyPatch) -> None:
    async def disconnected(_client: Any) -> None: ...

    monkeypatch.setattr("mavproxy_gradys.net.mqtt_subscription.disconnect", disconnected)
    defects: list[Any] = []

    async def listen() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: defects.append(context["exception"]))
        messages = [SimpleNamespace(retain=False, topic="t", payload=payload) for payload in (b"1", b"2")]
        subscription = MqttSubscription((SplitResult("mqtt", "h", "", "", ""), 1), "t", Outage(LOG, "", ""), 1.0, "")
        await subscription._listen(cast(Any, Broker(messages)), take, Backoff(lambda: 0.0, 1.0))

    def take(_topic: str, payload: object) -> None:
        taken.append(payload)
        raise KeyError(payload)

    taken: list[object] = []
    asyncio.run(listen())
    assert taken == [b"1", b"2"]
    assert [type(defect) for defect in defects] == [KeyError, KeyError]


class Broker:
    """A client that has these messages, and then ends."""

    def __init__(self, messages: list[Any]) -> None:
        self._messages = messages

    async def __aenter__(self) -> None: ...

    async def subscribe(self, _topic: str, qos: int) -> None: ...

    @property
    async def messages(self) -> Any:
        for message in self._messages:
            yield message


def closed_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


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
    host: Any = SimpleNamespace(clock=time.monotonic)
    ca_file = str(tmp_path / "gone.pem") if scheme == "mqtts" else ""
    listener = PositionListener(host, f"{scheme}://127.0.0.1:{closed_port()}", 1.0, ca_file)
    with pytest.raises(EnoughError):
        asyncio.run(listener.run())
    said = [record.getMessage() for record in caplog.records if "no positions of others" in record.getMessage()]
    assert len(said) == 1
    assert ("gone.pem" in said[0]) == (scheme == "mqtts")
