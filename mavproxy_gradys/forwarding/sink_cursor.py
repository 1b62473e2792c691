"""How far a sink has acknowledged the readings, as far as the spool's file does not say it. Pure."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from mavproxy_gradys.forwarding.readings import Stored

MOST_LAST = 1000  # readings that are sent last; when there are more, all get their turn again


class SinkCursor:
    """One sink's place among the readings.

    Attributes:
        news: set when there may be something new to send.
        after: the number up to which it has acknowledged all.
        unnoted: numbers that it has acknowledged, and the disk did not take.
        last: numbers that it refused by themselves: they are sent when there is nothing else, in this order.
    """

    def __init__(self) -> None:
        self.news = asyncio.Event()
        self.forget()

    def forget(self) -> None:
        """Forget all numbers: a new file may begin with lower ones."""
        self.after = -1
        self.unnoted: set[int] = set()
        self.last: dict[int, None] = {}

    @property
    def passed_over(self) -> int:
        """How many readings `choose` may pass over."""
        return len(self.unnoted) + len(self.last)

    def choose(self, found: Sequence[Stored], limit: int) -> list[Stored]:
        """What to send of those that the file has for it: at most `limit`, or one of the last ones."""
        unsent = {stored.seq: stored for stored in found if stored.seq not in self.unnoted}
        first = [stored for seq, stored in unsent.items() if seq not in self.last]
        return first[:limit] or [unsent[seq] for seq in self.last if seq in unsent][:1]

    def put_last(self, seq: int) -> None:
        """Send that one when there is nothing else, and after all that were put last before."""
        if len(self.last) >= MOST_LAST:
            self.last.clear()
        self.last.pop(seq, None)
        self.last[seq] = None

    def take(self, batch: Sequence[Stored], taken: set[int]) -> None:
        """Note that of a batch these were acknowledged."""
        for seq in taken:
            self.last.pop(seq, None)
        if len(taken) == len(batch):
            self.after = min([batch[-1].seq, *(seq - 1 for seq in self.last)])
