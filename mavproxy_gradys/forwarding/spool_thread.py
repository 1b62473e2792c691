"""Runs the spool in its own thread: calls do not block asyncio, and readings survive a temporarily full disk."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sqlite3
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.readings import Reading, Stored
from mavproxy_gradys.forwarding.sink_cursor import SinkCursor
from mavproxy_gradys.forwarding.spool import Spool, uptime
from mavproxy_gradys.forwarding.spool_rows import is_storable
from mavproxy_gradys.net.outage_log import Defects, Drops, Outage
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.timeout import wait_with_timeout

T = TypeVar("T")
log = logging.getLogger("gradys.spool")

COMMIT_EVERY = 0.5  # s between transactions for sampled readings
TRIM_EVERY = 10.0  # s
CLOSING_POLL = 0.01  # s
HELD = 5000  # sampled readings held in memory while they cannot be written; beyond it the oldest are dropped


class SpoolThread:
    """Stores readings. All methods belong to the asyncio thread; another thread does all work on the disk.

    Attributes:
        count: number of readings in the spool; None until it is open.
        problem: why the spool cannot write now; empty without a problem.
        set_aside: corrupt files that were replaced.
        dropped: number of dropped readings by cause: `size`, `age`, `disk` (not written), `damage` (a damaged row),
            `value` (a value that cannot be stored).

    Args:
        make: opens the spool; may raise NotStored.
        clock: uptime (s), the spool's own clock.
    """

    def __init__(self, make: Callable[[], Spool], clock: Callable[[], float] = uptime) -> None:
        self._make = make
        self._clock = clock
        self._spool: Spool | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gradys-spool")
        self._waiting: deque[Reading] = deque()
        self._being_written: list[Reading] = []  # by the other thread, which alone sets it
        self._cursors: dict[str, SinkCursor] = {}
        self._tasks = HeldTasks()
        self._writer: asyncio.Task[None] | None = None
        self._stopping = asyncio.Event()
        self._closed = False
        self._outage = Outage(log, "the spool fails", "the spool works again")
        self._write_failed = False  # whether the newest attempt to write failed
        self._defects = Defects("the spool")
        self._drops = Drops(log, clock)
        self._oldest_since: float | None = None
        self.count: int | None = None
        self.problem = ""
        self.set_aside: list[Path] = []
        self.dropped: dict[str, int] = {}

    def start(self, sinks: Sequence[str]) -> None:
        """Begin to open the spool for these sinks, with retries; until it is open, `problem` has the reason."""
        self._cursors = {sink: SinkCursor() for sink in sinks}
        self.problem = "it is being opened"
        self._writer = self._tasks.start(self._write(), "the spool")

    async def stop(self) -> None:
        """Write the waiting readings and close the file; readings that cannot be written are in `left`."""
        self._stopping.set()  # the writer is not cancelled: the result of a transaction in flight must not be lost
        try:
            if self._writer is not None:
                await asyncio.gather(self._writer, return_exceptions=True)
            await self.save()
        finally:
            self._closed = True
            closing = self._thread.submit(self._close)  # it runs even if this task is cancelled
            self._thread.shutdown(wait=False)
        # A task that awaits it would, when cancelled, cancel the closing that still waits for the thread.
        while not closing.done():  # noqa: ASYNC110
            await asyncio.sleep(CLOSING_POLL)
        closing.result()
        self._thread.shutdown()  # it has nothing left to do
        self._drops.report(self.dropped, at_once=True)

    @property
    def left(self) -> list[Reading]:
        """The readings that were not written, or not in time."""
        return [*self._being_written, *self._waiting]

    # -- in -----------------------------------------------------------------------------------------------

    def put(self, reading: Reading) -> None:
        """Take a sampled reading; it is written within COMMIT_EVERY."""
        if not is_storable(reading):
            self._count_drop("value")
            return
        self._waiting.append(reading)
        self._drop_excess()

    def _drop_excess(self) -> None:
        while len(self._waiting) > HELD:
            self._waiting.popleft()
            self._count_drop("disk")

    async def keep(self, readings: Sequence[Reading]) -> list[int]:
        """Store readings; returns their sequence numbers once they are on the disk.

        Raises:
            NotStored: none of them was written.
        """
        numbers = await self._do(lambda spool: spool.append(readings))
        self._notify_senders()
        return numbers

    async def _write(self) -> None:
        with contextlib.suppress(NotStored):  # `problem` has the reason; the readings wait for the next attempt
            await self._trim()
        trimmed = self._clock()
        while not self._stopping.is_set():
            with contextlib.suppress(asyncio.TimeoutError):
                await wait_with_timeout(COMMIT_EVERY, self._stopping.wait())
            with contextlib.suppress(NotStored):
                await self._commit()
                if self._clock() - trimmed >= TRIM_EVERY:
                    trimmed = self._clock()
                    await self._trim()
            self._drops.report(self.dropped)

    async def _trim(self) -> None:
        # If nothing was deleted, a success does not prove that writing works. Only waiting readings need the proof.
        await self._do(lambda spool: None, trim=True, writes=not self._waiting)

    async def save(self) -> None:
        """Write the waiting readings, if possible."""
        with contextlib.suppress(NotStored):  # `problem` has the reason
            await self._commit()

    async def _commit(self) -> None:
        if not self._waiting:
            return
        try:
            await self._do(self._write_waiting)
        finally:
            self._drop_excess()  # new readings may have arrived meanwhile
        self._notify_senders()

    def _write_waiting(self, spool: Spool) -> None:
        """Write the waiting readings, in the other thread: a cancelled caller cannot make it forget what is written.

        Raises:
            sqlite3.Error: they still wait.
        """
        readings = self._being_written = [self._waiting.popleft() for _ in range(len(self._waiting))]
        try:
            spool.append(readings)
        except BaseException:
            self._waiting.extendleft(reversed(readings))
            raise
        finally:
            self._being_written = []

    def _notify_senders(self) -> None:
        for cursor in self._cursors.values():
            cursor.news.set()

    # -- out ----------------------------------------------------------------------------------------------

    async def batch(self, sink: str, limit: int) -> list[Stored]:
        """The oldest readings that a sink has not acknowledged; waits until there is at least one.

        Raises:
            NotStored: the file cannot be read.
        """
        cursor = self._cursors[sink]
        while True:
            cursor.news.clear()
            batch = await self._batch(sink, cursor, limit)
            if batch:
                return batch
            with contextlib.suppress(asyncio.TimeoutError):
                await wait_with_timeout(TRIM_EVERY, cursor.news.wait())

    async def _batch(self, sink: str, cursor: SinkCursor, limit: int) -> list[Stored]:
        if cursor.unnoted:
            await self._note(sink, cursor, set())
        count = limit + cursor.most_skipped
        batch = await self._do(lambda spool: spool.batch(sink, cursor.after, count), writes=False)
        return cursor.choose(batch, limit)

    async def acknowledge(self, sink: str, batch: Sequence[Stored], numbers: set[int]) -> None:
        """Note that a sink has acknowledged those of `batch` that are in `numbers`, and no others."""
        cursor, taken = self._cursors[sink], {stored.seq for stored in batch} & numbers
        cursor.take(batch, taken)
        await self._note(sink, cursor, taken)

    async def _note(self, sink: str, cursor: SinkCursor, numbers: set[int]) -> None:
        cursor.unnoted |= numbers  # so that they are not sent again, even on a full disk
        noted = sorted(cursor.unnoted)
        with contextlib.suppress(NotStored):
            await self._do(lambda spool: spool.acknowledge(sink, noted))
            cursor.unnoted.difference_update(noted)

    def put_last(self, sink: str, refused: Stored) -> None:
        """Send a reading that a sink refuses in a batch of its own when nothing else waits."""
        self._cursors[sink].put_last(refused.seq)

    def flush(self) -> None:
        """Make waiting senders check for readings at once."""
        self._notify_senders()

    # -- the other thread ---------------------------------------------------------------------------------

    async def _do(self, work: Callable[[Spool], T], *, trim: bool = False, writes: bool = True) -> T:
        """Do `work` on the spool in the other thread; it is opened if necessary.

        Args:
            work: what to do.
            trim: whether to trim the spool afterwards.
            writes: whether a success proves that writing works; a full disk can still be read.

        Raises:
            NotStored: it failed. `problem` has the reason until something succeeds; after a failed write only a
                successful write clears it.
        """
        if self._closed:
            raise NotStored("gradys is stopping")
        try:
            result, problem = await asyncio.get_running_loop().run_in_executor(self._thread, self._work, work, trim)
        except NotStored as error:
            self._outage.update(self._note_problem(str(error), writes))
            raise
        except Exception as error:
            self._defects.report(error)
            raise NotStored(self._note_problem(f"{type(error).__name__}: {error}", writes)) from error
        self._outage.update(self._note_problem(problem, writes))
        return result

    def _note_problem(self, problem: str, writes: bool) -> str:
        """Update `problem` after an attempt to write or to read that ended with `problem`, and return it."""
        if not problem and not writes and self._write_failed:
            return self.problem
        self._write_failed = bool(problem) and (writes or self._write_failed)
        self.problem = problem
        return problem

    def _work(self, work: Callable[[Spool], T], trim: bool) -> tuple[T, str]:
        """The result, and a problem that occurred after the work."""
        spool = self._spool or self._open()
        try:
            result = work(spool)
        except (sqlite3.OperationalError, sqlite3.IntegrityError) as error:
            raise NotStored(f"{spool.path}: {error}") from error
        except sqlite3.DatabaseError as error:  # corrupt: the next opening sets the file aside
            self._close()
            raise NotStored(f"{spool.path}: {error}") from error
        try:
            if trim or spool.damaged or spool.size > spool.largest:
                spool.trim()
            self._update_counts(spool)
        except sqlite3.Error as error:
            return result, f"{spool.path}: {error}"
        return result, ""

    def _open(self) -> Spool:
        if self._closed:
            raise NotStored("gradys is stopping")
        spool = self._make()
        if spool.set_aside is not None:
            self.set_aside.append(spool.set_aside)
            log.warning("the file of the readings was corrupt; it was set aside: %s", spool.set_aside)
        self._drops.known(spool.dropped)
        try:
            spool.use_sinks(list(self._cursors))
        except sqlite3.Error as error:
            spool.close()
            raise NotStored(f"{spool.path}: {error}") from error
        for cursor in self._cursors.values():
            cursor.forget()
        self._spool = spool
        return spool

    def _close(self) -> None:
        spool, self._spool = self._spool, None
        if spool is not None:
            spool.close()

    def _update_counts(self, spool: Spool) -> None:
        self.count = spool.count
        self.dropped.update(spool.dropped)
        self._oldest_since = spool.oldest_since()

    def _count_drop(self, cause: str) -> None:
        self.dropped[cause] = self.dropped.get(cause, 0) + 1

    @property
    def waiting(self) -> int:
        """The number of readings that are not on the disk yet."""
        return len(self._waiting) + len(self._being_written)

    @property
    def oldest_age(self) -> float | None:
        """Age (s) of the oldest reading that some sink has not acknowledged; None without one."""
        return None if self._oldest_since is None else max(self._clock() - self._oldest_since, 0.0)
