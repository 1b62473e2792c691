"""The audit trail: every command that was asked for, by whom, what reached the vehicle, and how it ended."""

from __future__ import annotations

import contextvars
import itertools
import json
import logging
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

log = logging.getLogger("uavapi.audit")
KEPT = 500
MANY = 3  # of a name in a row are counted
FILE = "uavapi-audit.jsonl"

# The names of the messages that the present call has sent; a task of it inherits the same list.
sent_by_call: contextvars.ContextVar[list[str] | None] = contextvars.ContextVar("sent_by_call", default=None)


def note_sent(name: str) -> None:
    """Note that a message of that name goes to a vehicle for the present call."""
    sent = sent_by_call.get()
    if sent is not None:
        sent.append(name)


@contextmanager
def noting_sent() -> Iterator[list[str]]:
    """The names of the messages that are sent within the context."""
    sent: list[str] = []
    token = sent_by_call.set(sent)
    try:
        yield sent
    finally:
        sent_by_call.reset(token)


@dataclass(frozen=True)
class Entry:
    """One command.

    Attributes:
        time: when it was answered, UTC, ISO 8601.
        client: its address.
        verb: its path.
        request: its validated parameters.
        system: the vehicle's system id; 0 when there was none.
        outcome: `ok`, or the error's code.
        detail: the result, or the error's sentence.
        seconds: from request to answer.
        sent: names of the messages that reached the link for it, as `counted` has them.
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
        given = ", ".join(f"{name}={value}" for name, value in self.request.items() if value is not None)
        return f"{self.time} {self.client} {self.verb}({given}): {self.outcome} after {self.seconds:.1f} s"


def counted(names: Iterable[str]) -> tuple[str, ...]:
    """Names in their order; one that comes thrice or more in a row is there once, with its number: `NAME x240`."""
    told: list[str] = []
    for name, same in itertools.groupby(names):
        count = len(list(same))
        told += [name] * count if count < MANY else [f"{name} x{count}"]
    return tuple(told)


def utc_now() -> str:
    """The time, UTC, ISO 8601, to the millisecond."""
    return datetime.now(timezone.utc).isoformat(timespec="milliseconds")


class Audit:
    """Keeps the last entries, and writes all of them as JSON lines.

    Args:
        directory: where the file goes; None to keep no file (MAVProxy's --no-state).
    """

    def __init__(self, directory: Path | None) -> None:
        self.file = None if directory is None else directory / FILE
        self.entries: deque[Entry] = deque(maxlen=KEPT)
        # A disk may stall, the asyncio loop must not: one thread writes, in order.
        self._writer = ThreadPoolExecutor(1, "uavapi-audit")
        self._failed = False

    def add(self, entry: Entry) -> None:
        """Take an entry."""
        self.entries.append(entry)
        log.info("%s", entry)
        if self.file is not None:
            self._writer.submit(self._write, json.dumps(asdict(entry), default=str) + "\n")

    def _write(self, line: str) -> None:
        assert self.file is not None
        try:
            with self.file.open("a", encoding="utf-8") as stream:
                stream.write(line)
        except OSError as error:
            if not self._failed:  # once, not a thousand times; the entries are still in memory
                log.error("cannot write %s: %s", self.file, error.strerror)
            self._failed = True
        else:
            self._failed = False

    def close(self) -> None:
        """Write what is left."""
        self._writer.shutdown()
