"""The protocol of a station's store; `sqlite_store.py` and `postgres_store.py` implement it."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from mavproxy_gradys.station.newest import Newest
from mavproxy_gradys.station.reading_row import ReadingRow

CHUNK = 200  # rows in memory at once; each may have 48 kB
READERS = 3  # reads at once
LONGEST_READ = 10.0  # s of one read


@dataclass(frozen=True)
class ReadingQuery:
    """A selection of readings.

    Attributes:
        device, quantity: of these only; empty for all.
        after: with larger numbers than this, in order of the numbers; -1 for all, in order of device and time.
        start, end: measured at `start` or later and before `end` (s since 1970).
        limit: the largest number of readings.
    """

    device: str = ""
    quantity: str = ""
    after: int = -1
    start: float = -math.inf
    end: float = math.inf
    limit: int = 1000

    def conditions(self) -> list[tuple[str, str, Any]]:
        """Column, operator and operand of each condition."""
        filters = (
            ("device", "=", self.device, ""),
            ("quantity", "=", self.quantity, ""),
            ("seq", ">", self.after, -1),
            ("time", ">=", self.start, -math.inf),
            ("time", "<", self.end, math.inf),
        )
        return [(column, operator, operand) for column, operator, operand, default in filters if operand != default]

    @property
    def order(self) -> str:
        """The columns to sort by; together they are unique."""
        return "seq, device, time" if self.after >= 0 else "device, time, seq"


@dataclass(frozen=True)
class HistoryQuery:
    """A selection of a history.

    Attributes:
        device, quantity: of these.
        element: the index if the value is a list; None if it is a number.
        start, end: measured at `start` or later and before `end` (s since 1970).
        buckets: the number of equal parts of that time.
    """

    device: str
    quantity: str
    element: int | None
    start: float
    end: float
    buckets: int

    @property
    def width(self) -> float:
        """The duration of one part (s)."""
        return (self.end - self.start) / self.buckets


class HistoryBucket(NamedTuple):
    """The readings of one part of a history.

    Attributes:
        first, last: when the first and the last one were measured, s since 1970.
        low, high: the smallest and the largest value.
        readings: their number.
        delay: the longest time (s) from measurement to storage.
    """

    first: float
    last: float
    low: float
    high: float
    readings: int
    delay: float


class Page(NamedTuple):
    """Some readings of a selection, in its order.

    Attributes:
        rows: of COLUMNS; times are s since 1970, the value is JSON.
        end: where the next page begins; None without rows.
    """

    rows: Sequence[tuple[Any, ...]]
    end: Any


class StoreCounts(NamedTuple):
    """The counts of a store, of all workers.

    Attributes:
        stored: readings that were stored.
        repeats: readings that arrived again.
    """

    stored: int
    repeats: int


class FleetNow(NamedTuple):
    """The newest readings.

    Attributes:
        now: the store's clock, s since 1970.
        newest: the readings by device and quantity.
    """

    now: float
    newest: Sequence[Newest]


class Store(Protocol):
    """Stores each reading once.

    Every method raises NotStored while the database cannot be reached.
    """

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """Store rows; returns the number of new ones. They are on the disk when it returns.

        Raises:
            NumberTaken: device, time and number of one are those of another reading; none is stored.
            ValueError: the database refuses one; none is stored.
        """

    async def show(self, newest: Iterable[Newest]) -> None:
        """Show readings in the fleet's table without storing them."""

    async def fleet(self) -> FleetNow:
        """The newest reading of each quantity of each device."""

    async def counts(self) -> StoreCounts:
        """The counts of readings."""

    async def page(self, query: ReadingQuery, after: Any, limit: int) -> Page:
        """At most `limit` readings of a selection, after the end of the last page; None for the first one.

        Nothing is held between two pages: neither a transaction nor a lock.
        """

    async def history(self, query: HistoryQuery) -> list[HistoryBucket]:
        """The parts of a history with readings, in order of time."""

    async def close(self) -> None:
        """Close it."""


async def pages(store: Store, query: ReadingQuery) -> AsyncIterator[Sequence[tuple[Any, ...]]]:
    """The readings of a selection, page by page. What is stored meanwhile may be among them.

    Raises:
        NotStored: as `Store`.
    """
    after, rest = None, query.limit
    while rest > 0:
        page = await store.page(query, after, min(CHUNK, rest))
        if page.rows:
            yield page.rows
        if len(page.rows) < min(CHUNK, rest):
            return
        after, rest = page.end, rest - len(page.rows)
