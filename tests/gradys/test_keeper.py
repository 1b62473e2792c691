from __future__ import annotations

import contextlib
import math
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys import keeper as keepers
from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.keeper import Keeper
from mavproxy_gradys.readings import Reading
from mavproxy_gradys.spool import Spool

SINK = "http://a"


class Disk:
    """Makes spools, and breaks them."""

    def __init__(self, loop: Any, path: Path) -> None:
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
def disk(loop: Any, tmp_path: Path, at_once: None) -> Disk:
    return Disk(loop, tmp_path / "spool.db")


def begin(loop: Any, keeper: Keeper) -> None:
    """Start it, and let it open its file."""

    async def started() -> None:
        keeper.start([SINK])

    loop.run(started())
    loop.settle()


@pytest.fixture
def keeper(loop: Any, disk: Disk) -> Iterator[Keeper]:
    keeper = Keeper(disk.make, loop.time)
    begin(loop, keeper)
    yield keeper
    loop.run(keeper.stop())


def reading(value: Any = 1.0) -> Reading:
    return Reading("uav-1", 1, "alt", "m", value, 0.0)


def taken(loop: Any, keeper: Keeper, limit: int = 100) -> list[Any]:
    return [stored.reading.value for stored in loop.run(keeper.batch(SINK, limit))]


def test_sampled_readings_are_on_the_disk_within_half_a_second(loop: Any, keeper: Keeper, disk: Disk) -> None:
    for value in (1, 2, 3):
        keeper.put(reading(value))
    assert (keeper.count, keeper.waiting) == (0, 3)
    loop.pass_time(0.6)
    assert (keeper.count, keeper.waiting) == (3, 0)
    assert taken(loop, keeper) == [1, 2, 3]


def test_posted_readings_are_on_the_disk_when_it_answers(loop: Any, keeper: Keeper) -> None:
    kept = loop.run(keeper.keep([reading(1), reading(2)]))
    assert len(kept) == 2 and keeper.count == 2


def test_a_batch_waits_until_there_is_something(loop: Any, keeper: Keeper) -> None:
    began = loop.time()
    loop.call_later(5.0, keeper.put, reading(7))
    assert taken(loop, keeper) == [7]
    assert 5.0 <= loop.time() - began < 6.0


def test_what_is_acknowledged_goes_and_nothing_else(loop: Any, keeper: Keeper) -> None:
    kept = loop.run(keeper.keep([reading(n) for n in range(4)]))
    batch = loop.run(keeper.batch(SINK, 3))
    loop.run(keeper.acknowledge(SINK, batch, {kept[0], kept[2], kept[3]}))  # kept[3] was never sent
    assert taken(loop, keeper) == [1, 3]


def test_a_full_disk_is_said_and_sampled_readings_wait_in_memory(loop: Any, keeper: Keeper, disk: Disk) -> None:
    loop.run(keeper.keep([reading(0)]))
    disk.fill()
    for value in range(1, 4):
        keeper.put(reading(f"{value}" * 3000))
    loop.pass_time(5)
    assert "full" in keeper.problem and keeper.waiting == 3
    with pytest.raises(NotStored, match="full"):
        loop.run(keeper.keep([reading("x" * 3000)] * 10))
    disk.make_room()
    loop.pass_time(1)
    assert (keeper.problem, keeper.waiting, keeper.count) == ("", 0, 4)
    assert [value if value == 0 else value[0] for value in taken(loop, keeper)] == [0, "1", "2", "3"]


def test_full_disk_that_can_be_read_is_full_all_the_same(
    loop: Any, keeper: Keeper, disk: Disk, caplog: pytest.LogCaptureFixture
) -> None:
    loop.run(keeper.keep([reading(0)]))
    disk.fill()
    keeper.put(reading("1" * 30_000))
    loop.pass_time(1)
    for _ in range(50):  # a sink that does not answer has the oldest read again and again
        assert taken(loop, keeper) == [0]
        assert "full" in keeper.problem
        loop.pass_time(0.3)
        assert "full" in keeper.problem
    disk.make_room()
    loop.pass_time(1)
    assert keeper.problem == ""
    said = [record.getMessage().partition(":")[0] for record in caplog.records]
    assert said == ["the spool fails", "the spool works again"]


def test_posted_reading_that_a_full_disk_refused_is_a_problem_for_a_while(
    loop: Any, keeper: Keeper, disk: Disk
) -> None:
    loop.run(keeper.keep([reading(0)]))
    disk.fill()
    with pytest.raises(NotStored, match="full"):
        loop.run(keeper.keep([reading("1" * 30_000)]))
    assert taken(loop, keeper) == [0]
    assert "full" in keeper.problem
    loop.pass_time(keepers.TRIM_EVERY + 1)
    assert keeper.problem == ""  # nothing waits to be kept


def test_memory_is_bounded_and_what_it_drops_is_counted(
    loop: Any, keeper: Keeper, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keepers, "HELD", 10)
    disk.fill()
    for value in range(25):
        keeper.put(reading(value))
    assert (keeper.waiting, keeper.dropped["disk"]) == (10, 15)
    disk.make_room()
    loop.pass_time(1)
    assert taken(loop, keeper) == list(range(15, 25))


def test_acknowledgements_that_the_disk_does_not_take_are_remembered(
    loop: Any, keeper: Keeper, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = loop.run(keeper.keep([reading(n) for n in range(4)]))
    batch = loop.run(keeper.batch(SINK, 2))
    assert disk.spool is not None

    def full(sink: str, numbers: Any) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(disk.spool, "acknowledge", full)
        loop.run(keeper.acknowledge(SINK, batch, set(kept[:2])))
        assert "full" in keeper.problem
        assert taken(loop, keeper) == [2, 3]  # nothing is sent again
    assert taken(loop, keeper) == [2, 3]
    assert keeper.count == 2


def test_a_spool_that_cannot_be_opened_is_tried_again(loop: Any, disk: Disk) -> None:
    disk.broken = "no room"
    keeper = Keeper(disk.make, loop.time)
    begin(loop, keeper)
    assert keeper.problem == "no room"
    keeper.put(reading(5))
    loop.pass_time(2)
    assert keeper.waiting == 1
    disk.broken = ""
    loop.pass_time(1)
    assert (keeper.problem, taken(loop, keeper)) == ("", [5])
    loop.run(keeper.stop())


def test_a_file_that_turns_out_corrupt_is_set_aside(loop: Any, keeper: Keeper, disk: Disk) -> None:
    loop.run(keeper.keep([reading(n) for n in range(2000)]))
    assert disk.spool is not None
    disk.spool.close()
    content = bytearray(disk.path.read_bytes())
    content[8192:20480] = b"\xff" * 12288
    disk.path.write_bytes(content)
    disk.spool._open = lambda: None  # type: ignore[method-assign]
    disk.spool._db = sqlite3.connect(disk.path, isolation_level=None, check_same_thread=False)
    with pytest.raises(NotStored, match="malformed"):
        loop.run(keeper.batch(SINK, 2000))
    keeper.put(reading(7))
    loop.pass_time(1)
    assert [file.name for file in keeper.set_aside] == ["spool.db.corrupt-1"]
    assert taken(loop, keeper) == [7]


def test_stopping_keeps_what_still_waits(loop: Any, disk: Disk) -> None:
    keeper = Keeper(disk.make, loop.time)
    begin(loop, keeper)
    keeper.put(reading(1))
    loop.run(keeper.stop())
    spool = Spool(disk.path, 1e9, 1e9)
    assert spool.count == 1
    spool.close()


def test_the_oldest_has_an_age(loop: Any, keeper: Keeper) -> None:
    assert keeper.oldest_age is None
    loop.run(keeper.keep([reading()]))
    loop.pass_time(30)
    assert keeper.oldest_age == pytest.approx(30, abs=0.5)


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
    loop: Any, keeper: Keeper, disk: Disk, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    assert disk.spool is not None
    disk.spool.largest = 1 if name == "trim" else 1e9
    with failing(monkeypatch, name, sqlite3.OperationalError("database or disk is full")):
        assert len(loop.run(keeper.keep([reading(0)]))) == 1
        keeper.put(reading(1))
        loop.pass_time(3)
        assert "full" in keeper.problem and keeper.waiting == 0
        assert taken(loop, keeper) == [0, 1]
    disk.spool.largest = 1e9
    keeper.put(reading(2))
    loop.pass_time(1)
    assert (keeper.problem, taken(loop, keeper)) == ("", [0, 1, 2])


@pytest.mark.parametrize("wrong", [math.inf, math.nan, [math.inf]])
def test_a_value_that_cannot_be_told_is_dropped_alone_and_counted(loop: Any, keeper: Keeper, wrong: Any) -> None:
    for value in (1, wrong, 2):
        keeper.put(reading(value))
    loop.pass_time(1)
    keeper.put(reading(3))
    loop.pass_time(1)
    assert taken(loop, keeper) == [1, 2, 3]
    assert keeper.dropped == {"value": 1}


def test_a_defect_loses_no_reading_is_told_once_and_leaves_no_file_open(
    loop: Any, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    keeper = Keeper(disk.make, loop.time)
    begin(loop, keeper)
    with failing(monkeypatch, "append", RuntimeError("a defect")):
        keeper.put(reading(1))
        loop.pass_time(5)
        assert keeper.waiting == 1 and "a defect" in keeper.problem
        with pytest.raises(NotStored, match="a defect"):
            loop.run(keeper.keep([reading(2)]))
    assert [str(defect["exception"]) for defect in loop.defects] == ["a defect"]
    loop.defects.clear()
    loop.pass_time(1)
    assert (keeper.problem, taken(loop, keeper)) == ("", [1])
    with failing(monkeypatch, "append", RuntimeError("another defect")):
        keeper.put(reading(3))
        loop.run(keeper.stop())
    assert len(keeper.left) == 1
    assert [str(defect["exception"]) for defect in loop.defects] == ["another defect"]
    loop.defects.clear()
    Spool(disk.path, 1e9, 1e9).close()  # not locked


def test_a_disk_that_is_full_from_the_start_still_gives_what_it_has(
    loop: Any, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(Spool(disk.path, 1e9, 1e9)) as before:
        before.append([reading(1)])
    keeper = Keeper(disk.make, loop.time)
    with failing(monkeypatch, "trim", sqlite3.OperationalError("database or disk is full")):
        begin(loop, keeper)
        assert "full" in keeper.problem
        assert taken(loop, keeper) == [1]
    loop.run(keeper.stop())


def test_what_the_disk_does_not_take_is_handed_back_at_the_end(loop: Any, disk: Disk) -> None:
    keeper = Keeper(disk.make, loop.time)
    begin(loop, keeper)
    disk.fill()
    for value in range(3):
        keeper.put(reading(f"{value}" * 3000))
    loop.pass_time(1)
    loop.run(keeper.stop())
    assert [left.value[0] for left in keeper.left] == ["0", "1", "2"]
    with pytest.raises(NotStored, match="stopping"):
        loop.run(keeper.keep([reading(1)]))


def test_while_the_file_is_being_opened_it_says_so(loop: Any, disk: Disk) -> None:
    keeper = Keeper(disk.make, loop.time)

    async def started() -> tuple[str, int | None]:
        keeper.start([SINK])
        return keeper.problem, keeper.count

    assert loop.run(started()) == ("it is being opened", None)  # what is in it nobody knows
    loop.settle()
    assert (keeper.problem, keeper.count) == ("", 0)
    loop.run(keeper.stop())


def test_the_log_tells_of_a_full_disk_once_and_of_drops_once_a_minute(
    loop: Any, keeper: Keeper, disk: Disk, monkeypatch: pytest.MonkeyPatch, caplog: Any
) -> None:
    monkeypatch.setattr(keepers, "HELD", 10)
    with failing(monkeypatch, "append", sqlite3.OperationalError("database or disk is full")):
        for value in range(100):
            keeper.put(reading(value))
            loop.pass_time(1)
    loop.pass_time(1)
    failed, first, second, works = (record.message for record in caplog.records)
    assert failed == f"the spool fails: {disk.path}: database or disk is full"
    assert first == "readings were dropped: 1 by disk"
    assert second.endswith(" by disk")
    assert works == "the spool works again"


def test_the_log_names_the_file_that_was_set_aside(loop: Any, disk: Disk, caplog: Any) -> None:
    with contextlib.closing(Spool(disk.path, 1e9, 1e9)) as spool:
        spool.append([reading()] * 2000)
    content = bytearray(disk.path.read_bytes())
    content[8192:20480] = b"\xff" * 12288
    disk.path.write_bytes(content)
    keeper = Keeper(disk.make, loop.time)
    begin(loop, keeper)
    assert [record.message.rpartition("/")[2] for record in caplog.records] == ["spool.db.corrupt-1"]
    loop.run(keeper.stop())
