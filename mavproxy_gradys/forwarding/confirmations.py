"""A station's confirmations of readings that were published to a broker: the sink's option `#ack=station`.

A broker's PUBACK means that the broker has a reading, but a crash of the broker may lose it. So each reading names a
response topic (MQTT 5); after its commit the station publishes `{"acknowledged": [seq, …]}` there.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Set

from mavproxy_uavapi.core.timeout import wait_with_timeout

QUIET = 2.0  # s without a confirmation, after the first ones: what has none by then is refused, or lost
LARGEST = 64 * 1024  # bytes of a packet with confirmations: whoever reads the topic may publish to it
MOST = 10_000  # numbers that are kept; beyond it all are dropped, and their readings are sent again


class Confirmations:
    """The confirmations of one connection's readings."""

    def __init__(self) -> None:
        self._awaited: set[int] = set()
        self._confirmed: set[int] = set()
        self._news = asyncio.Event()
        self._listening = False

    def begin(self) -> None:
        """The subscription to the response topic exists from now on."""
        self._listening = True

    def end(self) -> None:
        """The subscription has ended, so waiting is useless."""
        self._listening = False
        self._news.set()

    def expect(self, numbers: Set[int]) -> bool:
        """Note the numbers of readings that are published now; whether one of them was not before."""
        if len(self._awaited) + len(self._confirmed) > MOST:
            self._awaited.clear()
            self._confirmed.clear()
        are_new = not numbers <= self._awaited
        self._awaited |= numbers
        return are_new

    def take(self, payload: object) -> None:
        """Process a message of the station; an invalid or too large one is ignored."""
        if not isinstance(payload, bytes | bytearray) or len(payload) > LARGEST:
            return
        try:
            numbers = json.loads(payload)["acknowledged"]
            acknowledged = {number for number in numbers if isinstance(number, int)}
        except (ValueError, KeyError, TypeError, RecursionError):
            return
        self._confirmed |= acknowledged & self._awaited
        self._awaited -= acknowledged
        self._news.set()

    def collect(self, numbers: Set[int]) -> set[int]:
        """Take out and return those of these numbers that the station has confirmed."""
        confirmed = self._confirmed & numbers
        self._confirmed -= confirmed
        return confirmed

    async def wait(self, numbers: Set[int], seconds: float) -> set[int]:
        """Wait until all are confirmed, the time is over or the subscription has ended; the confirmed numbers.

        After the first ones it waits for the others only while more come within QUIET.
        """
        loop = asyncio.get_running_loop()
        deadline = loop.time() + seconds
        while self._listening and not numbers <= self._confirmed:
            remaining = deadline - loop.time()
            self._news.clear()
            try:
                await wait_with_timeout(
                    remaining if numbers.isdisjoint(self._confirmed) else min(remaining, QUIET), self._news.wait()
                )
            except asyncio.TimeoutError:
                break
        return self.collect(numbers)
