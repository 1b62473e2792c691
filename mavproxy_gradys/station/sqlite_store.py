"""Stores readings in an SQLite file, for one station on one computer."""

from __future__ import annotations

import asyncio
import sqlite3
import time
from collections.abc import AsyncGenerator, Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.transaction import Transaction
from mavproxy_gradys.station.newest import Newest, NewestReadings, newest_of
from mavproxy_gradys.station.reading_row import COLUMNS, ReadingRow
from mavproxy_gradys.station.store import CHUNK, FleetNow, HistoryBucket, HistoryQuery, ReadingQuery, StoreCounts

T = TypeVar("T")
SCHEMA = """
CREATE TABLE IF NOT EXISTS readings (
    device TEXT, seq INTEGER, id TEXT, quantity TEXT, representation TEXT, value TEXT, time REAL, received REAL,
    PRIMARY KEY (device, seq)) WITHOUT ROWID
"""
NEWEST = """
SELECT device, id, quantity, representation, value, max(min(time, received)), received
FROM readings GROUP BY device, quantity
"""
HISTORY = """
SELECT min(time), max(time), min(number), max(number), count(*), max(received - time)
FROM (SELECT time, received, CASE WHEN json_type(value, :path) IN ('integer', 'real', 'true', 'false')
          THEN CAST(json_extract(value, :path) AS REAL) END AS number
      FROM readings WHERE device = :device AND quantity = :quantity AND time >= :start AND time < :end)
WHERE number IS NOT NULL GROUP BY CAST((time - :start) / :width AS INTEGER) ORDER BY 1
"""


class SqliteStore:
    """See `Store`; a thread of its own does all work on the file.

    Args:
        file: SQLite database; `:memory:` stores nothing on the disk.
        clock: s since 1970.

    Raises:
        NotStored: the file cannot be opened.
    """

    def __init__(self, file: Path | str, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._newest = NewestReadings()
        self._repeats = 0
        try:
            self._db = sqlite3.connect(file, isolation_level=None, check_same_thread=False)
            try:
                self._db.execute("PRAGMA journal_mode=WAL")
                self._db.execute("PRAGMA synchronous=FULL")
                self._db.execute(SCHEMA)
                self._newest.put(Newest(*row) for row in self._db.execute(NEWEST))
                # Counted once: it takes a look at the whole file, and no other process adds to it.
                (self._stored,) = self._db.execute("SELECT count(*) FROM readings").fetchone()
            except BaseException:
                self._db.close()
                raise
        except sqlite3.Error as error:
            raise NotStored(f"{file}: {error}") from error
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="station-store")

    async def _do(self, work: Callable[[], T]) -> T:
        """Call `work` in the other thread.

        Raises:
            NotStored: the file cannot be used.
        """
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, work)
        except sqlite3.Error as error:
            raise NotStored(f"{type(error).__name__}: {error}") from error

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """See `Store.add`; device and number identify a reading."""
        received = self._clock()
        new = await self._do(lambda: self._insert(rows, received))
        self._stored += new
        self._repeats += len(rows) - new
        self._newest.put(newest_of(rows, received))
        return new

    def _insert(self, rows: Sequence[ReadingRow], received: float) -> int:
        cells = [(*row[:6], row.time, received) for row in rows]
        before = self._db.total_changes
        with Transaction(self._db):
            self._db.executemany("INSERT OR IGNORE INTO readings VALUES (?, ?, ?, ?, ?, ?, ?, ?)", cells)
        return self._db.total_changes - before

    async def show(self, newest: Iterable[Newest]) -> None:
        """See `Store.show`."""
        self._newest.put(newest)

    async def fleet(self) -> FleetNow:
        """See `Store.fleet`."""
        return FleetNow(self._clock(), self._newest.all())

    async def counts(self) -> StoreCounts:
        """See `Store.counts`; repeats since the start."""
        return StoreCounts(self._stored, self._repeats)

    async def readings(self, query: ReadingQuery) -> AsyncGenerator[Sequence[tuple[Any, ...]], None]:
        """See `Store.readings`."""
        conditions = query.conditions()
        where = " AND ".join(f"{column} {operator} ?" for column, operator, _ in conditions) or "TRUE"
        select = f"SELECT {', '.join(COLUMNS)} FROM readings WHERE {where} ORDER BY {query.order} LIMIT ?"
        operands = [operand for *_, operand in conditions]
        cursor = await self._do(lambda: self._db.execute(select, (*operands, query.limit)))
        while rows := await self._do(lambda: cursor.fetchmany(CHUNK)):
            yield rows

    async def history(self, query: HistoryQuery) -> list[HistoryBucket]:
        """See `Store.history`."""
        parameters = {
            "device": query.device,
            "quantity": query.quantity,
            "path": "$" if query.element is None else f"$[{query.element:d}]",
            "start": query.start,
            "end": query.end,
            "width": query.width,
        }
        rows = await self._do(lambda: self._db.execute(HISTORY, parameters).fetchall())
        return [HistoryBucket(*row) for row in rows]

    async def close(self) -> None:
        """See `Store.close`."""
        await self._do(self._db.close)
        self._thread.shutdown()
