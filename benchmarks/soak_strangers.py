"""Strangers at the port while an owner with the token flies: what they cost him.

    python benchmarks/soak_strangers.py --minutes 10 [--first]

Real processes: the embedded vehicle, a tap on its link, a MAVProxy, strangers in a process of their own. It fails
when a stop of the owner's was refused, or was on the wire later than 50 ms after he asked (99th percentile), when a
setpoint of a movement was more than 0.5 s late, when MAVProxy's log has a traceback, or when it keeps memory.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gzip
import itertools
import logging
import multiprocessing
import random
import resource
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from typing import Any

from figures import machine, percentile, put_first, table
from http_clients import Client
from rig import fly, rig
from soak_notes import RSS_ALLOWED, Notes, Usage, look_for_bad_words
from tap import message_id

TOKEN = "a-long-and-secret-word"
STOP_WITHIN = 0.050  # s, at the 99th percentile
INTERVAL = 1.0  # s between the setpoints of a movement
LATE_ALLOWED = 0.5  # s that one of them may be late
WARM_UP = 90.0  # s of strangers before memory counts: the longest of what they do takes 60
AT_REST = 35.0  # s after which every connection of theirs has been closed
CYCLE = 1.5  # s of flight before a stop

IDLE, BOMBERS, FLOODERS, HIT_AND_RUN, READERS, UNREAD = 1100, 4, 32, 4, 16, 16
COMMAND_LONG, SETPOINTS = 76, (84, 86)
DO_SET_MODE, DO_PAUSE_CONTINUE = 176, 193  # what brake and stop send


# -- the strangers ------------------------------------------------------------------------------------------


class Strangers:
    """Everything that can be sent without the token, and streams of somebody who has it and does not read."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._bomb = gzip.compress(bytes(900_000_000), 9)
        self.counts: Counter[str] = Counter()

    async def run(self, seconds: float) -> Counter[str]:
        """All of them, for so long."""
        acts: list[tuple[Callable[[], Awaitable[None]], int]] = [
            (self._idle, IDLE),
            (self._bomber, BOMBERS),
            (self._flood, FLOODERS),
            (self._hit_and_run, HIT_AND_RUN),
            (self._slow, READERS),
            (self._unread_page, READERS),
            (self._unread_stream, UNREAD),
        ]
        tasks = [asyncio.ensure_future(self._again(act)) for act, count in acts for _ in range(count)]
        await asyncio.sleep(seconds)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return self.counts

    async def _again(self, act: Callable[[], Awaitable[None]]) -> None:
        await asyncio.sleep(random.uniform(0, 2))
        while True:
            with contextlib.suppress(OSError, asyncio.TimeoutError, asyncio.IncompleteReadError):
                await act()
            self.counts[act.__name__.strip("_")] += 1
            await asyncio.sleep(1.0 if act == self._idle else 0)

    @contextlib.asynccontextmanager
    async def _connection(self) -> Any:
        local = f"127.{random.randrange(1, 250)}.{random.randrange(250)}.{random.randrange(1, 250)}"
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port, local_addr=(local, 0))
        try:
            yield reader, writer
        finally:
            writer.transport.abort()

    async def _idle(self) -> None:
        """A connection that says nothing, until it is closed."""
        async with self._connection() as (reader, _):
            await reader.read()

    async def _bomber(self) -> None:
        """A body that is a thousand times as large as it looks."""
        async with self._connection() as (reader, writer):
            head = f"POST /movement/drive HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(self._bomb)}\r\n"
            writer.write(head.encode() + b"Content-Encoding: gzip\r\n\r\n" + self._bomb)
            await asyncio.wait_for(reader.read(), 20)

    async def _flood(self) -> None:
        """Commands without the token, as fast as they are refused."""
        async with self._connection() as (reader, writer):
            writer.write(b"GET /command/disarm?force=true HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 3)
            self.counts[(await reader.read(12)).decode()] += 1
            await reader.read()

    async def _hit_and_run(self) -> None:
        """The same by somebody who does not wait for the answer."""
        async with self._connection() as (_, writer):
            writer.write(b"GET /command/land HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer \xff\r\n\r\n")
            await asyncio.sleep(0.02)

    async def _slow(self) -> None:
        """Headers that come byte by byte."""
        async with self._connection() as (reader, writer):
            for byte in b"GET /command/arm HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"a" * 1000:
                writer.write(bytes([byte]))
                await asyncio.sleep(0.5)
                if reader.at_eof():
                    return

    async def _unread_page(self) -> None:
        """The largest file of the documentation, again and again, and nobody reads it."""
        async with self._connection() as (_, writer):
            for _ in range(50):
                writer.write(b"GET /docs/swagger-ui-bundle.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
                await asyncio.sleep(1.0)

    async def _unread_stream(self) -> None:
        """A telemetry stream of somebody who has the token and does not read."""
        async with self._connection() as (reader, writer):
            reader._transport.pause_reading()
            head = f"GET /telemetry/stream HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {TOKEN}\r\n\r\n"
            writer.write(head.encode())
            await asyncio.sleep(60.0)


def _run_strangers(pipe: Any) -> None:
    logging.disable()  # asyncio tells of each write to a connection that was closed
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    while (job := pipe.recv()) is not None:
        pipe.send(asyncio.run(Strangers(*job[:1]).run(job[1])))


class StrangersProcess:
    """The strangers in a process of their own."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_run_strangers, args=(theirs,), daemon=True)
        self._process.start()

    def begin(self, port: int, seconds: float) -> None:
        """Start, for so long."""
        self._pipe.send((port, seconds))

    def end(self) -> Counter[str]:
        """Wait until they are done; what they did how often."""
        counts: Counter[str] = self._pipe.recv()
        return counts

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self._process.join(10)


# -- the owner ----------------------------------------------------------------------------------------------


class Wire:
    """What goes to the vehicle, by the tap's clock."""

    def __init__(self, tap: Any) -> None:
        self.commands: list[tuple[float, int]] = []
        self.setpoints: list[float] = []
        tap.to_vehicle = self._see

    def _see(self, at: float, frame: bytes) -> None:
        number = message_id(frame)
        if number == COMMAND_LONG:
            self.commands.append((at, int.from_bytes(frame[38:40], "little")))
        elif number in SETPOINTS:
            self.setpoints.append(at)

    def first(self, command: int, since: float) -> float | None:
        """When that command first went out after `since` (s)."""
        return next((at for at, number in self.commands if number == command and at >= since), None)


class Owner:
    """Flies and stops, again and again, on a kept connection or on new ones."""

    def __init__(self, port: int, wire: Wire, notes: Notes) -> None:
        self._port, self._wire, self._notes = port, wire, notes
        self._kept: Client | None = None
        self.delays: dict[str, list[float]] = {"kept connection": [], "new connection": []}
        self.answers: list[float] = []
        self.reset = 0  # new connections that were closed before they were read
        self.gaps: list[float] = []

    async def run(self, seconds: float) -> None:
        """Fly for so long."""
        end = time.time() + seconds
        for new, (path, command) in itertools.cycle(
            itertools.product((False, True), (("/command/brake", DO_SET_MODE), ("/movement/stop", DO_PAUSE_CONTINUE)))
        ):
            if time.time() > end:
                return
            await self._cycle(new, path, command)

    async def _cycle(self, new: bool, path: str, command: int) -> None:
        await self._ask("/command/guided", new)
        target = {"vx": random.choice((1, -1)), "vy": 0, "vz": 0, "duration": 60}
        began = time.time()
        await self._ask("/movement/travel_at_ned?wait=false", new, target)
        await asyncio.sleep(CYCLE)
        requested = time.time()
        flown = [at for at in self._wire.setpoints if began < at < requested]
        self.gaps += [after - before for before, after in zip(flown, [*flown[1:], requested], strict=True)]
        if not flown:
            self._notes.fail("a movement sent no setpoint")
        await self._ask(path, new)
        for _ in range(100):  # the tap's thread may be a moment behind
            at = self._wire.first(command, requested)
            if at is not None:
                self.delays["new connection" if new else "kept connection"].append(at - requested)
                return
            await asyncio.sleep(0.02)
        self._notes.fail(f"{path} was answered, and nothing was sent")

    async def _ask(self, path: str, new: bool, body: Any = None) -> None:
        """One request, which must succeed.

        A new connection may be closed before its token was read: strangers at the same address open a thousand a
        second, and whoever has said nothing yet makes room. It is opened again, as HTTP clients do, and counted.
        """
        client = self._kept
        before = time.monotonic()
        for last in (False, False, True):
            if new or client is None:
                client = Client(self._port, f"Authorization: Bearer {TOKEN}\r\n")
                await client.open()
            try:
                status, answer = await client.ask(path, body)
                break
            except ConnectionError:
                if not new or last:
                    raise
                self.reset += 1
        self.answers.append(time.monotonic() - before)
        if new:
            client.close()
        else:
            self._kept = client
        if status not in (200, 202):
            self._notes.fail(f"{path} was answered {status} {answer!r}")


# -- the run ------------------------------------------------------------------------------------------------


def measure(made: Any, tap: Any, seconds: float, notes: Notes) -> None:
    """Fly for a while alone, then with the strangers."""
    wire = Wire(tap)
    asyncio.run((alone := Owner(made.port, wire, notes)).run(20.0))
    strangers = StrangersProcess()
    try:
        beset = Owner(made.port, wire, notes)
        before = None
        for part in (WARM_UP, seconds):
            strangers.begin(made.port, part)
            asyncio.run((beset := Owner(made.port, wire, notes)).run(part))
            counts = strangers.end()
            time.sleep(AT_REST)
            after = Usage.of(made.mavproxy.pid)
            print(f"  {part:.0f} s of strangers: {after}; {dict(counts)}", flush=True)
            if before is None:
                before = after
    finally:
        strangers.close()
    rows = []
    for who, owner in (("alone", alone), ("with strangers", beset)):
        for kind, delays in owner.delays.items():
            rows.append([f"{who}: stop on the wire, {kind}", str(len(delays)), *milliseconds(delays)])
        rows.append([f"{who}: answers", str(len(owner.answers)), *milliseconds(owner.answers)])
        rows.append([f"{who}: gaps between setpoints", str(len(owner.gaps)), *milliseconds(owner.gaps)])
    print(table(["ms", "count", "50 %", "99 %", "most"], rows))
    print(f"  new connections of the owner that strangers pushed out before they were read: {beset.reset}")
    if (late := percentile(sum(beset.delays.values(), []), 0.99)) > STOP_WITHIN:
        notes.fail(f"stops were on the wire within {1000 * late:.0f} ms")
    if max(beset.gaps) > INTERVAL + LATE_ALLOWED:
        notes.fail(f"there was no setpoint for {max(beset.gaps):.2f} s")
    if after.rss > before.rss + RSS_ALLOWED:
        notes.fail(f"memory grew by {after.rss - before.rss:.1f} MB")
    if after.descriptors > before.descriptors:
        notes.fail(f"descriptors: {before.descriptors} before, {after.descriptors} after")


def milliseconds(values: list[float]) -> list[str]:
    """Median, 99th percentile and the most."""
    return [f"{1000 * percentile(values, share):.1f}" for share in (0.5, 0.99, 1.0)]


def main() -> int:
    """Run, print what was measured, and say whether all was well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    options = parser.parse_args()
    print(f"strangers: {options.minutes:g} min; {machine()}", flush=True)
    notes = Notes()
    with rig(max_jobs=1000) as (made, tap):
        if options.first:
            put_first(*(process.pid for process in made.processes))
        fly(made)
        made.mavproxy.ask(f"uavapi set token {TOKEN}", "listening on")
        measure(made, tap, options.minutes * 60, notes)
        output = made.mavproxy.output()
        look_for_bad_words(output, notes)
        reported = [line for line in output.splitlines() if "refused" in line or "was closed for" in line]
        print(
            f"{len(reported)} lines of the log are about strangers"
            + "".join(f"\n  {line[:140]}" for line in reported[:6])
        )
        if len(reported) > 20 * (options.minutes + 3):
            notes.fail(f"{len(reported)} lines of the log are about strangers")
    print(f"{len(notes.failures)} failures" if notes.failures else "all is well")
    return 1 if notes.failures else 0


if __name__ == "__main__":
    sys.exit(main())
