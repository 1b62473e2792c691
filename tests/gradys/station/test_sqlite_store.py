"""What only a store in a file has: it is found again, and a file that is no database is reported."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.store import ReadingQuery, pages
from tests.gradys.station.conftest import Clock, Run
from tests.support.parsers import CORPUS
from tests.support.station_rows import row


def test_an_sqlite_file_is_found_again(tmp_path: Path, run: Run, clock: Clock) -> None:
    store = SqliteStore(tmp_path / "s.db", clock)
    run(store.add([row(1, value=1), row(3, value=3), row(2, value=2)]))
    run(store.close())
    again = SqliteStore(tmp_path / "s.db", clock)
    assert [newest.value for newest in run(again.fleet()).newest] == ["3"]
    assert run(again.add([row(1, value=1)])) == 0
    assert run(again.counts()) == (3, 1)
    run(again.close())


def test_a_file_that_is_none_is_reported(tmp_path: Path) -> None:
    (tmp_path / "s.db").write_bytes(b"no database, but longer than a hundred bytes" * 9)
    with pytest.raises(NotStored):
        SqliteStore(tmp_path / "s.db")


OLDER = """
CREATE TABLE IF NOT EXISTS readings (
    device TEXT, seq INTEGER, id TEXT, quantity TEXT, representation TEXT, value TEXT, time REAL, received REAL,
    PRIMARY KEY (device, seq)) WITHOUT ROWID
"""


def older(path: Path, rows: int) -> None:
    """A file as an older station wrote it, in which device and number identify a reading."""
    with contextlib.closing(sqlite3.connect(path)) as db, db:
        db.execute(OLDER)
        kept = [("uav-1", n, "1", "alt", "m", str(n), 1_699_999_000.0 + n, 1_700_010_000.0) for n in range(rows)]
        db.executemany("INSERT INTO readings VALUES (?, ?, ?, ?, ?, ?, ?, ?)", kept)


def test_an_older_file_is_migrated_and_found_again(tmp_path: Path, run: Run, clock: Clock) -> None:
    older(tmp_path / "s.db", 5000)
    clock.now = 1_700_010_001.0
    store = SqliteStore(tmp_path / "s.db", clock)
    assert run(store.counts()) == (5000, 0)
    assert run(store.add([row(7, value=7), row(7, time=1_699_999_900)])) == 1  # a repeat, and a restored spool's
    (newest,) = run(store.fleet()).newest
    assert newest.value == "4999"
    run(store.close())
    again = SqliteStore(tmp_path / "s.db", clock)
    assert run(again.counts()) == (5001, 0)
    page = run(again.page(ReadingQuery(device="uav-1", after=4997), None, 10))
    assert [kept[:2] for kept in page.rows] == [("uav-1", 4998), ("uav-1", 4999)]
    run(again.close())


def test_a_file_that_an_older_program_wrote_keeps_its_readings(tmp_path: Path, run: Run, clock: Clock) -> None:
    (tmp_path / "s.db").write_bytes((CORPUS / "stores" / "station_0.db").read_bytes())
    clock.now = 1_790_000_000.0
    store, at = SqliteStore(tmp_path / "s.db", clock), 1_789_999_000.0
    page = run(store.page(ReadingQuery(device="uav-1", quantity="alt"), None, 100))
    expected = [*range(20), 102, 103]
    assert sorted(kept[1] for kept in page.rows) == expected
    repeats = [row(number, value=number, time=at + number) for number in range(20)]
    restored = [row(number, value=number, time=at + 100 + number) for number in range(20)]
    assert run(store.add([*repeats, *restored])) == 20
    assert run(store.counts()) == (45, 20)
    newest = {(one.device, one.quantity): one.value for one in run(store.fleet()).newest}
    assert newest[("uav-1", "note")] == '"\\u00fc \\" \'"' and newest[("uav-2", "alt")] == "5"
    run(store.close())


def test_a_migration_that_fails_leaves_the_file_as_it_was(
    tmp_path: Path, run: Run, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    older(tmp_path / "s.db", 10)
    with monkeypatch.context() as broken:
        broken.setattr("mavproxy_gradys.station.sqlite_store.BY_NUMBER", "CREATE INDEX no room")
        with pytest.raises(NotStored):
            SqliteStore(tmp_path / "s.db", clock)
    store = SqliteStore(tmp_path / "s.db", clock)
    assert run(store.counts()).stored == 10
    run(store.close())


def test_a_file_of_a_newer_station_is_refused(tmp_path: Path) -> None:
    with contextlib.closing(sqlite3.connect(tmp_path / "s.db")) as db:
        db.execute("PRAGMA user_version=9")
    with pytest.raises(NotStored, match="newer station"):
        SqliteStore(tmp_path / "s.db")


def test_who_reads_holds_up_nobody_who_writes(tmp_path: Path, run: Run, clock: Clock) -> None:
    store = SqliteStore(tmp_path / "s.db", clock)
    run(store.add([row(1)]))
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT count(*) FROM n"

    async def scenario() -> int:
        reads = [asyncio.ensure_future(store._read(endless, ())) for _ in range(5)]
        await asyncio.sleep(0.1)
        new = await asyncio.wait_for(store.add([row(2)]), 10)
        done = await asyncio.gather(*reads, return_exceptions=True)
        assert all("longer than" in str(error) for error in done)
        return new

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("mavproxy_gradys.station.sqlite_store.LONGEST_READ", 0.3)
        assert run(scenario()) == 1
    run(store.close())


def test_a_reader_cannot_write(tmp_path: Path, run: Run, clock: Clock) -> None:
    store = SqliteStore(tmp_path / "s.db", clock)
    with pytest.raises(NotStored, match="readonly"):
        run(store._read("DELETE FROM readings", ()))
    run(store.close())


def test_an_export_that_is_not_read_on_lets_the_log_be_emptied(tmp_path: Path, run: Run, clock: Clock) -> None:
    store = SqliteStore(tmp_path / "s.db", clock)
    run(store.add([row(n) for n in range(2500)]))

    async def begun() -> Any:
        chunks = pages(store, ReadingQuery(limit=2500))
        await anext(chunks)
        return chunks

    chunks = run(begun())
    for batch in range(20):
        run(store.add([row(n, device=f"ship-{batch}", value="x" * 4000) for n in range(250)]))
    assert (tmp_path / "s.db-wal").stat().st_size < 10_000_000  # 20 MB have been written
    run(chunks.aclose())
    run(store.close())
