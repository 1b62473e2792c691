"""Stores readings in an SQLite file, for one station on one computer."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.transaction import Transaction
from mavproxy_gradys.station.newest import Newest, NewestReadings, newest_of
from mavproxy_gradys.station.reading_row import COLUMNS, NumberTaken, ReadingRow
from mavproxy_gradys.station.store import (
    LONGEST_READ,
    READERS,
    FleetNow,
    HistoryBucket,
    HistoryQuery,
    Page,
    ReadingQuery,
    StoreCounts,
)

T = TypeVar("T")
VERSION = 1  # PRAGMA user_version
STEPS = 10_000  # of SQLite's machine between two looks at the clock
TABLE = """
CREATE TABLE readings (
    device TEXT, time REAL, seq INTEGER, id TEXT, quantity TEXT, representation TEXT, value TEXT, received REAL,
    PRIMARY KEY (device, time, seq)) WITHOUT ROWID
"""
BY_NUMBER = "CREATE INDEX readings_by_number ON readings (seq)"
INSERT = f"INSERT OR IGNORE INTO readings ({', '.join(COLUMNS)}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"
KEPT = "SELECT id, quantity, representation, value FROM readings WHERE device = ? AND time = ? AND seq = ?"
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
log = logging.getLogger("station.store")


class SqliteStore:
    """See `Store`; one thread writes, a few others read, each with a read-only connection.

    Args:
        file: SQLite database.
        clock: s since 1970.

    Raises:
        NotStored: the file cannot be opened, or is of a newer version.
    """

    def __init__(self, file: Path | str, clock: Callable[[], float] = time.time) -> None:
        self._file = Path(file).absolute()
        self._clock = clock
        self._newest = NewestReadings()
        self._repeats = 0
        try:
            self._db = sqlite3.connect(self._file, isolation_level=None, check_same_thread=False)
            try:
                self._db.execute("PRAGMA journal_mode=WAL")
                self._db.execute("PRAGMA synchronous=FULL")
                migrate(self._db, self._file)
                self._newest.put(Newest(*row) for row in self._db.execute(NEWEST))
                # Counted once: it takes a look at the whole file, and no other process adds to it.
                (self._stored,) = self._db.execute("SELECT count(*) FROM readings").fetchone()
            except BaseException:
                self._db.close()
                raise
        except sqlite3.Error as error:
            raise NotStored(f"{file}: {error}") from error
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="station-store")
        self._readers = ThreadPoolExecutor(READERS, thread_name_prefix="station-reader")
        self._idle: SimpleQueue[sqlite3.Connection] = SimpleQueue()  # connections that no reader uses

    async def _do(self, thread: ThreadPoolExecutor, work: Callable[[], T]) -> T:
        """Call `work` in another thread.

        Raises:
            NotStored: the file cannot be used.
        """
        try:
            return await asyncio.get_running_loop().run_in_executor(thread, work)
        except sqlite3.Error as error:
            raise NotStored(f"{type(error).__name__}: {error}") from error

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """See `Store.add`; device, time and number identify a reading."""
        received = self._clock()
        new = await self._do(self._thread, lambda: self._insert(rows, received))
        self._stored += new
        self._repeats += len(rows) - new
        self._newest.put(newest_of(rows, received))
        return new

    def _insert(self, rows: Sequence[ReadingRow], received: float) -> int:
        cells = [(*row[:6], row.time, received) for row in rows]
        before = self._db.total_changes
        with Transaction(self._db):
            self._db.executemany(INSERT, cells)
            new = self._db.total_changes - before
            for device, seq, *cells_of_it in cells if new < len(cells) else ():
                kept = self._db.execute(KEPT, (device, cells_of_it[-2], seq)).fetchone()
                if kept != tuple(cells_of_it[:4]):
                    raise NumberTaken(device, seq)
        return new

    async def show(self, newest: Iterable[Newest]) -> None:
        """See `Store.show`."""
        self._newest.put(newest)

    async def fleet(self) -> FleetNow:
        """See `Store.fleet`."""
        return FleetNow(self._clock(), self._newest.all())

    async def counts(self) -> StoreCounts:
        """See `Store.counts`; repeats since the start."""
        return StoreCounts(self._stored, self._repeats)

    async def page(self, query: ReadingQuery, after: Any, limit: int) -> Page:
        """See `Store.page`."""
        conditions = query.conditions()
        where = [f"{column} {operator} ?" for column, operator, _ in conditions]
        operands = [operand for *_, operand in conditions]
        if after is not None:
            where.append(f"({query.order}) > (?, ?, ?)")
            operands += after
        select = f"SELECT {', '.join(COLUMNS)}, {query.order} FROM readings WHERE {' AND '.join(where) or 'TRUE'}"
        rows = await self._read(f"{select} ORDER BY {query.order} LIMIT ?", (*operands, limit))
        return Page([row[: len(COLUMNS)] for row in rows], rows[-1][len(COLUMNS) :] if rows else None)

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
        return [HistoryBucket(*row) for row in await self._read(HISTORY, parameters)]

    async def _read(self, select: str, parameters: Any) -> list[Any]:
        """The rows of a query; nobody who writes waits for it.

        Raises:
            NotStored: it fails, or takes too long.
        """
        return await self._do(self._readers, lambda: self._select(select, parameters))

    def _select(self, select: str, parameters: Any) -> list[Any]:
        try:
            connection = self._idle.get_nowait()
        except Empty:
            uri = f"{self._file.as_uri()}?mode=ro"
            connection = sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)
        deadline = time.monotonic() + LONGEST_READ
        connection.set_progress_handler(lambda: time.monotonic() > deadline, STEPS)
        try:
            return connection.execute(select, parameters).fetchall()
        except sqlite3.OperationalError as error:
            why = f"it takes longer than {LONGEST_READ:g} s" if time.monotonic() > deadline else str(error)
            raise NotStored(why) from error
        finally:
            self._idle.put(connection)

    async def close(self) -> None:
        """See `Store.close`."""
        await self._do(self._thread, self._db.close)
        self._thread.shutdown()
        self._readers.shutdown()
        while not self._idle.empty():
            self._idle.get_nowait().close()


def migrate(db: sqlite3.Connection, file: Path) -> None:
    """Create the table, or migrate that of an older station, in one transaction.

    In version 0 device and number identified a reading, so that a spool that was restored from a backup lost its
    readings here.

    Raises:
        NotStored: the file is of a newer version.
        sqlite3.Error: it cannot be migrated, for want of space for example; it is as before.
    """
    (version,) = db.execute("PRAGMA user_version").fetchone()
    if version == VERSION:
        return
    if version > VERSION:
        raise NotStored(f"{file} is of version {version}, which a newer station wrote: this one knows 0 to {VERSION}")
    (is_older,) = db.execute("SELECT count(*) FROM sqlite_master WHERE name = 'readings'").fetchone()
    with Transaction(db):
        if is_older:
            log.warning("%s is migrated to version %d; a large file takes a while", file, VERSION)
            db.execute("ALTER TABLE readings RENAME TO older")
        db.execute(TABLE)
        if is_older:
            columns = ", ".join(COLUMNS)
            db.execute(f"INSERT INTO readings ({columns}) SELECT {columns} FROM older")
            db.execute("DROP TABLE older")
        db.execute(BY_NUMBER)
        db.execute(f"PRAGMA user_version={VERSION}")
