"""The audit trail: what was commanded, by whom, with which outcome; and what happened to the vehicles meanwhile."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.rotating_file import RotatingFile
from mavproxy_uavapi.core.text import cut, escaped

log = logging.getLogger("uavapi.audit")
KEPT = 2000  # entries in memory: more than may wait for a slow disk
FILE = "uavapi-audit.jsonl"
FILE_BYTES = 10_000_000
OLDER_FILES = 4
BLOCK, PAUSE = 32 * 1024, 0.002  # bytes that are read before a pause (s), in which MAVProxy's main loop goes on
WAITING = 1000  # lines that wait for a slow disk
COUNTED_FOR = 60.0  # s for which refusals are counted before the trail has an entry for them
MOST_ADDRESSES = 50  # with refusals counted apart; those of others are counted together
OTHERS = "other addresses"


COMMAND = "command"
# What an entry can be about. Those after the first are events of vehicles.
KINDS = (COMMAND, "mode", "armed", "boot", "link", "text", "envelope", "separation", "lease", "authority")
SHORT = ("/command/", "/movement/")  # folders of verbs that have a name of their own
DEGREES = ("lat", "long", "lon")  # numbers that no pilot wants to be rounded
REFUSED = "refused"  # the verb and the outcome of what was refused before it was a command
CUT_SHORT = ("superseded", "aborted", "client_gone")  # outcomes of what did not fail


@dataclass(frozen=True)
class Entry:
    """One command, or one event of a vehicle.

    Attributes:
        time: when it was answered, or happened: UTC, ISO 8601, to the millisecond.
        client: its address, `console`, or the script in whose name it was done; empty for an event.
        verb: the command's path.
        request: its validated parameters.
        system: the vehicle's system id; 0 when there was none.
        outcome: `ok`, `partly` where something of it failed, or the code of the error.
        detail: the result, or the sentence of the error, or of the event.
        seconds: from request to answer.
        sent: names of the messages that reached the link for it, as `SentNames` has them.
        kind: one of KINDS.
        script: the session of the script for which the command's job went on.
        info: what else is known of an event.
        id: names it, also after a restart; empty until the trail has it.
    """

    time: str
    client: str = ""
    verb: str = ""
    request: Mapping[str, Any] = field(default_factory=dict)
    system: int = 0
    outcome: str = ""
    detail: str = ""
    seconds: float = 0.0
    sent: tuple[str, ...] = ()
    kind: str = COMMAND
    script: str = ""
    info: Mapping[str, Any] = field(default_factory=dict)
    id: str = ""

    def __str__(self) -> str:
        if self.kind != COMMAND:
            return escaped(f"{self.time} {self.detail}")
        texts = ", ".join(f"{name}={value}" for name, value in self.request.items() if value is not None)
        return escaped(f"{self.time} {self.client} {self.verb}({texts}): {self.outcome} after {self.seconds:.1f} s")

    @property
    def sentence(self) -> str:
        """What happened, for a pilot."""
        if self.kind != COMMAND:
            return self.detail
        if self.verb == REFUSED:
            codes = ", ".join(f"{code} {count}" for code, count in self.request.items())
            return f"{self.detail}, of {self.client} ({codes})"
        return escaped(f"{self._command} {self._end}")

    @property
    def _command(self) -> str:
        told = [(name, value) for name, value in self.request.items() if value is not None and value is not False]
        numbers = ", ".join(f"{name} {_short(name, value)}" for name, value in told)
        of_script = f", script {self.script}" if self.script else ""
        vehicle = f"vehicle {self.system}: " if self.system else ""
        return f"{vehicle}{name_of(self.verb)}{f' ({numbers})' if numbers else ''} of {self.client}{of_script}"

    @property
    def _end(self) -> str:
        after = "at once" if self.seconds < 0.1 else f"after {self.seconds:.{1 if self.seconds < 10 else 0}f} s"
        if self.outcome == "ok":
            return f"is done {after}"
        word = "is partly done" if self.outcome == "partly" else "ends" if self.outcome in CUT_SHORT else "fails"
        return f"{word} {after}: {self.detail}"

    def report(self) -> dict[str, Any]:
        """The entry for callers; what is empty is left out."""
        known = {"time": self.time, "kind": self.kind, "vehicle": self.system, "sentence": self.sentence}
        more = {name: value for name, value in self.line().items() if name not in ("time", "kind", "system", "info")}
        return {**known, **(more if self.kind == COMMAND else {"id": self.id}), **self.info}

    def line(self) -> dict[str, Any]:
        """The entry as the file has it: a command with all of its members, an event without those of commands."""
        return {name: value for name, value in vars(self).items() if value or (self.kind == COMMAND and name in HAD)}

    @classmethod
    def of(cls, line: Mapping[str, Any]) -> Entry:
        """The entry of a line. Raises ValueError if it is none."""
        members = {name: line[name] for name in NAMES if name in line}
        if "detail" not in members or "time" not in members:
            raise ValueError("no entry")
        return cls(**members)

    def cut(self) -> Entry:
        """The entry with long values cut."""
        texts = {name: cut(getattr(self, name)) for name in ("client", "verb", "request", "detail", "info")}
        return replace(self, **texts)


NAMES = tuple(member.name for member in fields(Entry))
HAD = NAMES[:10]  # members of every command


def name_of(verb: str) -> str:
    """A verb's path as a pilot calls it."""
    return next((verb[len(folder) :] for folder in SHORT if verb.startswith(folder)), verb).lstrip("/")


def _short(name: str, value: Any) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{round(value, 6 if name in DEGREES else 1) + 0.0:.10g}"  # + 0.0: none is -0


def utc_now() -> str:
    """The time, UTC, ISO 8601, to the millisecond."""
    return utc_at(time.time())


def utc_at(seconds: float) -> str:
    """A time in s since 1970 as `utc_now` has it."""
    return datetime.fromtimestamp(seconds, timezone.utc).isoformat(timespec="milliseconds")


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
        newest: the last entries, in the order in which they came.
        on_added: called with each entry.
    """

    def __init__(self, directory: Path | None) -> None:
        self.file = None if directory is None else directory / FILE
        self.newest: deque[Entry] = deque(maxlen=KEPT)
        self.on_added: list[Callable[[Entry], None]] = []
        self._refusals = Refusals()
        self._report_timer: asyncio.TimerHandle | None = None
        # A disk may stall; the asyncio loop must not. So one thread writes, in order.
        self._writer = ThreadPoolExecutor(1, "uavapi-audit")
        self._room = threading.BoundedSemaphore(WAITING)
        self._lost = 0
        self._lines = None if self.file is None else _lines_in(self.file)
        self._reading = asyncio.Lock()  # files are read by one thread at a time
        self._run, self._count = f"{time.time_ns() // 1_000_000:x}", 0

    @property
    def entries(self) -> list[Entry]:
        """The last commands, oldest first."""
        return [entry for entry in self.newest if entry.kind == COMMAND]

    def add(self, entry: Entry) -> None:
        """Take an entry."""
        self._count += 1
        entry = replace(entry.cut(), id=f"{self._run}-{self._count}")
        self.newest.append(entry)
        log.info("%s", entry)
        self._write(entry.line())
        for callback in self.on_added:
            callback(entry)

    async def page(
        self,
        wanted: Callable[[Entry], bool],
        limit: int,
        *,
        since: str = "",
        until: str = "",
        before: str = "",
        hint: Callable[[str], bool] = lambda _line: True,
    ) -> list[Entry]:
        """The newest entries, the newest first: of those in memory, then of the files.

        Args:
            wanted: whether an entry counts.
            limit: the number of entries.
            since, until: times as `Entry.time` has them; empty for no limit.
            before: the id of an entry; only older ones count.
            hint: whether a line of a file may be wanted; it spares reading it.

        Raises:
            NotFound: no entry has that id any more.
        """

        def is_in_time(stamp: str) -> bool:
            return since <= stamp and (not until or stamp < until)

        def may_count(line: str) -> bool:
            is_in = is_in_time(line[len(HEAD) : len(HEAD) + STAMP]) and hint(line)
            return is_in or bool(before and before in line)

        newest = list(self.newest)[::-1]

        def collect() -> list[Entry]:
            skips, found = bool(before), []
            for entry in self._with_files(newest, may_count):
                if skips:
                    skips = entry.id != before
                elif is_in_time(entry.time) and wanted(entry):
                    found.append(entry)
                    if len(found) == limit:
                        break
            if skips:
                raise NotFound(f"the trail has no entry {before[:40]}")
            return found

        if self.file is None:
            return collect()
        async with self._reading:
            return await asyncio.to_thread(collect)

    def _with_files(self, newest: list[Entry], may_count: Callable[[str], bool]) -> Iterator[Entry]:
        """These entries, then those of the files that may count and are none of them."""
        yield from newest
        known = {entry.id for entry in newest}
        files = [] if self.file is None else [self.file, *_older(self.file)]
        for line in (line for file in files for line in _lines_backwards(file)):
            if may_count(line):
                entry = _entry_of(line)
                if entry is not None and (not entry.id or entry.id not in known):
                    known.add(entry.id)
                    yield entry

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
            self.add(Entry(utc_now(), client, REFUSED, codes, 0, REFUSED, detail, COUNTED_FOR))

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


HEAD, STAMP = '{"time": "', 29  # how a line of the file begins, and the length of the time after it


def _older(file: Path) -> Iterable[Path]:
    return (file.with_name(f"{file.name}.{number}") for number in range(1, OLDER_FILES + 1))


def _lines_backwards(file: Path) -> Iterator[str]:
    """The lines of a file, the last one first; none if it is not there, or cannot be read."""
    try:
        with file.open("rb") as stream:
            end, rest = stream.seek(0, os.SEEK_END), b""
            while end > 0:
                start = max(end - BLOCK, 0)
                stream.seek(start)
                rest, *lines = (stream.read(end - start) + rest).split(b"\n")
                yield from (line.decode(errors="replace") for line in reversed(lines))
                end = start
                time.sleep(PAUSE)
            yield rest.decode(errors="replace")
    except OSError:
        return


def _entry_of(line: str) -> Entry | None:
    """The entry of a line; None for a torn line, and for one that tells of lost ones."""
    try:
        return Entry.of(json.loads(line))
    except (TypeError, ValueError):
        return None
