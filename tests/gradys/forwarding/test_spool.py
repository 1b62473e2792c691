from __future__ import annotations

import contextlib
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding import spool_file
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool import DROPPED_AT_ONCE, SPREAD, Spool
from mavproxy_gradys.forwarding.spool_rows import ROW_OVERHEAD

HTTP, MQTT = "http://a/readings", "mqtt://b/fleet"


class Clock:
    """Uptime and wall clock, moved by hand."""

    def __init__(self) -> None:
        self.now, self.wall, self.boot = 100.0, 1_800_000_000.0, "first"


def reading(number: int = 0, value: Any = None) -> Reading:
    return Reading("uav-1", 1, "alt", "m", float(number) if value is None else value, 1_800_000_000.0 + number)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def opened(tmp_path: Path, clock: Clock) -> Iterator[Callable[..., Spool]]:
    """Opens the spool, again and again."""
    spools: list[Spool] = []

    def make(largest: float = 1e9, longest: float = 1e9, sinks: tuple[str, ...] = (HTTP,)) -> Spool:
        path = tmp_path / "deep" / "spool.db"
        spool = Spool(path, largest, longest, clock=lambda: clock.now, boot=clock.boot, wall=lambda: clock.wall)
        spool.use_sinks(sinks)
        spools.append(spool)
        return spool

    yield make
    for spool in spools:
        spool.close()


def numbers(spool: Spool, sink: str = HTTP, after: int = -1, limit: int = 1000) -> list[int]:
    return [stored.seq for stored in spool.batch(sink, after, limit)]


def test_readings_come_back_as_they_were_in_order(opened: Callable[..., Spool]) -> None:
    spool = opened()
    values = [1, 2.5, True, "text", [1.5, -2.0, 3]]
    kept = spool.append([reading(n, value) for n, value in enumerate(values)])
    assert kept == list(range(kept[0], kept[0] + 5))
    back = spool.batch(HTTP, -1, 10)
    assert [stored.reading for stored in back] == [reading(n, value) for n, value in enumerate(values)]
    assert back[2].reading.value is True


def test_only_the_acknowledged_numbers_are_removed(opened: Callable[..., Spool]) -> None:
    spool = opened()
    kept = spool.append([reading(n) for n in range(5)])
    spool.acknowledge(HTTP, [kept[1], kept[3], 7])
    assert numbers(spool) == [kept[0], kept[2], kept[4]]
    assert spool.count == 3


def test_a_number_is_never_given_twice(opened: Callable[..., Spool], clock: Clock, tmp_path: Path) -> None:
    spool = opened()
    kept = spool.append([reading()])
    spool.acknowledge(HTTP, kept)
    spool.close()
    spool = opened()
    assert spool.append([reading()])[0] > kept[0]
    spool.close()
    (tmp_path / "deep" / "spool.db").unlink()
    clock.wall += SPREAD / 1000
    assert opened().append([reading()])[0] > kept[0] + 1


@pytest.mark.parametrize("passed", [0.0, 3600.0, -86400.0 * 400])
def test_a_restored_file_gives_no_number_again(
    opened: Callable[..., Spool], clock: Clock, tmp_path: Path, passed: float
) -> None:
    """From a backup, or by a root folder that each start of the machine resets, the clock with it."""
    path, backup = tmp_path / "deep" / "spool.db", tmp_path / "backup.db"
    spool = opened()
    spool.append([reading(n) for n in range(10)])
    spool.close()
    shutil.copy(path, backup)
    given: list[int] = []
    for boot in ("second", "third", "third"):
        spool = opened()
        given += spool.append([reading(n) for n in range(150)])
        spool.close()
        shutil.copy(backup, path)
        clock.boot, clock.wall = boot, clock.wall + passed
    assert len(set(given)) == len(given) == 450


def test_numbers_of_one_opening_follow_each_other(opened: Callable[..., Spool]) -> None:
    spool = opened()
    first, second = spool.append([reading()]), spool.append([reading(1), reading(2)])
    assert second == [first[0] + 1, first[0] + 2]


def test_a_clock_that_was_never_set_does_not_make_numbers_repeat(opened: Callable[..., Spool], clock: Clock) -> None:
    clock.wall = 12.0
    assert opened().append([reading()])[0] != 12001


def test_each_sink_acknowledges_for_itself(opened: Callable[..., Spool]) -> None:
    spool = opened(sinks=(HTTP, MQTT))
    kept = spool.append([reading(n) for n in range(3)])
    spool.acknowledge(HTTP, kept[:2])
    assert (numbers(spool, HTTP), numbers(spool, MQTT), spool.count) == ([kept[2]], kept, 3)
    spool.acknowledge(MQTT, kept[1:])
    assert (numbers(spool, HTTP), numbers(spool, MQTT), spool.count) == ([kept[2]], [kept[0]], 2)
    spool.close()
    again = opened(sinks=(HTTP, MQTT))
    assert (numbers(again, HTTP), numbers(again, MQTT)) == ([kept[2]], [kept[0]])
    again.use_sinks((HTTP,))  # nobody waits for the other one any more
    assert (numbers(again, HTTP), again.count) == ([kept[2]], 1)


def test_the_oldest_go_when_there_are_too_many_bytes_and_are_counted(opened: Callable[..., Spool]) -> None:
    one = ROW_OVERHEAD + len("uav-1" + "alt" + "m" + "0.0")
    spool = opened(largest=one * 10)
    kept = spool.append([reading(n % 10) for n in range(25)])
    spool.trim()
    assert numbers(spool) == kept[15:]
    assert spool.dropped == {"size": 15}
    spool.close()
    assert opened().dropped == {"size": 15}


def test_many_too_many_go_in_several_steps(opened: Callable[..., Spool]) -> None:
    spool = opened(largest=1)
    spool.append([reading(n % 10) for n in range(3 * DROPPED_AT_ONCE)])
    spool.trim()
    assert (spool.count, spool.size) == (0, 0)
    assert spool.dropped == {"size": 3 * DROPPED_AT_ONCE}


def test_the_old_go_and_are_counted(opened: Callable[..., Spool], clock: Clock) -> None:
    spool = opened(longest=60.0)
    spool.append([reading(n) for n in range(DROPPED_AT_ONCE + 1)])
    clock.now += 50
    kept = spool.append([reading()])
    clock.now += 11
    spool.trim()
    assert numbers(spool) == kept
    assert spool.dropped == {"age": DROPPED_AT_ONCE + 1}


def test_a_clock_that_is_set_makes_nothing_old(opened: Callable[..., Spool], clock: Clock) -> None:
    spool = opened(longest=60.0)
    clock.wall = 12.0
    kept = spool.append([reading()])
    clock.wall = 1_800_000_000.0
    spool.trim()
    assert numbers(spool) == kept


def test_after_a_restart_of_the_machine_ages_restart(opened: Callable[..., Spool], clock: Clock) -> None:
    clock.now = 5000.0
    spool = opened(longest=60.0)
    kept = spool.append([reading()])
    spool.close()
    clock.now, clock.boot = 10.0, "second"
    spool = opened(longest=60.0)
    spool.trim()
    assert numbers(spool) == kept
    clock.now = 71.0
    spool.trim()
    assert numbers(spool) == []


def test_two_at_once_on_one_file_are_refused(opened: Callable[..., Spool]) -> None:
    opened()
    with pytest.raises(NotStored, match="another MAVProxy uses it"):
        opened()


def test_a_place_that_cannot_be_written_is_an_error_of_ours(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NotStored):
        Spool(tmp_path / "file" / "spool.db", 1e9, 1e9)


def test_a_full_disk_keeps_nothing_half(opened: Callable[..., Spool]) -> None:
    spool = opened()
    kept = spool.append([reading()])
    (pages,) = spool._db.execute("PRAGMA page_count").fetchone()
    spool._db.execute(f"PRAGMA max_page_count={pages + 1}")
    with pytest.raises(sqlite3.OperationalError, match="full"):
        spool.append([reading(n, "x" * 1000) for n in range(100)])
    assert (numbers(spool), spool.count) == (kept, 1)
    spool._db.execute("PRAGMA max_page_count=100000")
    assert spool.append([reading()])[0] == kept[0] + 1


def test_a_disk_that_is_full_after_a_restart_of_the_machine_still_gives_what_it_has(
    opened: Callable[..., Spool], tmp_path: Path, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a file beside it can be made then, nor the ages of its readings be changed."""
    spool = opened()
    kept, cut = spool.append([reading(n) for n in range(3)]), tmp_path / "cut" / "spool.db"
    shutil.copytree(spool.path.parent, cut.parent)  # as a power cut leaves it
    cut.with_name("spool.db-shm").mkdir()
    clock.boot = "second"

    def full(path: Path, wall: float) -> Any:
        db, aside = file_opened(path, wall)
        db.execute("CREATE TEMP TRIGGER full BEFORE UPDATE ON readings BEGIN SELECT RAISE(ABORT, 'it is full'); END")
        return db, aside

    file_opened = spool_file.opened
    monkeypatch.setattr("mavproxy_gradys.forwarding.spool.opened", full)
    with contextlib.closing(Spool(cut, 1e9, 1e9, boot=clock.boot)) as again:
        assert numbers(again) == kept
        with pytest.raises(sqlite3.IntegrityError, match="it is full"):
            again.trim()
        again._db.execute("DROP TRIGGER full")
        again.trim()
        assert numbers(again) == kept


KILLED = """
import sys
from pathlib import Path
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool import Spool
spool = Spool(Path(sys.argv[1]), 1e9, 1e9)
while True:
    kept = spool.append([Reading("uav-1", 1, "alt", "m", 1.0, 0.0)] * 10)
    print(kept[-1], flush=True)
"""


def test_what_was_kept_survives_kill_9(tmp_path: Path) -> None:
    file = tmp_path / "spool.db"
    reported: list[int] = []
    for _ in range(2):
        child = subprocess.Popen([sys.executable, "-c", KILLED, str(file)], stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        with child.stdout:
            reported += [int(child.stdout.readline()) for _ in range(20)]
            child.send_signal(signal.SIGKILL)
            reported += [int(line) for line in child.stdout if line.endswith("\n")]
        child.wait()
    spool = Spool(file, 1e9, 1e9)
    assert spool.set_aside is None
    kept = numbers(spool, limit=1_000_000)
    assert set(reported) <= set(kept)
    assert len(kept) % 10 == 0  # whole transactions
    spool.close()


DAMAGES = {
    "bad JSON": "UPDATE readings SET value = '{\"a' WHERE seq = ?",
    "nested JSON": "UPDATE readings SET value = replace(hex(zeroblob(9000)), '0', '[') WHERE seq = ?",
    "an infinite number": "UPDATE readings SET value = '1e999' WHERE seq = ?",
    "a dictionary": "UPDATE readings SET value = '{}' WHERE seq = ?",
    "bad UTF-8 in the value": "UPDATE readings SET value = CAST(X'22FF4122' AS TEXT) WHERE seq = ?",
    "bad UTF-8 in the unit": "UPDATE readings SET representation = CAST(X'FF41' AS TEXT) WHERE seq = ?",
    "a quantity of 1 MB": "UPDATE readings SET quantity = hex(zeroblob(500000)) WHERE seq = ?",
    "a unit of 1 MB": "UPDATE readings SET representation = hex(zeroblob(500000)) WHERE seq = ?",
    "a value of 1 MB": "UPDATE readings SET value = '\"' || hex(zeroblob(500000)) || '\"' WHERE seq = ?",
    "a device of another alphabet": "UPDATE readings SET device = 'uav/+/#' WHERE seq = ?",
    "a system that is a word": "UPDATE readings SET system = 'one' WHERE seq = ?",
    "an infinite time": "UPDATE readings SET time = 9e999 WHERE seq = ?",
    "bytes for everything": "UPDATE readings SET device = X'FF', system = X'FF', value = X'FF', time = X'FF',"
    " boot = X'FF', uptime = X'FF', size = X'FF' WHERE seq = ?",
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_row_is_set_aside_and_counted_and_the_rest_goes_on(
    opened: Callable[..., Spool], tmp_path: Path, damage: str
) -> None:
    spool = opened()
    kept = spool.append([reading(n) for n in range(5)])
    spool._db.execute(DAMAGES[damage], (kept[2],))
    spool.close()
    spool = opened()
    others = [*kept[:2], *kept[3:]]
    assert numbers(spool) == others
    spool.trim()
    assert (numbers(spool), spool.count, spool.dropped) == (others, 4, {"damage": 1})
    assert [seq for (seq,) in spool._db.execute("SELECT seq FROM damaged")] == [kept[2]]
    assert spool.oldest_since() == 100.0
    spool.acknowledge(HTTP, others)
    assert (spool.count, spool.size) == (0, 0)
    spool.close()
    assert opened().dropped == {"damage": 1}


def test_a_cell_that_is_missing_is_the_damage_of_its_row_only(opened: Callable[..., Spool], tmp_path: Path) -> None:
    spool = opened()
    kept = spool.append([reading(n) for n in range(3)])
    spool.close()
    for change in (
        "UPDATE sqlite_master SET sql = replace(sql, 'value TEXT NOT NULL', 'value TEXT')",
        f"UPDATE readings SET value = NULL WHERE seq = {kept[1]}",
        "UPDATE sqlite_master SET sql = replace(sql, 'value TEXT', 'value TEXT NOT NULL')",
    ):
        db = sqlite3.connect(tmp_path / "deep" / "spool.db", isolation_level=None)
        db.execute("PRAGMA writable_schema=1")
        db.execute(change)
        db.close()
    spool = opened()
    assert spool.set_aside is None and numbers(spool) == [kept[0], kept[2]]


def test_a_whole_batch_of_damaged_rows_does_not_hide_what_comes_after(opened: Callable[..., Spool]) -> None:
    spool = opened()
    kept = spool.append([reading(n) for n in range(10)])
    spool._db.execute("UPDATE readings SET value = 'x' WHERE seq <= ?", (kept[7],))
    assert numbers(spool, limit=3) == kept[8:9] and numbers(spool, limit=100) == kept[8:]
