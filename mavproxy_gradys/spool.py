"""The spool: readings in an SQLite file until every sink has acknowledged them.

Blocking; one thread uses it at a time (`keeper.py` has a thread for it). A transaction is on the disk when a
call returns (WAL, synchronous=FULL), so that neither `kill -9` nor a flat battery loses what was kept.

A sequence number is given once, even after the file was lost: a new file begins at the milliseconds since
1970, above whatever a former one can have reached at less than a thousand readings a second.
"""

from __future__ import annotations

import json
import random
import sqlite3
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.readings import Reading, Stored

APPLICATION = 0x67726164  # "grad": PRAGMA application_id of our files
VERSION = 1
ROW_OVERHEAD = 100  # bytes of a row beyond its texts, about
DROPPED_AT_ONCE = 500  # rows
CLOCK_IS_SET = 1.7e9  # s since 1970: a clock behind this (2023) was never set
WAL_KEPT = 1024 * 1024  # bytes
SCHEMA = """
CREATE TABLE readings (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, device TEXT NOT NULL, system INTEGER NOT NULL, quantity TEXT NOT NULL,
    representation TEXT NOT NULL, value TEXT NOT NULL, time REAL NOT NULL,
    boot TEXT NOT NULL, uptime REAL NOT NULL, size INTEGER NOT NULL);
CREATE TABLE acknowledged (sink TEXT, seq INTEGER, PRIMARY KEY (sink, seq)) WITHOUT ROWID;
CREATE TABLE dropped (cause TEXT PRIMARY KEY, count INTEGER NOT NULL) WITHOUT ROWID;
"""
COLUMNS = "seq, device, system, quantity, representation, value, time"


def uptime() -> float:
    """Seconds since this machine was started, sleep included: no clock jump moves it."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def boot_id() -> str:
    """Which start of this machine `uptime` counts from."""
    return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()


class Spool:
    """Readings on the disk.

    Ages are reckoned by the machine's uptime, so that a clock that is set does not make everything old. What
    is left from before a restart of the machine ages from when it was found again.

    Attributes:
        count, size: readings, and their bytes.
        dropped: how many readings were dropped, by cause (`size`, `age`), over the file's whole life.
        set_aside: the corrupt file that this one replaced; None when there was none.

    Args:
        path: the file; made if need be.
        largest: bytes of readings beyond which the oldest are dropped.
        longest: age (s) after which a reading is dropped.
        clock: uptime (s).
        boot: which start of the machine that counts from.
        wall: s since 1970.

    Raises:
        NotStored: the file cannot be opened: no room, no permission, another MAVProxy has it, or another program.
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
        self.path = path
        self.largest = largest
        self.longest = longest
        self.set_aside: Path | None = None
        self.sinks: list[str] = []
        self._clock = clock
        self._wall = wall
        self._boot = boot_id() if boot is None else boot
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._open_or_replace()
        except (sqlite3.Error, OSError) as error:
            raise NotStored(f"{path}: {error}{_hint(error)}") from error

    def _open_or_replace(self) -> None:
        try:
            self._open()
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError):
                raise  # no room, no permission, locked: the file itself may be good
            self.set_aside = self._move_aside()
            self._open()

    def _open(self) -> None:
        self._db = sqlite3.connect(self.path, timeout=0, isolation_level=None, check_same_thread=False)
        try:
            self._check_owner()
            self._db.execute("PRAGMA locking_mode=EXCLUSIVE")
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("PRAGMA synchronous=FULL")
            self._db.execute(f"PRAGMA journal_size_limit={WAL_KEPT}")
            self._check()
            with self._transaction():
                now = self._clock()
                self._db.execute(
                    "UPDATE readings SET boot = ?, uptime = ? WHERE boot != ?", (self._boot, now, self._boot)
                )
            self._look()
        except BaseException:
            self._db.close()
            raise

    def _check_owner(self) -> None:
        (application,) = self._db.execute("PRAGMA application_id").fetchone()
        (tables,) = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables and application != APPLICATION:
            raise NotStored(f"{self.path} is a database of another program; `gradys set spool FILE` takes another")

    def _check(self) -> None:
        (tables,) = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if not tables:
            self._make()
            return
        (found,) = self._db.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise sqlite3.DatabaseError(found)

    def _make(self) -> None:
        wall = self._wall()
        first = int(wall * 1000) if wall > CLOCK_IS_SET else random.getrandbits(40)
        with self._transaction():
            for statement in SCHEMA.split(";"):
                self._db.execute(statement)
            self._db.execute("INSERT INTO sqlite_sequence (name, seq) VALUES ('readings', ?)", (first,))
            self._db.execute(f"PRAGMA application_id={APPLICATION}")
            self._db.execute(f"PRAGMA user_version={VERSION}")

    def _move_aside(self) -> Path:
        """Rename the file, so that nobody's data is lost by our not understanding it."""
        number = 1
        while (aside := self.path.with_name(f"{self.path.name}.corrupt-{number}")).exists():
            number += 1
        for suffix in ("-wal", "-shm", ""):
            part = self.path.with_name(self.path.name + suffix)
            if part.exists():
                part.rename(aside.with_name(aside.name + suffix))
        return aside

    def _look(self) -> None:
        self.count, self.size = self._db.execute("SELECT count(*), coalesce(sum(size), 0) FROM readings").fetchone()
        self.dropped = dict(self._db.execute("SELECT cause, count FROM dropped"))

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def _transaction(self) -> _Transaction:
        return _Transaction(self._db)

    # -- in -----------------------------------------------------------------------------------------------

    def append(self, readings: Sequence[Reading]) -> list[int]:
        """Keep readings; their sequence numbers.

        Raises:
            sqlite3.Error: nothing was kept.
        """
        now, numbers, added = self._clock(), [], 0
        with self._transaction():
            for r in readings:
                value = json.dumps(r.value, allow_nan=False)
                size = ROW_OVERHEAD + sum(map(len, (r.device, r.quantity, r.representation, value)))
                row = (r.device, r.system, r.quantity, r.representation, value, r.time, self._boot, now, size)
                cursor = self._db.execute(
                    "INSERT INTO readings (device, system, quantity, representation, value, time, boot, uptime, size)"
                    " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    row,
                )
                numbers.append(int(cursor.lastrowid or 0))
                added += size
        self.count += len(numbers)
        self.size += added
        return numbers

    def trim(self) -> None:
        """Drop what is too old, then the oldest of what is too much.

        Raises:
            sqlite3.Error: as `append`.
        """
        while self.count and self._drop("age", "uptime < ?", self._clock() - self.longest) == DROPPED_AT_ONCE:
            pass
        while self.size > self.largest and self._drop_excess():
            pass

    def _drop_excess(self) -> int:
        oldest = self._db.execute("SELECT seq, size FROM readings ORDER BY seq LIMIT ?", (DROPPED_AT_ONCE,))
        excess, last = self.size - self.largest, -1
        for seq, size in oldest:
            if excess <= 0:
                break
            excess, last = excess - size, seq
        return self._drop("size", "seq <= ?", last)

    def _drop(self, cause: str, condition: str, limit: float) -> int:
        with self._transaction():
            gone = self._db.execute(
                "DELETE FROM readings WHERE seq IN (SELECT seq FROM readings ORDER BY seq LIMIT ?)"
                f" AND {condition} RETURNING seq, size",
                (DROPPED_AT_ONCE, limit),
            ).fetchall()
            if gone:
                self._db.execute("DELETE FROM acknowledged WHERE seq <= ?", (max(seq for seq, _ in gone),))
                self._db.execute(
                    "INSERT INTO dropped VALUES (?, ?)"
                    " ON CONFLICT (cause) DO UPDATE SET count = count + excluded.count",
                    (cause, len(gone)),
                )
        if gone:
            self._forget(size for _, size in gone)
            self.dropped[cause] = self.dropped.get(cause, 0) + len(gone)
        return len(gone)

    def _forget(self, sizes: Iterable[int]) -> None:
        gone = list(sizes)
        self.count -= len(gone)
        self.size -= sum(gone)

    # -- out ----------------------------------------------------------------------------------------------

    def batch(self, sink: str, after: int, limit: int) -> list[Stored]:
        """The oldest readings after number `after` that a sink has not acknowledged, in their order.

        Raises:
            sqlite3.Error: the file cannot be read.
        """
        rows = self._db.execute(
            f"SELECT {COLUMNS} FROM readings WHERE seq > ? AND NOT EXISTS (SELECT 1 FROM acknowledged"
            " WHERE sink = ? AND acknowledged.seq = readings.seq) ORDER BY seq LIMIT ?",
            (after, sink, limit),
        )
        return [
            Stored(seq, Reading(device, system, quantity, representation, json.loads(value), at))
            for seq, device, system, quantity, representation, value, at in rows
        ]

    def acknowledge(self, sink: str, numbers: Sequence[int]) -> None:
        """Note that a sink has acknowledged just these; what all sinks have is removed.

        Raises:
            sqlite3.Error: nothing was noted; the readings are sent again some time.
        """
        others = [other for other in self.sinks if other != sink]
        with self._transaction():
            gone = [size for number in numbers for size in self._acknowledge(sink, number, others)]
        self._forget(gone)

    def _acknowledge(self, sink: str, number: int, others: Sequence[str]) -> list[int]:
        """Note one acknowledgement; the size of the reading if nobody else waits for it."""
        marks = ", ".join("?" * len(others))
        held = f"SELECT count(*) FROM acknowledged WHERE seq = ? AND sink IN ({marks})"
        (by_others,) = self._db.execute(held, (number, *others)).fetchone()
        if by_others < len(others):
            self._db.execute("INSERT OR IGNORE INTO acknowledged VALUES (?, ?)", (sink, number))
            return []
        if others:
            self._db.execute("DELETE FROM acknowledged WHERE seq = ?", (number,))
        return [size for (size,) in self._db.execute("DELETE FROM readings WHERE seq = ? RETURNING size", (number,))]

    def use_sinks(self, sinks: Sequence[str]) -> None:
        """From now on readings are owed to these; what all of them have acknowledged already is removed.

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
        self._look()

    def oldest_since(self) -> float | None:
        """The uptime (s) at which the oldest reading was kept; None when there is none."""
        row = self._db.execute("SELECT uptime FROM readings ORDER BY seq LIMIT 1").fetchone()
        return None if row is None else float(row[0])


class _Transaction:
    """BEGIN IMMEDIATE … COMMIT, or ROLLBACK when anything was raised."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db

    def __enter__(self) -> None:
        self._db.execute("BEGIN IMMEDIATE")

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: object) -> None:
        if kind is None:
            try:
                self._db.execute("COMMIT")
                return
            except sqlite3.Error:
                self._roll_back()
                raise
        self._roll_back()

    def _roll_back(self) -> None:
        if self._db.in_transaction:  # SQLite itself ends it after some errors
            self._db.execute("ROLLBACK")


def _hint(error: BaseException) -> str:
    return " (another MAVProxy uses it; `gradys set spool FILE` takes another)" if "locked" in str(error) else ""
