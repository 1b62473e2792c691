"""The schema of the spool's file, and the migrations from older ones."""

from __future__ import annotations

import functools
import logging
import sqlite3
from collections.abc import Callable

from mavproxy_gradys.forwarding.sink_address import sink_address
from mavproxy_gradys.forwarding.transaction import Transaction
from mavproxy_uavapi.core.errors import SettingError

VERSION = 3  # PRAGMA user_version
USABLE = 2  # files from this version on are usable; later migrations may wait for space on the disk
DAMAGED = "CREATE TABLE damaged (seq INTEGER PRIMARY KEY, device, system, quantity, representation, value, time)"
SCHEMA = f"""
CREATE TABLE readings (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, device TEXT NOT NULL, system INTEGER NOT NULL, quantity TEXT NOT NULL,
    representation TEXT NOT NULL, value TEXT NOT NULL, time REAL NOT NULL,
    boot TEXT NOT NULL, uptime REAL NOT NULL, size INTEGER NOT NULL);
CREATE TABLE acknowledged (sink TEXT, seq INTEGER, PRIMARY KEY (sink, seq)) WITHOUT ROWID;
CREATE TABLE dropped (cause TEXT PRIMARY KEY, count INTEGER NOT NULL) WITHOUT ROWID;
{DAMAGED}
"""
log = logging.getLogger("gradys.spool")


def make(db: sqlite3.Connection, first: int) -> None:
    """Create the tables of this version within the caller's transaction; numbers begin after `first`."""
    for statement in SCHEMA.split(";"):
        db.execute(statement)
    db.execute("INSERT INTO sqlite_sequence (name, seq) VALUES ('readings', ?)", (first,))
    db.execute(f"PRAGMA user_version={VERSION}")


def migrate(db: sqlite3.Connection) -> None:
    """Migrate an older file to this version step by step; each step is atomic.

    Raises:
        sqlite3.Error: a necessary step failed.
    """
    (current,) = db.execute("PRAGMA user_version").fetchone()
    for version in range(current, VERSION):
        try:
            STEPS[version](db)
        except sqlite3.OperationalError as error:
            if version < USABLE:
                raise
            log.warning("the file of the readings keeps version %d for now: %s", version, error)
            return


def name_sinks(db: sqlite3.Connection) -> None:
    """1 to 2: names replace the sinks' URLs, which had passwords; damaged rows get a table."""
    with Transaction(db):
        db.create_function("name_of", 1, functools.cache(name_of))
        db.execute("UPDATE OR REPLACE acknowledged SET sink = name_of(coalesce(CAST(sink AS BLOB), X''))")
        db.execute("DELETE FROM acknowledged WHERE sink = ''")
        db.execute(DAMAGED)
        db.execute("PRAGMA user_version=2")


def name_of(url: bytes) -> str:
    """The name of a sink of version 1; empty if its URL is not valid any more."""
    try:
        return sink_address(url.decode(errors="replace")).name
    except SettingError:
        return ""


def leave_no_traces(db: sqlite3.Connection) -> None:
    """2 to 3: rewrite the file, so that no free page and no log has a password; this needs the same space again."""
    db.execute("VACUUM")
    db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    db.execute("PRAGMA user_version=3")


STEPS: dict[int, Callable[[sqlite3.Connection], None]] = {1: name_sinks, 2: leave_no_traces}
