"""Where readings go: HTTP JSON here, MQTT in `mqtt.py`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Protocol

from mavproxy_gradys.client import JSON, Client, Poster
from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.readings import Stored
from mavproxy_gradys.settings import Settings


class Sink(Protocol):
    """Takes batches of readings."""

    async def send(self, batch: Sequence[Stored]) -> set[int]:
        """Send a batch; the sequence numbers that were acknowledged.

        Raises:
            NotDelivered: none was.
        """

    async def close(self) -> None:
        """Say good-bye."""


def make_sink(url: str, settings: Settings) -> Sink:
    """The sink for a URL.

    Raises:
        NotDelivered: MQTT without its library, or the CA file went away.
    """
    if url.startswith(("http://", "https://")):
        return HttpSink(url, Client(settings.timeout, settings.token, settings.ca_file))
    try:
        from mavproxy_gradys.mqtt import MqttSink  # noqa: PLC0415  an extra
    except ModuleNotFoundError as missing:
        raise NotDelivered(f"MQTT needs {missing.name}: pip install 'mavproxy-uavapi[mqtt]'") from missing
    return MqttSink(url, settings.timeout, settings.ca_file)


class HttpSink:
    """POSTs `{"readings": [...]}`.

    Args:
        url: of the receiver.
        client: made for it alone.
    """

    def __init__(self, url: str, client: Poster) -> None:
        self._url = url
        self._client = client

    async def send(self, batch: Sequence[Stored]) -> set[int]:
        """See `Sink.send`; a 200 that names no numbers acknowledges all."""
        body = json.dumps({"readings": [stored.body() for stored in batch]}, allow_nan=False).encode()
        answer = await self._client.post(self._url, body, JSON)
        return acknowledged(answer, {stored.seq for stored in batch})

    async def close(self) -> None:
        """Close the connection."""
        await self._client.close()


def acknowledged(answer: Any, sent: set[int]) -> set[int]:
    """The numbers, of those sent, that the answer to a 200 acknowledges.

    Raises:
        NotDelivered: what it names are no numbers.
    """
    if not isinstance(answer, dict) or "acknowledged" not in answer:
        return sent
    numbers = answer["acknowledged"]
    if not isinstance(numbers, list) or not all(isinstance(n, int) and not isinstance(n, bool) for n in numbers):
        raise NotDelivered("its `acknowledged` is not a list of numbers", reached=True, for_content=True)
    return sent & set(numbers)
