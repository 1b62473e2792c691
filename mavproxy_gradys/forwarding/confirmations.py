"""What a station says that it keeps, of what was published to a broker: the sink's option `#ack=station`.

A broker's PUBACK says that the broker has a reading, not that it will outlast the broker's death. So each reading
names a response topic (MQTT 5), on which the station says `{"acknowledged": [seq, …]}` after its commit.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Set

from mavproxy_uavapi.core.timeout import wait_with_timeout

MOST = 10_000  # numbers that are remembered; what is forgotten is sent again


class Confirmations:
    """The numbers of one connection's readings."""

    def __init__(self) -> None:
        self._awaited: set[int] = set()
        self._kept: set[int] = set()
        self._news = asyncio.Event()
        self._listening = False

    def begin(self) -> None:
        """Somebody listens to the station from now on."""
        self._listening = True

    def end(self) -> None:
        """Nobody listens any more: who waits need not."""
        self._listening = False
        self._news.set()

    def expect(self, numbers: Set[int]) -> None:
        """These are published now."""
        if len(self._awaited) + len(self._kept) > MOST:
            self._awaited.clear()
            self._kept.clear()
        self._awaited |= numbers

    def take(self, payload: object) -> None:
        """Hear what the station says; anything else is passed over."""
        try:
            numbers = json.loads(payload)["acknowledged"] if isinstance(payload, bytes | bytearray) else []
            said = {number for number in numbers if isinstance(number, int)}
        except (ValueError, KeyError, TypeError, RecursionError):
            return
        self._kept |= said & self._awaited
        self._awaited -= said
        self._news.set()

    def collect(self, numbers: Set[int]) -> set[int]:
        """Which of these the station has said that it keeps; it is asked once."""
        kept = self._kept & numbers
        self._kept -= kept
        return kept

    async def wait(self, numbers: Set[int], seconds: float) -> set[int]:
        """Which of these it keeps: when it has said so of all, or after that time, or when nobody listens."""
        deadline = asyncio.get_running_loop().time() + seconds
        while self._listening and not numbers <= self._kept:
            self._news.clear()
            try:
                await wait_with_timeout(deadline - asyncio.get_running_loop().time(), self._news.wait())
            except asyncio.TimeoutError:
                break
        return self.collect(numbers)
