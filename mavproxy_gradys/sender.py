"""The delivery: one task for each sink, which sends the oldest readings until they are acknowledged."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import Any

from mavproxy_gradys.cadence import Backoff
from mavproxy_gradys.errors import NotDelivered, NotStored
from mavproxy_gradys.keeper import Keeper
from mavproxy_gradys.settings import Settings, masked
from mavproxy_gradys.sinks import Sink, make_sink
from mavproxy_gradys.tally import RoundTrips

BATCH = 200  # readings


class Sender:
    """Empties the spool into one sink; belongs to the asyncio thread.

    Attributes:
        url: the sink's.
        batches: how many were sent.
        sent: readings that went out, repeats included.
        acknowledged: readings that were acknowledged.
        last_error: why the newest failed batch failed; empty since the last success.

    Args:
        url: the sink's.
        keeper: the spool.
        clock: monotonic seconds.
        chance: numbers from 0 to 1.
    """

    def __init__(
        self, url: str, keeper: Keeper, clock: Callable[[], float], chance: Callable[[], float] = random.random
    ) -> None:
        self.url = url
        self.batches = self.sent = self.acknowledged = 0
        self.last_error = ""
        self.round_trips = RoundTrips()
        self._keeper = keeper
        self._clock = clock
        self._backoff = Backoff(chance)
        self._size = BATCH
        self._hurry = asyncio.Event()

    async def run(self, settings: Settings) -> None:
        """Send, until cancelled."""
        sink: Sink | None = None
        try:
            while True:
                try:
                    if sink is None:
                        sink = make_sink(self.url, settings)
                    await self._turn(sink)
                except (NotDelivered, NotStored) as error:
                    self.last_error = str(error)
                    if isinstance(error, NotDelivered) and error.too_large:
                        self._size = max(1, self._size // 2)
                    await self._pause()
        finally:
            if sink is not None:
                await sink.close()

    async def _turn(self, sink: Sink) -> None:
        """Send one batch.

        Raises:
            NotDelivered, NotStored: it came to nothing.
        """
        batch = await self._keeper.batch(self.url, self._size)
        self.batches += 1
        self.sent += len(batch)
        started = self._clock()
        taken = await sink.send(batch)
        self.round_trips.add(self._clock() - started)
        self.acknowledged += len(taken)
        await self._keeper.acknowledge(self.url, batch, taken)
        if not taken:
            raise NotDelivered("it acknowledges nothing", reached=True)
        self.last_error = ""
        self._backoff.succeeded()
        self._size = min(BATCH, self._size * 2)

    async def _pause(self) -> None:
        self._hurry.clear()
        pause = self._backoff.failed(self._clock())
        try:
            await asyncio.wait_for(self._hurry.wait(), pause)
        except asyncio.TimeoutError:
            return

    def flush(self) -> None:
        """End a pause after failures."""
        self._backoff.hurry()
        self._hurry.set()

    def report(self) -> dict[str, Any]:
        """What the status says."""
        now = self._clock()
        waits = self._backoff.waits(now)
        return {
            "sink": masked(self.url),
            "batches": self.batches,
            "sent": self.sent,
            "acknowledged": self.acknowledged,
            "last_error": self.last_error or None,
            "next_try_s": round(self._backoff.until - now, 1) if waits else None,
            "round_trip_ms": self.round_trips.summary(),
        }
