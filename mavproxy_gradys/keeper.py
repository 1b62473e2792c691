"""The spool seen from the asyncio thread: it blocks nobody, and readings outlast a disk that is full for a while."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.readings import Reading, Stored
from mavproxy_gradys.spool import Spool, uptime

T = TypeVar("T")

COMMIT_EVERY = 0.5  # s that sampled readings wait for one transaction
TRIM_EVERY = 10.0  # s
HELD = 5000  # sampled readings held in memory while the disk takes none; then the oldest are dropped


class Keeper:
    """Keeps readings; all methods belong to the asyncio thread, all work on the disk is done in another.

    Attributes:
        count: readings in the spool.
        problem: why the spool takes nothing just now; empty when it does.
        set_aside: corrupt files that were replaced.
        dropped: readings that were dropped, by cause: `size`, `age`, `disk`.

    Args:
        make: opens the spool; may raise NotStored.
        clock: uptime (s), the spool's own.
    """

    def __init__(self, make: Callable[[], Spool], clock: Callable[[], float] = uptime) -> None:
        self._make = make
        self._clock = clock
        self._spool: Spool | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gradys-spool")
        self._waiting: deque[Reading] = deque()
        self._in_hand = 0  # readings that the other thread is writing
        self._unnoted: dict[str, set[int]] = {}  # acknowledgements that the disk did not take
        self._after: dict[str, int] = {}  # the number up to which a sink has acknowledged all
        self._news: dict[str, asyncio.Event] = {}
        self._writer: asyncio.Task[None] | None = None
        self._stopping = asyncio.Event()
        self._oldest_since: float | None = None
        self.count = 0
        self.problem = ""
        self.set_aside: list[Path] = []
        self.dropped: dict[str, int] = {}

    async def start(self, sinks: Sequence[str]) -> None:
        """Open the spool for these sinks; when it cannot be opened, `problem` says why and it is tried again."""
        self._news = {sink: asyncio.Event() for sink in sinks}
        self._after = dict.fromkeys(sinks, -1)
        with contextlib.suppress(NotStored):  # `problem` has it
            await self._do(lambda spool: None)
        self._writer = asyncio.get_running_loop().create_task(self._write())

    async def stop(self) -> None:
        """Keep what still waits, and close the file."""
        self._stopping.set()  # not cancelled: a transaction in flight must not be forgotten
        if self._writer is not None:
            await self._writer
        with contextlib.suppress(NotStored):
            await self._commit()
        spool, self._spool = self._spool, None
        if spool is not None:
            await self._run(spool.close)
        self._thread.shutdown()  # it has nothing left to do

    # -- in -----------------------------------------------------------------------------------------------

    def put(self, reading: Reading) -> None:
        """Take a sampled reading; it is on the disk within COMMIT_EVERY."""
        self._waiting.append(reading)
        if len(self._waiting) > HELD:
            self._waiting.popleft()
            self._count_drop("disk")

    async def keep(self, readings: Sequence[Reading]) -> list[int]:
        """Take readings; their sequence numbers, when they are on the disk.

        Raises:
            NotStored: the disk took none of them.
        """
        numbers = await self._do(lambda spool: spool.append(readings))
        self._tell()
        return numbers

    async def _write(self) -> None:
        trimmed = self._clock()
        while not self._stopping.is_set():
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), COMMIT_EVERY)
            with contextlib.suppress(NotStored):  # `problem` has it; the readings wait for the next time
                await self._commit()
                if self._clock() - trimmed >= TRIM_EVERY:
                    trimmed = self._clock()
                    await self._do(lambda spool: None, trim=True)

    async def _commit(self) -> None:
        if not self._waiting:
            return
        readings = [self._waiting.popleft() for _ in range(len(self._waiting))]
        self._in_hand = len(readings)
        try:
            await self._do(lambda spool: spool.append(readings))
        except NotStored:
            self._waiting.extendleft(reversed(readings))
            raise
        finally:
            self._in_hand = 0
        self._tell()

    def _tell(self) -> None:
        for news in self._news.values():
            news.set()

    # -- out ----------------------------------------------------------------------------------------------

    async def batch(self, sink: str, limit: int) -> list[Stored]:
        """The oldest readings that a sink has not acknowledged; waits until there are some.

        Raises:
            NotStored: the file cannot be read.
        """
        while True:
            self._news[sink].clear()
            found = await self._batch(sink, limit)
            if found:
                return found
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._news[sink].wait(), TRIM_EVERY)

    async def _batch(self, sink: str, limit: int) -> list[Stored]:
        unnoted = self._unnoted.get(sink, set())
        if unnoted:
            await self._note(sink, set())
        after = self._after[sink]
        found = await self._do(lambda spool: spool.batch(sink, after, limit + len(unnoted)))
        return [stored for stored in found if stored.seq not in unnoted][:limit]

    async def acknowledge(self, sink: str, batch: Sequence[Stored], numbers: set[int]) -> None:
        """Remove what a sink has acknowledged: those of `batch` that are in `numbers`, and no others."""
        taken = {stored.seq for stored in batch} & numbers
        if len(taken) == len(batch):
            self._after[sink] = batch[-1].seq
        await self._note(sink, taken)

    async def _note(self, sink: str, numbers: set[int]) -> None:
        numbers = numbers | self._unnoted.pop(sink, set())
        try:
            await self._do(lambda spool: spool.acknowledge(sink, sorted(numbers)))
        except NotStored:  # a full disk: they are not sent again while we remember
            self._unnoted[sink] = numbers

    def flush(self) -> None:
        """Have waiting senders look at once."""
        self._tell()

    # -- the other thread ---------------------------------------------------------------------------------

    async def _do(self, work: Callable[[Spool], T], trim: bool = False) -> T:
        """Do `work` on the spool in the other thread, opening it if need be.

        Raises:
            NotStored: it failed; `problem` says why until something succeeds.
        """
        try:
            result = await self._run(lambda: self._work(work, trim))
        except NotStored as error:
            self.problem = str(error)
            raise
        self.problem = ""
        return result

    async def _run(self, call: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, call)

    def _work(self, work: Callable[[Spool], T], trim: bool) -> T:
        spool = self._spool or self._open()
        try:
            result = work(spool)
            if trim or spool.size > spool.largest:
                spool.trim()
        except sqlite3.OperationalError as error:
            raise NotStored(f"{spool.path}: {error}") from error
        except sqlite3.DatabaseError as error:  # corrupt: the next opening sets the file aside
            self._spool = None
            spool.close()
            raise NotStored(f"{spool.path}: {error}") from error
        self._look(spool)
        return result

    def _open(self) -> Spool:
        spool = self._make()
        if spool.set_aside is not None:
            self.set_aside.append(spool.set_aside)
        try:
            spool.use_sinks(list(self._news))
            spool.trim()
        except sqlite3.Error as error:
            spool.close()
            raise NotStored(f"{spool.path}: {error}") from error
        self._after = dict.fromkeys(self._after, -1)  # a new file may begin with lower numbers
        self._unnoted.clear()
        self._spool = spool
        return spool

    def _look(self, spool: Spool) -> None:
        self.count = spool.count
        self.dropped.update(spool.dropped)
        self._oldest_since = spool.oldest_since()

    def _count_drop(self, cause: str) -> None:
        self.dropped[cause] = self.dropped.get(cause, 0) + 1

    @property
    def waiting(self) -> int:
        """Readings that are not on the disk yet."""
        return len(self._waiting) + self._in_hand

    @property
    def oldest_age(self) -> float | None:
        """Age (s) of the oldest reading that not every sink has acknowledged; None when there is none."""
        return None if self._oldest_since is None else max(self._clock() - self._oldest_since, 0.0)
