from __future__ import annotations

import asyncio
import contextlib
import math
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding import spool_thread as spool_threads
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_thread import SpoolThread
from tests.support.virtual_time import FastLoop

SINK = "http://a"


class Disk:
    """Makes spools, and breaks them."""

    def __init__(self, loop: FastLoop, path: Path) -> None:
        self._loop, self.path = loop, path
        self.broken = ""
        self.spool: Spool | None = None

    def make(self) -> Spool:
        if self.broken:
            raise NotStored(self.broken)
        self.spool = Spool(self.path, 1e9, 1e9, clock=self._loop.time)
        return self.spool

    def fill(self) -> None:
        assert self.spool is not None
        (pages,) = self.spool._db.execute("PRAGMA page_count").fetchone()
        self.spool._db.execute(f"PRAGMA max_page_count={pages}")

    def make_room(self) -> None:
        assert self.spool is not None
        self.spool._db.execute("PRAGMA max_page_count=1000000")


@pytest.fixture
def disk(loop: FastLoop, tmp_path: Path, at_once: None) -> Disk:
    return Disk(loop, tmp_path / "spool.db")


def begin(loop: FastLoop, spool_thread: SpoolThread) -> None:
    """Start it, and let it open its file."""

    async def started() -> None:
        spool_thread.start([SINK])

    loop.run(started())
    loop.settle()


@pytest.fixture
def spool_thread(loop: FastLoop, disk: Disk) -> Iterator[SpoolThread]:
    spool_thread = SpoolThread(disk.make, loop.time)
    begin(loop, spool_thread)
    yield spool_thread
    loop.run(spool_thread.stop())


def reading(value: Any = 1.0) -> Reading:
    return Reading("uav-1", 1, "alt", "m", value, 0.0)


def taken(loop: FastLoop, spool_thread: SpoolThread, limit: int = 100) -> list[Any]:
    return [stored.reading.value for stored in loop.run(spool_thread.batch(SINK, limit))]


def test_sampled_readings_are_on_the_disk_within_half_a_second(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk
) -> None:
    for value in (1, 2, 3):
        spool_thread.put(reading(value))
    assert (spool_thread.count, spool_thread.waiting) == (0, 3)
    loop.pass_time(0.6)
    assert (spool_thread.count, spool_thread.waiting) == (3, 0)
    assert taken(loop, spool_thread) == [1, 2, 3]


def test_posted_readings_are_on_the_disk_when_it_answers(loop: FastLoop, spool_thread: SpoolThread) -> None:
    kept = loop.run(spool_thread.keep([reading(1), reading(2)]))
    assert len(kept) == 2 and spool_thread.count == 2


def test_a_batch_waits_until_there_is_something(loop: FastLoop, spool_thread: SpoolThread) -> None:
    began = loop.time()
    loop.call_later(5.0, spool_thread.put, reading(7))
    assert taken(loop, spool_thread) == [7]
    assert 5.0 <= loop.time() - began < 6.0


def test_what_is_acknowledged_goes_and_nothing_else(loop: FastLoop, spool_thread: SpoolThread) -> None:
    kept = loop.run(spool_thread.keep([reading(n) for n in range(4)]))
    batch = loop.run(spool_thread.batch(SINK, 3))
    loop.run(spool_thread.acknowledge(SINK, batch, {kept[0], kept[2], kept[3]}))  # kept[3] was never sent
    assert taken(loop, spool_thread) == [1, 3]


def test_a_full_disk_is_reported_and_sampled_readings_wait_in_memory(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk
) -> None:
    loop.run(spool_thread.keep([reading(0)]))
    disk.fill()
    for value in range(1, 4):
        spool_thread.put(reading(f"{value}" * 3000))
    loop.pass_time(5)
    assert "full" in spool_thread.problem and spool_thread.waiting == 3
    with pytest.raises(NotStored, match="full"):
        loop.run(spool_thread.keep([reading("x" * 3000)] * 10))
    disk.make_room()
    loop.pass_time(1)
    assert (spool_thread.problem, spool_thread.waiting, spool_thread.count) == ("", 0, 4)
    assert [value if value == 0 else value[0] for value in taken(loop, spool_thread)] == [0, "1", "2", "3"]


def test_full_disk_that_can_be_read_is_full_all_the_same(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    loop.run(spool_thread.keep([reading(0)]))
    disk.fill()
    spool_thread.put(reading("1" * 30_000))
    loop.pass_time(1)
    for _ in range(50):  # a sink that does not answer has the oldest read again and again
        assert taken(loop, spool_thread) == [0]
        assert "full" in spool_thread.problem
        loop.pass_time(0.3)
        assert "full" in spool_thread.problem
    disk.make_room()
    loop.pass_time(1)
    assert spool_thread.problem == ""
    output = [record.getMessage().partition(":")[0] for record in caplog.records]
    assert output == ["the spool fails", "the spool works again"]


def test_posted_reading_that_a_full_disk_refused_is_a_problem_for_a_while(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk
) -> None:
    loop.run(spool_thread.keep([reading(0)]))
    disk.fill()
    with pytest.raises(NotStored, match="full"):
        loop.run(spool_thread.keep([reading("1" * 30_000)]))
    assert taken(loop, spool_thread) == [0]
    assert "full" in spool_thread.problem
    loop.pass_time(spool_threads.TRIM_EVERY + 1)
    assert spool_thread.problem == ""  # nothing waits to be kept


def test_memory_is_bounded_and_what_it_drops_is_counted(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spool_threads, "HELD", 10)
    disk.fill()
    for value in range(25):
        spool_thread.put(reading(value))
    assert (spool_thread.waiting, spool_thread.dropped["disk"]) == (10, 15)
    disk.make_room()
    loop.pass_time(1)
    assert taken(loop, spool_thread) == list(range(15, 25))


def test_acknowledgements_that_the_disk_does_not_take_are_remembered(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = loop.run(spool_thread.keep([reading(n) for n in range(4)]))
    batch = loop.run(spool_thread.batch(SINK, 2))
    assert disk.spool is not None

    def full(sink: str, numbers: Any) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(disk.spool, "acknowledge", full)
        loop.run(spool_thread.acknowledge(SINK, batch, set(kept[:2])))
        assert "full" in spool_thread.problem
        assert taken(loop, spool_thread) == [2, 3]  # nothing is sent again
    assert taken(loop, spool_thread) == [2, 3]
    assert spool_thread.count == 2


def test_a_spool_that_cannot_be_opened_is_tried_again(loop: FastLoop, disk: Disk) -> None:
    disk.broken = "no room"
    spool_thread = SpoolThread(disk.make, loop.time)
    begin(loop, spool_thread)
    assert spool_thread.problem == "no room"
    spool_thread.put(reading(5))
    loop.pass_time(2)
    assert spool_thread.waiting == 1
    disk.broken = ""
    loop.pass_time(1)
    assert (spool_thread.problem, taken(loop, spool_thread)) == ("", [5])
    loop.run(spool_thread.stop())


def test_a_file_that_turns_out_corrupt_is_set_aside(loop: FastLoop, spool_thread: SpoolThread, disk: Disk) -> None:
    loop.run(spool_thread.keep([reading(n) for n in range(2000)]))
    assert disk.spool is not None
    disk.spool.close()
    content = bytearray(disk.path.read_bytes())
    content[8192:20480] = b"\xff" * 12288
    disk.path.write_bytes(content)
    disk.spool._open = lambda: None  # type: ignore[method-assign]
    disk.spool._db = sqlite3.connect(disk.path, isolation_level=None, check_same_thread=False)
    with pytest.raises(NotStored, match="malformed"):
        loop.run(spool_thread.batch(SINK, 2000))
    spool_thread.put(reading(7))
    loop.pass_time(1)
    assert [file.name for file in spool_thread.set_aside] == ["spool.db.corrupt-1"]
    assert taken(loop, spool_thread) == [7]


def test_stopping_keeps_what_still_waits(loop: FastLoop, disk: Disk) -> None:
    spool_thread = SpoolThread(disk.make, loop.time)
    begin(loop, spool_thread)
    spool_thread.put(reading(1))
    loop.run(spool_thread.stop())
    spool = Spool(disk.path, 1e9, 1e9)
    assert spool.count == 1
    spool.close()


def test_the_oldest_has_an_age(loop: FastLoop, spool_thread: SpoolThread) -> None:
    assert spool_thread.oldest_age is None
    loop.run(spool_thread.keep([reading()]))
    loop.pass_time(30)
    assert spool_thread.oldest_age == pytest.approx(30, abs=0.5)


@contextlib.contextmanager
def failing(monkeypatch: pytest.MonkeyPatch, name: str, error: Exception) -> Iterator[None]:
    """That method of every spool fails."""

    def fail(*_: Any) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(Spool, name, fail)
        yield


@pytest.mark.parametrize("name", ["trim", "oldest_since"])
def test_what_fails_after_readings_were_kept_does_not_keep_them_twice(
    loop: FastLoop, spool_thread: SpoolThread, disk: Disk, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    assert disk.spool is not None
    disk.spool.largest = 1 if name == "trim" else 1e9
    with failing(monkeypatch, name, sqlite3.OperationalError("database or disk is full")):
        assert len(loop.run(spool_thread.keep([reading(0)]))) == 1
        spool_thread.put(reading(1))
        loop.pass_time(3)
        assert "full" in spool_thread.problem and spool_thread.waiting == 0
        assert taken(loop, spool_thread) == [0, 1]
    disk.spool.largest = 1e9
    spool_thread.put(reading(2))
    loop.pass_time(1)
    assert (spool_thread.problem, taken(loop, spool_thread)) == ("", [0, 1, 2])


@pytest.mark.parametrize("wrong", [math.inf, math.nan, [math.inf]])
def test_a_value_that_cannot_be_stored_is_dropped_alone_and_counted(
    loop: FastLoop, spool_thread: SpoolThread, wrong: Any
) -> None:
    for value in (1, wrong, 2):
        spool_thread.put(reading(value))
    loop.pass_time(1)
    spool_thread.put(reading(3))
    loop.pass_time(1)
    assert taken(loop, spool_thread) == [1, 2, 3]
    assert spool_thread.dropped == {"value": 1}


def test_defect_loses_no_reading_is_told_once_and_leaves_no_file_open(
    loop: FastLoop, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    spool_thread = SpoolThread(disk.make, loop.time)
    begin(loop, spool_thread)
    with failing(monkeypatch, "append", RuntimeError("a defect")):
        spool_thread.put(reading(1))
        loop.pass_time(5)
        assert spool_thread.waiting == 1 and "a defect" in spool_thread.problem
        with pytest.raises(NotStored, match="a defect"):
            loop.run(spool_thread.keep([reading(2)]))
    assert [str(defect["exception"]) for defect in loop.defects] == ["a defect"]
    loop.defects.clear()
    loop.pass_time(1)
    assert (spool_thread.problem, taken(loop, spool_thread)) == ("", [1])
    with failing(monkeypatch, "append", RuntimeError("another defect")):
        spool_thread.put(reading(3))
        loop.run(spool_thread.stop())
    assert len(spool_thread.left) == 1
    assert [str(defect["exception"]) for defect in loop.defects] == ["another defect"]
    loop.defects.clear()
    Spool(disk.path, 1e9, 1e9).close()  # not locked


def test_a_disk_that_is_full_from_the_start_still_gives_what_it_has(
    loop: FastLoop, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(Spool(disk.path, 1e9, 1e9)) as before:
        before.append([reading(1)])
    spool_thread = SpoolThread(disk.make, loop.time)
    with failing(monkeypatch, "trim", sqlite3.OperationalError("database or disk is full")):
        begin(loop, spool_thread)
        assert "full" in spool_thread.problem
        assert taken(loop, spool_thread) == [1]
    loop.run(spool_thread.stop())


def test_what_the_disk_does_not_take_is_handed_back_at_the_end(loop: FastLoop, disk: Disk) -> None:
    spool_thread = SpoolThread(disk.make, loop.time)
    begin(loop, spool_thread)
    disk.fill()
    for value in range(3):
        spool_thread.put(reading(f"{value}" * 3000))
    loop.pass_time(1)
    loop.run(spool_thread.stop())
    assert [left.value[0] for left in spool_thread.left] == ["0", "1", "2"]
    with pytest.raises(NotStored, match="stopping"):
        loop.run(spool_thread.keep([reading(1)]))


def test_while_the_file_is_being_opened_it_says_so(loop: FastLoop, disk: Disk) -> None:
    spool_thread = SpoolThread(disk.make, loop.time)

    async def started() -> tuple[str, int | None]:
        spool_thread.start([SINK])
        return spool_thread.problem, spool_thread.count

    assert loop.run(started()) == ("it is being opened", None)  # what is in it nobody knows
    loop.settle()
    assert (spool_thread.problem, spool_thread.count) == ("", 0)
    loop.run(spool_thread.stop())


def test_the_log_reports_a_full_disk_once_and_drops_once_a_minute(
    loop: FastLoop,
    spool_thread: SpoolThread,
    disk: Disk,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(spool_threads, "HELD", 10)
    with failing(monkeypatch, "append", sqlite3.OperationalError("database or disk is full")):
        for value in range(100):
            spool_thread.put(reading(value))
            loop.pass_time(1)
    loop.pass_time(1)
    failed, first, second, works = (record.message for record in caplog.records)
    assert failed == f"the spool fails: {disk.path}: database or disk is full"
    assert first == "readings were dropped: 1 by disk"
    assert second.endswith(" by disk")
    assert works == "the spool works again"


def test_the_log_names_the_file_that_was_set_aside(
    loop: FastLoop, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    with contextlib.closing(Spool(disk.path, 1e9, 1e9)) as spool:
        spool.append([reading()] * 2000)
    content = bytearray(disk.path.read_bytes())
    content[8192:20480] = b"\xff" * 12288
    disk.path.write_bytes(content)
    spool_thread = SpoolThread(disk.make, loop.time)
    begin(loop, spool_thread)
    assert [record.message.rpartition("/")[2] for record in caplog.records] == ["spool.db.corrupt-1"]
    loop.run(spool_thread.stop())


def test_a_stop_that_is_cancelled_behind_a_slow_disk_still_closes_the_file(tmp_path: Path) -> None:
    path, slow, busy = tmp_path / "spool.db", threading.Event(), threading.Event()

    def hang(_: Spool) -> None:
        busy.set()
        slow.wait(30)

    async def scenario() -> ThreadPoolExecutor:
        spool_thread = SpoolThread(lambda: Spool(path, 1e9, 1e9))
        spool_thread.start([SINK])
        await spool_thread.keep([reading()])
        work = asyncio.create_task(spool_thread._do(hang))
        await asyncio.to_thread(busy.wait, 30)
        stop = asyncio.create_task(spool_thread.stop())
        for _ in range(3):  # as a module's end does, and then the loop's
            await asyncio.sleep(0.05)
            stop.cancel()
        slow.set()
        await asyncio.gather(work, stop, return_exceptions=True)
        return spool_thread._thread

    thread = asyncio.run(scenario())
    thread.shutdown()
    with contextlib.closing(sqlite3.connect(path, timeout=0)) as db:
        assert db.execute("SELECT count(*) FROM readings").fetchone() == (1,)


def test_a_save_that_is_cancelled_behind_a_slow_disk_writes_nothing_twice(tmp_path: Path) -> None:
    path, slow, busy = tmp_path / "spool.db", threading.Event(), threading.Event()

    class SlowSpool(Spool):
        def append(self, readings: Sequence[Reading]) -> list[int]:
            busy.set()
            slow.wait(30)
            return super().append(readings)

    async def scenario() -> list[Reading]:
        spool_thread = SpoolThread(lambda: SlowSpool(path, 1e9, 1e9))
        spool_thread._cursors = {}
        for number in range(10):
            spool_thread.put(reading(number))
        saving = asyncio.create_task(spool_thread.save())
        await asyncio.to_thread(busy.wait, 30)
        saving.cancel()  # a module's end waits no longer
        await asyncio.gather(saving, return_exceptions=True)
        assert spool_thread.waiting == 10
        slow.set()
        await spool_thread.stop()
        return spool_thread.left

    assert asyncio.run(scenario()) == []
    with contextlib.closing(sqlite3.connect(path, timeout=0)) as db:
        assert db.execute("SELECT count(*) FROM readings").fetchone() == (10,)
