"""Sinks of readings: the protocol of all sinks, and JSON over HTTP. `mqtt_sink.py` has MQTT."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Protocol

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.readings import Stored
from mavproxy_gradys.forwarding.sink_address import STATUS_COUNTS, SinkAddress
from mavproxy_gradys.net.http_client import JSON, Client, Poster
from mavproxy_gradys.settings import GradysSettings


class Sink(Protocol):
    """Takes batches of readings."""

    async def send(self, batch: Sequence[Stored]) -> set[int]:
        """Send a batch; returns the sequence numbers that were acknowledged.

        Raises:
            NotDelivered: none was acknowledged.
        """

    async def close(self) -> None:
        """Close the connections."""


def make_sink(address: SinkAddress, settings: GradysSettings) -> Sink:
    """The sink for an address.

    Raises:
        NotDelivered: MQTT's library is not installed, or the CA file was removed.
    """
    if address.url.startswith(("http://", "https://")):
        return HttpSink(address, Client(settings.timeout, settings.token, settings.ca_file))
    try:
        from mavproxy_gradys.forwarding.mqtt_sink import MqttSink  # noqa: PLC0415  an extra
    except ModuleNotFoundError as missing:
        raise NotDelivered(f"MQTT needs {missing.name}: pip install 'mavproxy-uavapi[mqtt]'") from missing
    return MqttSink(address.url, settings.timeout, settings.ca_file, address.station_confirms, settings.device)


class HttpSink:
    """POSTs `{"readings": [...]}`.

    Args:
        address: the receiver's address.
        client: the HTTP client, used for this sink only.
    """

    def __init__(self, address: SinkAddress, client: Poster) -> None:
        self._address = address
        self._client = client

    async def send(self, batch: Sequence[Stored]) -> set[int]:
        """See `Sink.send`; the answer's JSON names the acknowledged numbers."""
        body = json.dumps({"readings": [stored.body() for stored in batch]}, allow_nan=False).encode()
        answer = await self._client.post(self._address.url, body, JSON)
        return acknowledged(answer, {stored.seq for stored in batch}, self._address.status_counts)

    async def close(self) -> None:
        """Close the connection."""
        await self._client.close()


def acknowledged(answer: Any, sent: set[int], status_counts: bool = False) -> set[int]:
    """The sent numbers that a 200 answer acknowledges.

    Args:
        answer: its JSON; None if it has none.
        sent: the numbers of the batch.
        status_counts: whether an answer without numbers acknowledges all.

    Raises:
        NotDelivered: it names no numbers; a captive portal answers 200 too.
    """
    if not isinstance(answer, dict) or "acknowledged" not in answer:
        if status_counts:
            return sent
        why = f"it answers 200 but names no numbers (a login page?); #{STATUS_COUNTS} accepts any 200"
        raise NotDelivered(why, reached=True)
    numbers = answer["acknowledged"]
    if not isinstance(numbers, list) or not all(isinstance(n, int) and not isinstance(n, bool) for n in numbers):
        raise NotDelivered("its `acknowledged` is not a list of numbers", reached=True, for_content=True)
    return sent & set(numbers)
