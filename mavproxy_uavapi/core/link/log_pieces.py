"""What has arrived of a list of logs, and of a log. Pure: no I/O, no clock."""

from __future__ import annotations

import bisect
from dataclasses import dataclass
from typing import Any

PIECE = 90  # bytes of a full LOG_DATA
HIGHEST_ID = 0xFFFF
WHOLE_LIST = (0, HIGHEST_ID)  # the first and the last id of a request for all logs


@dataclass(frozen=True)
class LogEntry:
    """A log that the vehicle holds.

    Attributes:
        id: its number; the vehicle may give it to another log when logs are erased.
        size: bytes.
        time_utc: when it began (s since 1970); None if the vehicle did not know the time.
    """

    id: int
    size: int
    time_utc: int | None


class LogList:
    """The LOG_ENTRY messages of one list."""

    def __init__(self) -> None:
        self._ids: range | None = None  # of all logs; None before the first message
        self._entries: dict[int, LogEntry] = {}

    def take(self, message: Any) -> None:
        """Take a LOG_ENTRY. The first one gives the ids of all logs."""
        if self._ids is None:
            self._ids = range(max(message.last_log_num - message.num_logs + 1, 0), message.last_log_num + 1)
        if message.id in self._ids:
            self._entries[message.id] = LogEntry(message.id, message.size, message.time_utc or None)

    @property
    def missing(self) -> tuple[int, int] | None:
        """The first and the last id that are missing; None when the list is complete."""
        if self._ids is None:
            return WHOLE_LIST
        absent = [number for number in self._ids if number not in self._entries]
        return (absent[0], absent[-1]) if absent else None

    @property
    def entries(self) -> list[LogEntry]:
        """The logs that are known so far, by id."""
        return [self._entries[number] for number in sorted(self._entries)]


class LogPieces:
    """Which bytes of a log of `size` bytes have arrived."""

    def __init__(self, size: int) -> None:
        self.size = size
        self._gaps = [(0, size)] if size else []  # from the first missing byte to the one after the last, sorted

    @property
    def done(self) -> int:
        """How many bytes have arrived."""
        return self.size - sum(end - start for start, end in self._gaps)

    def next_gap(self, longest: int) -> tuple[int, int] | None:
        """The first missing byte, and the one after the last: at most `longest` bytes; None when all are here."""
        if not self._gaps:
            return None
        start, end = self._gaps[0]
        return start, min(end, start + longest)

    def take(self, start: int, end: int) -> bool:
        """Note the bytes from `start` to before `end`; whether any of them was missing."""
        first = bisect.bisect_right(self._gaps, start, key=lambda gap: gap[1])
        last = bisect.bisect_left(self._gaps, end, key=lambda gap: gap[0])
        touched = self._gaps[first:last]
        if not touched or start >= end:
            return False
        rest = [(touched[0][0], start), (end, touched[-1][1])]
        self._gaps[first:last] = [(a, b) for a, b in rest if a < b]
        return True
