"""What a station asks of its store; `sqlite_store.py` and `postgres_store.py` are two."""

from __future__ import annotations

import math
from collections.abc import AsyncGenerator, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from mavproxy_gradys.station.newest import Newest
from mavproxy_gradys.station.reading_row import ReadingRow

CHUNK = 2000  # rows that are in memory at once


@dataclass(frozen=True)
class ReadingQuery:
    """Which readings.

    Attributes:
        device, quantity: of these alone; empty for all.
        after: with larger numbers than this, in the order of the numbers; -1 for all, by device and time.
        start, end: measured from then on, before then (s since 1970).
        limit: no more than so many.
    """

    device: str = ""
    quantity: str = ""
    after: int = -1
    start: float = -math.inf
    end: float = math.inf
    limit: int = 1000

    def conditions(self) -> list[tuple[str, str, Any]]:
        """Column, operator and operand of each condition."""
        asked = (
            ("device", "=", self.device, ""),
            ("quantity", "=", self.quantity, ""),
            ("seq", ">", self.after, -1),
            ("time", ">=", self.start, -math.inf),
            ("time", "<", self.end, math.inf),
        )
        return [(column, operator, operand) for column, operator, operand, default in asked if operand != default]

    @property
    def order(self) -> str:
        """The columns to sort by."""
        return "seq" if self.after >= 0 else "device, time, seq"


@dataclass(frozen=True)
class HistoryQuery:
    """Which history.

    Attributes:
        device, quantity: of what.
        element: which one, where the value is a list; None where it is a number.
        start, end: measured from then on, before then (s since 1970).
        buckets: of so many equal parts of that time.
    """

    device: str
    quantity: str
    element: int | None
    start: float
    end: float
    buckets: int

    @property
    def width(self) -> float:
        """s of one part."""
        return (self.end - self.start) / self.buckets


class Bucket(NamedTuple):
    """The readings of one part of a history.

    Attributes:
        first, last: when the first and the last one were measured, s since 1970.
        low, high: the smallest and the largest value.
        readings: how many.
        delay: s from sampling to row, the longest.
    """

    first: float
    last: float
    low: float
    high: float
    readings: int
    delay: float


class StoreCounts(NamedTuple):
    """What a store has counted, of all workers.

    Attributes:
        stored: readings that were kept.
        repeats: readings that came again.
    """

    stored: int
    repeats: int


class FleetNow(NamedTuple):
    """The newest readings.

    Attributes:
        now: the store's clock, s since 1970.
        newest: by device and quantity.
    """

    now: float
    newest: Sequence[Newest]


class Store(Protocol):
    """Keeps readings, once each.

    Every method raises NotStored while the database cannot be reached.
    """

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """Keep rows; how many were new. They are on the disk when it returns.

        Raises:
            ValueError: the database refuses what one holds; none is kept.
        """

    async def show(self, newest: Iterable[Newest]) -> None:
        """Have the fleet's table show these, which are not kept."""

    async def fleet(self) -> FleetNow:
        """The newest reading of each quantity of each device."""

    async def counts(self) -> StoreCounts:
        """How many readings there are."""

    def readings(self, query: ReadingQuery) -> AsyncGenerator[Sequence[tuple[Any, ...]], None]:
        """Readings as rows of COLUMNS, in chunks; times are s since 1970, the value is JSON."""

    async def history(self, query: HistoryQuery) -> list[Bucket]:
        """The parts of a history that have readings, in order of time."""

    async def close(self) -> None:
        """Close it."""
