"""The spool: readings in an SQLite file until every sink has acknowledged them.

Calls block; one thread uses it at a time (`spool_thread.py` has a thread for it). When a call returns, its
transaction is on the disk (WAL, synchronous=FULL): neither `kill -9` nor a power failure loses stored readings.

A sequence number is used once, even if the file is lost, or is that of yesterday: restored from a backup, or by a
root folder that each start of the machine resets. Nothing in a file tells whether it was restored. So whoever opens
one goes on at the milliseconds since 1970, or above the file's own numbers if those are higher, and from there by up
to SPREAD at random, in case the clock was reset as well.
"""

from __future__ import annotations

import os
import random
import sqlite3
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.readings import Reading, Stored
from mavproxy_gradys.forwarding.spool_file import first_number, opened
from mavproxy_gradys.forwarding.spool_rows import COLUMNS, row_of, size_of, stored_of
from mavproxy_gradys.forwarding.transaction import Transaction

DROPPED_AT_ONCE = 500  # rows
DAMAGED_KEPT = 1000  # rows
CAUSES = ("size", "age", "damage")
SPREAD = 2**28  # numbers; in milliseconds three days


def uptime() -> float:
    """Seconds since this machine was started, sleep included; setting the clock does not change it."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def boot_id() -> str:
    """The id of the machine's start from which `uptime` counts."""
    return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()


class Spool:
    """Readings on the disk.

    Ages are by the machine's uptime, so that setting the clock does not make all readings old. After a restart of the
    machine the age of older readings begins at 0 with the first `trim`.

    Attributes:
        count, size: number of readings, and their bytes.
        dropped: number of dropped readings by cause (`size`, `age`, `damage`), over the file's whole life.
        damaged: numbers of unreadable rows, which `trim` moves to a table of their own.
        set_aside: the corrupt file that this one replaced; None without one.

    Args:
        path: the file; created if necessary.
        largest: bytes of readings beyond which the oldest are dropped.
        longest: age (s) after which a reading is dropped.
        clock: uptime (s).
        boot: the id of the machine's start from which `clock` counts.
        wall: s since 1970.

    Raises:
        NotStored: the file cannot be opened: no space, no permission, or another MAVProxy or program uses it.
    """

    def __init__(
        self,
        path: Path,
        largest: float,
        longest: float,
        *,
        clock: Callable[[], float] = uptime,
        boot: str | None = None,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.path = Path(os.path.realpath(path))
        self.largest = largest
        self.longest = longest
        self.sinks: list[str] = []
        self.damaged: set[int] = set()
        self._clock = clock
        self._boot = boot_id() if boot is None else boot
        self._wall = wall
        self._adopted = False  # whether all ages are by this start of the machine: a full disk is read without
        self._numbered = False  # whether our numbers are apart from those that others may have given
        try:
            self._db, self.set_aside = opened(self.path, wall())
        except (sqlite3.Error, OSError) as error:
            raise NotStored(f"{path}: {error}{_hint(error)}") from error
        try:
            self._update_counts()
        except BaseException as error:
            self._db.close()
            if isinstance(error, sqlite3.Error):
                raise NotStored(f"{path}: {error}") from error
            raise

    def _adopt(self) -> None:
        """Restart the age of readings from before a restart of the machine."""
        with self._transaction():
            now = self._clock()
            self._db.execute(
                "UPDATE readings SET boot = ?, uptime = ? WHERE boot != ?", (self._boot, now, self._boot)
            )
        self._adopted = True

    def _update_counts(self) -> None:
        self.count, self.size = self._db.execute(
            "SELECT count(*), coalesce(sum(CAST(size AS INTEGER)), 0) FROM readings"
        ).fetchone()
        counts = self._db.execute("SELECT cause, CAST(count AS INTEGER) FROM dropped").fetchall()
        self.dropped = {cause: count for cause, count in counts if cause in CAUSES}

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def _transaction(self) -> Transaction:
        return Transaction(self._db)

    # -- in -----------------------------------------------------------------------------------------------

    def append(self, readings: Sequence[Reading]) -> list[int]:
        """Store readings; returns their sequence numbers.

        Raises:
            sqlite3.Error: nothing was stored.
        """
        now, numbers, added = self._clock(), [], 0
        with self._transaction():
            if not self._numbered:
                self._db.execute(
                    "UPDATE sqlite_sequence SET seq = max(seq, ?) + ? WHERE name = 'readings'",
                    (first_number(self._wall()), random.randrange(SPREAD)),
                )
            for reading in readings:
                row = row_of(reading)
                size = size_of(row)
                cursor = self._db.execute(
                    f"INSERT INTO readings ({COLUMNS}, boot, uptime, size) VALUES (NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    (*row, self._boot, now, size),
                )
                numbers.append(int(cursor.lastrowid or 0))
                added += size
        self._numbered = True
        self.count += len(numbers)
        self.size += added
        return numbers

    def trim(self) -> None:
        """Move damaged rows away; drop readings that are too old, then the oldest beyond the size limit.

        Raises:
            sqlite3.Error: as `append`.
        """
        if not self._adopted:
            self._adopt()
        if self.damaged:
            self._set_aside_damaged()
        while self.count and self._drop("age", "uptime < ?", self._clock() - self.longest) == DROPPED_AT_ONCE:
            pass
        while self.size > self.largest and self._drop_excess():
            pass

    def _set_aside_damaged(self) -> None:
        """Move unreadable rows to a table of their own, which keeps the newest."""
        damaged_rows, moved = sorted(self.damaged), 0
        with self._transaction():
            for seq in damaged_rows:
                moved += self._db.execute(
                    f"INSERT OR REPLACE INTO damaged SELECT {COLUMNS} FROM readings WHERE seq = ?", (seq,)
                ).rowcount
                self._db.execute("DELETE FROM readings WHERE seq = ?", (seq,))
                self._db.execute("DELETE FROM acknowledged WHERE seq = ?", (seq,))
            self._db.execute(
                "DELETE FROM damaged WHERE seq NOT IN (SELECT seq FROM damaged ORDER BY seq DESC LIMIT ?)",
                (DAMAGED_KEPT,),
            )
            self._count_dropped("damage", moved)
        self.damaged.clear()
        self._update_counts()

    def _drop_excess(self) -> int:
        oldest = self._db.execute(
            "SELECT seq, CAST(size AS INTEGER) FROM readings ORDER BY seq LIMIT ?", (DROPPED_AT_ONCE,)
        )
        excess, last = self.size - self.largest, -1
        for seq, size in oldest:
            if excess <= 0:
                break
            excess, last = excess - size, seq
        return self._drop("size", "seq <= ?", last)

    def _drop(self, cause: str, condition: str, limit: float) -> int:
        with self._transaction():
            dropped = self._db.execute(
                "DELETE FROM readings WHERE seq IN (SELECT seq FROM readings ORDER BY seq LIMIT ?)"
                f" AND {condition} RETURNING seq, CAST(size AS INTEGER)",
                (DROPPED_AT_ONCE, limit),
            ).fetchall()
            if dropped:
                self._db.execute("DELETE FROM acknowledged WHERE seq <= ?", (max(seq for seq, _ in dropped),))
                self._count_dropped(cause, len(dropped))
        if dropped:
            self._forget(size for _, size in dropped)
            self.dropped[cause] = self.dropped.get(cause, 0) + len(dropped)
        return len(dropped)

    def _count_dropped(self, cause: str, count: int) -> None:
        self._db.execute(
            "INSERT INTO dropped VALUES (?, ?) ON CONFLICT (cause) DO UPDATE SET count = count + excluded.count",
            (cause, count),
        )

    def _forget(self, sizes: Iterable[int]) -> None:
        gone = list(sizes)
        self.count -= len(gone)
        self.size -= sum(gone)

    # -- out ----------------------------------------------------------------------------------------------

    def batch(self, sink: str, after: int, limit: int) -> list[Stored]:
        """The oldest readings after number `after` that a sink has not acknowledged, in order.

        Damaged rows are skipped, until `trim` moves them.

        Raises:
            sqlite3.Error: the file cannot be read.
        """
        while True:
            good, newest = self._read_rows(sink, after, limit)
            if good or newest is None:
                return good
            after = newest

    def _read_rows(self, sink: str, after: int, limit: int) -> tuple[list[Stored], int | None]:
        """The undamaged readings among the next `limit` rows, and the last row's number; None without rows."""
        good, newest = [], None
        rows = self._db.execute(
            f"SELECT {COLUMNS} FROM readings WHERE seq > ? AND NOT EXISTS (SELECT 1 FROM acknowledged"
            " WHERE sink = ? AND acknowledged.seq = readings.seq) ORDER BY seq LIMIT ?",
            (after, sink, limit),
        )
        for row in rows:  # one at a time: a damaged one may be large
            newest, stored = row[0], stored_of(row)
            if stored is None:
                self.damaged.add(newest)
            else:
                good.append(stored)
        return good, newest

    def acknowledge(self, sink: str, numbers: Sequence[int]) -> None:
        """Note that a sink has acknowledged these numbers; readings that all sinks have acknowledged are removed.

        Raises:
            sqlite3.Error: nothing was noted; the readings will be sent again.
        """
        others = [other for other in self.sinks if other != sink]
        with self._transaction():
            gone = [size for number in numbers for size in self._acknowledge(sink, number, others)]
        self._forget(gone)

    def _acknowledge(self, sink: str, number: int, others: Sequence[str]) -> list[int]:
        """Note one acknowledgement; returns the reading's size if it was removed, because no other sink needs it."""
        marks = ", ".join("?" * len(others))
        count_others = f"SELECT count(*) FROM acknowledged WHERE seq = ? AND sink IN ({marks})"
        (by_others,) = self._db.execute(count_others, (number, *others)).fetchone()
        if by_others < len(others):
            self._db.execute("INSERT OR IGNORE INTO acknowledged VALUES (?, ?)", (sink, number))
            return []
        if others:
            self._db.execute("DELETE FROM acknowledged WHERE seq = ?", (number,))
        return [
            size
            for (size,) in self._db.execute(
                "DELETE FROM readings WHERE seq = ? RETURNING CAST(size AS INTEGER)", (number,)
            )
        ]

    def use_sinks(self, sinks: Sequence[str]) -> None:
        """Store readings for these sinks from now on; readings that all of them have acknowledged are removed.

        Raises:
            sqlite3.Error: as `append`.
        """
        self.sinks = list(sinks)
        marks = ", ".join("?" * len(sinks))
        with self._transaction():
            self._db.execute(f"DELETE FROM acknowledged WHERE sink NOT IN ({marks})", sinks)
            if sinks:
                self._db.execute(
                    "DELETE FROM readings WHERE seq IN"
                    " (SELECT seq FROM acknowledged GROUP BY seq HAVING count(*) = ?)",
                    (len(sinks),),
                )
                self._db.execute("DELETE FROM acknowledged WHERE seq NOT IN (SELECT seq FROM readings)")
        self._update_counts()

    def oldest_since(self) -> float | None:
        """The uptime (s) at which the oldest reading was stored; None without readings."""
        row = self._db.execute("SELECT CAST(uptime AS REAL) FROM readings ORDER BY seq LIMIT 1").fetchone()
        return None if row is None else float(row[0])


def _hint(error: BaseException) -> str:
    locked = "locked" in str(error)
    return " (another MAVProxy uses it; `gradys set spool FILE` chooses another file)" if locked else ""
