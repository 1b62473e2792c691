"""The audit trail: every command, its client, the messages that were sent, and its outcome."""

from __future__ import annotations

import asyncio
import json
import logging
import threading
from collections import Counter, deque
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.rotating_file import RotatingFile
from mavproxy_uavapi.core.text import cut, escaped

log = logging.getLogger("uavapi.audit")
KEPT = 500  # entries in memory
FILE = "uavapi-audit.jsonl"
FILE_BYTES = 10_000_000
OLDER_FILES = 4
WAITING = 1000  # lines that wait for a slow disk
COUNTED_FOR = 60.0  # s for which refusals are counted before the trail has an entry for them
MOST_ADDRESSES = 50  # with refusals counted apart; those of others are counted together
OTHERS = "other addresses"


@dataclass(frozen=True)
class Entry:
    """One command.

    Attributes:
        time: when it was answered, UTC, ISO 8601.
        client: its address, `console`, or the script in whose name it was done.
        verb: its path.
        request: its validated parameters.
        system: the vehicle's system id; 0 when there was none.
        outcome: `ok`, `partly` where something of it failed, or the code of the error.
        detail: the result, or the sentence of the error.
        seconds: from request to answer.
        sent: names of the messages that reached the link for it, as `SentNames` has them.
    """

    time: str
    client: str
    verb: str
    request: Mapping[str, Any]
    system: int
    outcome: str
    detail: str
    seconds: float
    sent: tuple[str, ...]

    def __str__(self) -> str:
        texts = ", ".join(f"{name}={value}" for name, value in self.request.items() if value is not None)
        return escaped(f"{self.time} {self.client} {self.verb}({texts}): {self.outcome} after {self.seconds:.1f} s")

    def cut(self) -> Entry:
        """The entry with long values cut."""
        texts = {name: cut(getattr(self, name)) for name in ("client", "verb", "request", "detail")}
        return replace(self, **texts)


def utc_now() -> str:
    """The time, UTC, ISO 8601, to the millisecond."""
    return datetime.now(timezone.utc).isoformat(timespec="milliseconds")


class Refusals:
    """Counts refused requests by address and code. Pure."""

    def __init__(self) -> None:
        self._counts: dict[str, Counter[str]] = {}

    def add(self, client: str, code: str) -> None:
        """Count one."""
        if client not in self._counts and len(self._counts) >= MOST_ADDRESSES:
            client = OTHERS
        self._counts.setdefault(client, Counter())[code] += 1

    def take(self) -> dict[str, dict[str, int]]:
        """The counts since the last call, by address and code."""
        counts, self._counts = self._counts, {}
        return {client: dict(codes) for client, codes in counts.items()}


class Audit:
    """Keeps the last entries, and writes all of them as JSON lines. All methods belong to the asyncio thread.

    Args:
        directory: where the files go; None to keep none (MAVProxy's --no-state).

    Attributes:
        file: the newest file; older ones beside it end in .1 to .4.
        entries: the last ones, oldest first.
    """

    def __init__(self, directory: Path | None) -> None:
        self.file = None if directory is None else directory / FILE
        self.entries: deque[Entry] = deque(maxlen=KEPT)
        self._refusals = Refusals()
        self._report_timer: asyncio.TimerHandle | None = None
        # A disk may stall; the asyncio loop must not. So one thread writes, in order.
        self._writer = ThreadPoolExecutor(1, "uavapi-audit")
        self._room = threading.BoundedSemaphore(WAITING)
        self._lost = 0
        self._lines = None if self.file is None else _lines_in(self.file)

    def add(self, entry: Entry) -> None:
        """Take an entry."""
        entry = entry.cut()
        self.entries.append(entry)
        log.info("%s", entry)
        self._write(dict(vars(entry)))

    def refused(self, client: str, code: str) -> None:
        """Count a request that was refused before it became a command; the trail has an entry for it within a minute.

        Args:
            client: its address.
            code: of the error.
        """
        self._refusals.add(client, code)
        if self._report_timer is None:
            self._report_timer = asyncio.get_running_loop().call_later(COUNTED_FOR, self._report_refusals)

    def _report_refusals(self) -> None:
        self._report_timer = None
        for client, codes in self._refusals.take().items():
            detail = f"{sum(codes.values())} requests were refused"
            self.add(Entry(utc_now(), client, "refused", codes, 0, "refused", detail, COUNTED_FOR, ()))

    def _write(self, entry: dict[str, Any]) -> None:
        if self._lines is None:
            return
        if not self._room.acquire(blocking=False):
            self._lost += 1
            return
        line = json.dumps(entry, default=str)
        if self._lost:
            line = json.dumps({"time": utc_now(), "lost": self._lost}) + "\n" + line
            self._lost = 0
        self._writer.submit(self._write_line, self._lines, line)

    def _write_line(self, lines: RotatingFile, line: str) -> None:
        try:
            lines.emit(logging.makeLogRecord({"msg": line}))
        finally:
            self._room.release()

    def close(self) -> None:
        """Write the remaining entries. Any thread, after the asyncio thread has ended."""
        if self._report_timer is not None:
            self._report_timer.cancel()
        self._report_refusals()
        self._writer.shutdown()
        if self._lines is not None:
            self._lines.close()


def _lines_in(file: Path) -> RotatingFile:
    def report(text: str) -> None:
        log.error("%s", text)

    return RotatingFile(file, FILE_BYTES, OLDER_FILES, report, private=True, delay=True)
