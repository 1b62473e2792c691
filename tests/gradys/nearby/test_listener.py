"""The listener for the positions of others goes on when the broker or its certificates are not there."""

from __future__ import annotations

import asyncio
import socket
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.nearby.listener import PositionListener

ATTEMPTS = 3


class EnoughError(Exception):
    """Ends the listener."""


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
