"""Spools of older versions: each file of the old kind keeps its readings."""

from __future__ import annotations

import contextlib
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding import spool_versions
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.sink_address import sink_address
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_versions import STEPS, VERSION
from tests.support.parsers import CORPUS

HTTP, MQTT = "http://receiver:8080/readings", "mqtt://uav:s3cret@broker/fleet/{sysid}/{quantity}"
FIRST = 1_790_000_000_000
# Not made by the code of today: this is what was on the disk then.
TABLES = """
    PRAGMA journal_mode=WAL;
    CREATE TABLE readings (
        seq INTEGER PRIMARY KEY AUTOINCREMENT, device TEXT NOT NULL, system INTEGER NOT NULL,
        quantity TEXT NOT NULL, representation TEXT NOT NULL, value TEXT NOT NULL, time REAL NOT NULL,
        boot TEXT NOT NULL, uptime REAL NOT NULL, size INTEGER NOT NULL);
    CREATE TABLE acknowledged (sink TEXT, seq INTEGER, PRIMARY KEY (sink, seq)) WITHOUT ROWID;
    CREATE TABLE dropped (cause TEXT PRIMARY KEY, count INTEGER NOT NULL) WITHOUT ROWID;
    INSERT INTO sqlite_sequence (name, seq) VALUES ('readings', {first});
    INSERT INTO dropped VALUES ('age', 7);
    PRAGMA application_id=0x67726164;
"""
DAMAGED = "CREATE TABLE damaged (seq INTEGER PRIMARY KEY, device, system, quantity, representation, value, time);"
OLD = {1: f"{TABLES} PRAGMA user_version=1;", 2: f"{TABLES} {DAMAGED} PRAGMA user_version=2;"}
SINKS = {1: (HTTP, MQTT), 2: (sink_address(HTTP).name, sink_address(MQTT).name)}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "spool.db"


def make_old(file: Path, version: int) -> None:
    """A file of that version with readings 1 to 5 (after FIRST); one sink has 1 and 2, the other 2 and 3.

    2 is removed, as it was then; there had been more, so that freed pages hold what they held.
    """
    row = "INSERT INTO readings VALUES (?, 'uav-1', 1, 'alt', 'm', '1.5', 1.79e9, 'boot', 100.0, 115)"
    http, mqtt = SINKS[version]
    with contextlib.closing(sqlite3.connect(file, isolation_level=None)) as db:
        db.executescript(OLD[version].format(first=FIRST))
        db.executemany(row, [(FIRST + n,) for n in range(1, 6)])
        reported = [(mqtt, FIRST + n) for n in range(100, 2000)]
        db.executemany("INSERT INTO acknowledged VALUES (?, ?)", reported)
        db.execute("DELETE FROM acknowledged")
        db.executemany(
            "INSERT INTO acknowledged VALUES (?, ?)", [(http, FIRST + 1), (mqtt, FIRST + 3), ("nobody's", FIRST + 4)]
        )
        db.execute("DELETE FROM readings WHERE seq = ?", (FIRST + 2,))
    file.chmod(0o644)


@contextlib.contextmanager
def opened(file: Path) -> Any:
    with contextlib.closing(Spool(file, 1e9, 1e9, clock=lambda: 100.0, boot="boot")) as spool:
        spool.use_sinks([sink_address(url).name for url in (HTTP, MQTT)])
        yield spool


def numbers(spool: Spool, url: str) -> list[int]:
    return [stored.seq - FIRST for stored in spool.batch(sink_address(url).name, -1, 100)]


def version_of(file: Path) -> int:
    return int.from_bytes(file.read_bytes()[60:64], "big")


def test_every_older_version_has_a_step_and_a_file_here() -> None:
    assert list(STEPS) == list(range(1, VERSION)) == list(OLD)


@pytest.mark.parametrize("version", OLD)
def test_an_older_file_keeps_its_readings_and_what_was_acknowledged(file: Path, version: int) -> None:
    make_old(file, version)
    for _ in range(2):
        with opened(file) as spool:
            assert (numbers(spool, HTTP), numbers(spool, MQTT)) == ([3, 4, 5], [1, 4, 5])
            assert (spool.count, spool.set_aside, spool.dropped) == (4, None, {"age": 7})
    with opened(file) as spool:
        assert spool.append([Reading("uav-1", 1, "alt", "m", 1.0, 0.0)])[0] > FIRST + 5
        assert spool.batch(sink_address(HTTP).name, -1, 1)[0].reading.value == 1.5
    assert version_of(file) == VERSION
    assert file.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("version", OLD)
def test_no_password_is_left_of_an_older_file(file: Path, version: int) -> None:
    make_old(file, version)
    with opened(file):
        left = b"".join(path.read_bytes() for path in file.parent.iterdir())
    assert b"s3cret" not in left and b"s3cret" not in file.read_bytes()


@pytest.mark.parametrize("name", ["spool_1.db", "spool_3.db"])
def test_a_file_that_an_older_program_wrote_keeps_its_readings(file: Path, name: str) -> None:
    file.write_bytes((CORPUS / "stores" / name).read_bytes())
    values = [1.5, 7, "text", True, [-35.363261, 149.165230, 20.0], 2.5, "ü \" '", [1.0]]
    for _ in range(2):
        with opened(file) as spool:
            for url, open_ones in ((HTTP, [3, 4, 5, 6, 7, 8]), (MQTT, [1, 4, 5, 6, 7, 8])):
                batch = spool.batch(sink_address(url).name, -1, 100)
                assert [stored.seq - FIRST for stored in batch] == open_ones
                assert [stored.reading.value for stored in batch] == [values[number - 1] for number in open_ones]
                times = [1_789_999_000.0 + number - 1 for number in open_ones]
                assert [stored.reading.time for stored in batch] == times
            assert (spool.count, spool.set_aside, spool.dropped) == (7, None, {})
    with opened(file) as spool:
        assert spool.append([Reading("uav-1", 1, "alt", "m", 1.0, 0.0)])[0] > FIRST + 48
        for url in (HTTP, MQTT):
            spool.acknowledge(sink_address(url).name, [FIRST + number for number in range(1, 9)])
        assert spool.count == 1
    assert version_of(file) == VERSION
    assert b"s3cret" not in file.read_bytes()


def test_a_step_that_was_interrupted_is_restarted(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_old(file, 1)

    def interrupted(url: str) -> Any:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(spool_versions, "sink_address", interrupted)
        with pytest.raises(NotStored), opened(file):
            pass
    assert version_of(file) == 1
    with opened(file) as spool:
        assert numbers(spool, HTTP) == [3, 4, 5]


def test_file_is_used_though_the_disk_has_no_room_to_rewrite_it(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    make_old(file, 1)

    def full(_: Any) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setitem(STEPS, 2, full)
        with opened(file) as spool:
            assert numbers(spool, HTTP) == [3, 4, 5]
    assert "keeps version 2 for now: database or disk is full" in caplog.text
    with opened(file):
        pass
    assert version_of(file) == VERSION


@pytest.mark.parametrize("damage", [b"\xff\xfe", b"mqtt://u:s3cret@[broken/x", b"ftp://u:s3cret@x/y"])
def test_an_acknowledgement_of_nobody_we_know_is_forgotten(file: Path, damage: bytes) -> None:
    make_old(file, 1)
    with contextlib.closing(sqlite3.connect(file, isolation_level=None)) as db:
        db.execute("UPDATE acknowledged SET sink = CAST(? AS TEXT) WHERE seq = ?", (damage, FIRST + 1))
    with opened(file) as spool:
        assert numbers(spool, HTTP) == [1, 3, 4, 5]
    assert b"s3cret" not in file.read_bytes()
