"""What the station remembers: where each device is (in memory), and readings, once each (SQLite)."""

from __future__ import annotations

import json
import math
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

ACTIVE = 5.0  # s without an update after which a device is `on_hold`
INACTIVE = 10.0  # s after which it is `inactive`
COLUMNS = ("device", "seq", "id", "quantity", "representation", "value", "time", "received")
DEVICE_COLUMNS = ("id", "device", "lat", "lng", "alt", "heading", "battery_percent", "ip", "seq", "age_s", "status")
SCHEMA = """
CREATE TABLE IF NOT EXISTS readings (
    device TEXT, seq INTEGER, id TEXT, quantity TEXT, representation TEXT, value TEXT, time REAL, received REAL,
    PRIMARY KEY (device, seq)) WITHOUT ROWID
"""


def whole(text: Any) -> int:
    """An integer that SQLite can hold.

    Raises:
        ValueError: it is none.
    """
    number = int(text)
    if not -(2**63) <= number < 2**63:
        raise ValueError(f"{text!r:.40} is too large")
    return number


def finite(text: Any) -> float:
    """A number.

    Raises:
        ValueError: it is none, NaN, or infinite.
    """
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text!r:.40} is not finite")
    return number


NUMBERS = {"id": whole, "type": whole, "seq": whole, "lat": finite, "lng": finite, "alt": finite}


def parse(form: Mapping[str, str]) -> dict[str, Any]:
    """A device's update, with numbers for numbers.

    Raises:
        ValueError: what should be a number is none.
        KeyError: `device` or `id` is missing.
    """
    device: dict[str, Any] = dict(form)
    for name, number in NUMBERS.items():
        if name in device:
            device[name] = number(device[name])
    return {**device, "device": device["device"], "id": device["id"]}


class PositionStore:
    """Devices and readings; each call blocks for a transaction at most.

    Attributes:
        repeats: readings that came again and were dropped.

    Args:
        file: SQLite database; `:memory:` forgets.
        clock: s since 1970.
    """

    def __init__(self, file: Path | str, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._db = sqlite3.connect(file, isolation_level=None)
        self._db.execute("PRAGMA journal_mode=WAL")
        self._db.execute("PRAGMA synchronous=FULL")
        self._db.execute(SCHEMA)
        self._devices: dict[int, dict[str, Any]] = {}
        self.repeats = 0

    def close(self) -> None:
        """Close the database."""
        self._db.close()

    def update(self, device: dict[str, Any]) -> None:
        """Take what `parse` made of a device's update."""
        self._devices[device["id"]] = {**device, "received": self._clock()}

    def devices(self) -> list[dict[str, Any]]:
        """Every device, with the age of its update and whether it is active."""
        now = self._clock()
        found = []
        for _, device in sorted(self._devices.items()):
            age = now - device["received"]
            status = "active" if age < ACTIVE else "on_hold" if age < INACTIVE else "inactive"
            found.append({**device, "age_s": round(age, 3), "status": status})
        return found

    def add(self, readings: Sequence[Mapping[str, Any]]) -> list[int]:
        """Keep readings once each; their numbers, when they are on the disk.

        Raises:
            ValueError: one is no reading; none is kept.
        """
        rows = [self._row(reading) for reading in readings]
        before = self._db.total_changes
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._db.executemany("INSERT OR IGNORE INTO readings VALUES (?, ?, ?, ?, ?, ?, ?, ?)", rows)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self.repeats += len(rows) - (self._db.total_changes - before)
        return [row[1] for row in rows]

    def _row(self, reading: Mapping[str, Any]) -> tuple[Any, ...]:
        try:
            device, seq, at = str(reading["device"]), reading["seq"], finite(reading["time"])
            named = str(reading.get("id", "")), str(reading["quantity"]), str(reading.get("representation", ""))
            value = json.dumps(reading["value"], allow_nan=False)
        except (KeyError, TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"not a reading: {error!r}") from error
        if not isinstance(seq, int) or isinstance(seq, bool):
            raise ValueError(f"seq {seq!r} is no number")
        return (device, whole(seq), *named, value, at, self._clock())

    def count(self) -> int:
        """How many readings there are."""
        (count,) = self._db.execute("SELECT count(*) FROM readings").fetchone()
        return int(count)

    def readings(
        self, device: str = "", quantity: str = "", after: int = -1, limit: int = 1000
    ) -> Iterator[tuple[Any, ...]]:
        """Readings in the order of their numbers, as rows of COLUMNS; of one device, of one quantity."""
        rows = self._db.execute(
            f"SELECT {', '.join(COLUMNS)} FROM readings WHERE (? = '' OR device = ?) AND (? = '' OR quantity = ?)"
            " AND seq > ? ORDER BY seq LIMIT ?",
            (device, device, quantity, quantity, after, limit),
        )
        for row in rows:
            yield (*row[:5], json.loads(row[5]), *row[6:])
