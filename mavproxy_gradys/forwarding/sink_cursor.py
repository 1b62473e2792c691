"""What a sink has acknowledged and refused, beyond what the spool's file holds. Pure."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from mavproxy_gradys.forwarding.readings import Stored

MOST_LAST = 1000  # readings that are sent last; beyond that, all are sent in order again


class SinkCursor:
    """One sink's progress through the readings.

    Attributes:
        news: set when there may be new readings to send.
        after: the number up to which it has acknowledged all readings.
        unnoted: acknowledged numbers that could not be written to the disk.
        last: numbers that it refused in a batch of their own; they are sent when nothing else waits, in this order.
    """

    def __init__(self) -> None:
        self.news = asyncio.Event()
        self.forget()

    def forget(self) -> None:
        """Reset all numbers: a new file may begin with lower ones."""
        self.after = -1
        self.unnoted: set[int] = set()
        self.last: dict[int, None] = {}

    @property
    def most_skipped(self) -> int:
        """The largest number of readings that `choose` may skip."""
        return len(self.unnoted) + len(self.last)

    def choose(self, candidates: Sequence[Stored], limit: int) -> list[Stored]:
        """The readings to send, of those that the file has for the sink: at most `limit`, or one of the last ones."""
        unsent = {stored.seq: stored for stored in candidates if stored.seq not in self.unnoted}
        first = [stored for seq, stored in unsent.items() if seq not in self.last]
        return first[:limit] or [unsent[seq] for seq in self.last if seq in unsent][:1]

    def put_last(self, seq: int) -> None:
        """Send that reading when nothing else waits, after all that were put last before."""
        if len(self.last) >= MOST_LAST:
            self.last.clear()
        self.last.pop(seq, None)
        self.last[seq] = None

    def take(self, batch: Sequence[Stored], taken: set[int]) -> None:
        """Note that the readings `taken` of a batch were acknowledged."""
        for seq in taken:
            self.last.pop(seq, None)
        if len(taken) == len(batch):
            self.after = min([batch[-1].seq, *(seq - 1 for seq in self.last)])
