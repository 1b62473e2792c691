"""Delivers readings: one task per sink sends the oldest readings until they are acknowledged."""

from __future__ import annotations

import asyncio
import logging
import random
from collections.abc import Callable
from typing import Any

from mavproxy_gradys.errors import NotDelivered, NotStored
from mavproxy_gradys.forwarding.readings import Stored
from mavproxy_gradys.forwarding.sink_address import SinkAddress
from mavproxy_gradys.forwarding.sinks import Sink, make_sink
from mavproxy_gradys.forwarding.spool_thread import SpoolThread
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.net.round_trips import RoundTrips
from mavproxy_gradys.net.schedule import LONGEST_OF_SINKS, Backoff
from mavproxy_gradys.settings import GradysSettings
from mavproxy_uavapi.core.timeout import wait_with_timeout

BATCH = 200  # readings
log = logging.getLogger("gradys.delivery")


class Sender:
    """Sends the spool's readings to one sink; belongs to the asyncio thread.

    Attributes:
        address: the sink's address.
        batches: number of sent batches.
        sent: number of sent readings, repeats included.
        acknowledged: number of acknowledged readings.
        put_last: number of readings that were refused in a batch of their own; they are sent when nothing else waits.
        last_error: why the newest failed batch failed; empty since the last success.

    Args:
        address: the sink's address.
        spool_thread: the spool.
        clock: monotonic seconds.
        chance: numbers from 0 to 1.
        tell: gets the sink and the count of readings that it has taken.
    """

    def __init__(
        self,
        address: SinkAddress,
        spool_thread: SpoolThread,
        clock: Callable[[], float],
        chance: Callable[[], float] = random.random,
        *,
        tell: Callable[[dict[str, Any]], None] = lambda info: None,
    ) -> None:
        self._tell = tell
        self.address = address
        self._name = address.name
        self.batches = self.sent = self.acknowledged = self.put_last = 0
        self.last_error = ""
        self.round_trips = RoundTrips()
        self.spool_thread = spool_thread
        self._clock = clock
        self._backoff = Backoff(chance, LONGEST_OF_SINKS)
        self._batch: list[Stored] = []  # the batch in flight, or the last one
        self._size = self._largest = BATCH
        self._outage = Outage(log, f"{address} takes no readings", f"{address} takes readings again")
        self._defects = Defects(f"the delivery to {address}")
        self._hurry = asyncio.Event()

    async def run(self, settings: GradysSettings) -> None:
        """Send, until cancelled."""
        sink: Sink | None = None
        try:
            while True:
                try:
                    if sink is None:
                        sink = make_sink(self.address, settings)
                    await self._turn(sink)
                    continue
                except NotStored as error:  # the spool logs it
                    self.last_error = str(error)
                except NotDelivered as error:
                    self._failed(error)
                except Exception as error:  # noqa: BLE001  a defect must not end the delivery for ever
                    self._defects.report(error)
                    self._failed(NotDelivered(f"{type(error).__name__}: {error}", for_content=True))
                await self._pause()
        finally:
            if sink is not None:
                await sink.close()

    async def _turn(self, sink: Sink) -> None:
        """Send one batch.

        Raises:
            NotDelivered, NotStored: it failed.
        """
        self._batch = []
        self._batch = batch = await self.spool_thread.batch(self._name, self._size)
        self.batches += 1
        self.sent += len(batch)
        started = self._clock()
        taken = await sink.send(batch)
        self.round_trips.add(self._clock() - started)
        self.acknowledged += len(taken)
        await self.spool_thread.acknowledge(self._name, batch, taken)
        if taken:
            self._tell({"sink": self._name, "count": len(taken)})
        if not taken:
            raise NotDelivered("it acknowledges nothing", reached=True, for_content=True)
        self.last_error = ""
        self._outage.update("")
        self._backoff.succeeded()
        self._size = min(self._largest, self._size * 2)

    def _failed(self, error: NotDelivered) -> None:
        """Find a refused reading by halving the batch; once it is alone, it is sent last."""
        self.last_error = str(error)
        self._outage.update(self.last_error)
        count = len(self._batch)
        if not error.for_content or not count:
            return
        if count == 1:
            self.spool_thread.put_last(self._name, self._batch[0])
            self.put_last += 1
            return
        self._size = count // 2
        self._backoff.succeeded()  # a smaller batch is a new attempt
        if error.too_large:
            self._largest = self._size

    async def _pause(self) -> None:
        self._hurry.clear()
        pause = self._backoff.failed(self._clock())
        try:
            await wait_with_timeout(pause, self._hurry.wait())
        except asyncio.TimeoutError:
            return

    def flush(self) -> None:
        """End a pause after failures."""
        self._backoff.hurry()
        self._hurry.set()

    def report(self) -> dict[str, Any]:
        """The report for the status."""
        now = self._clock()
        waits = self._backoff.waits(now)
        return {
            "sink": str(self.address),
            "batches": self.batches,
            "sent": self.sent,
            "acknowledged": self.acknowledged,
            "put_last": self.put_last,
            "last_error": self.last_error or None,
            "next_try_s": round(self._backoff.until - now, 1) if waits else None,
            "round_trip_ms": self.round_trips.summary(),
        }
