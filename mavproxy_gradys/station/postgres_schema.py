"""The tables in PostgreSQL.

readings   partitioned by the day (UTC) of the measurement; unique on device, time and number
newest     the newest reading of each quantity of each device
workers    the counts of each worker, updated in the counted transactions
"""

from __future__ import annotations

from datetime import date, timedelta

SCHEMA_LOCK = 7_301_001  # for pg_advisory_xact_lock: one worker at a time creates tables
PARTITIONED = "p"  # relkind
DEFAULT_PARTITION = "readings_other"
PAST, FUTURE = 30, 2  # days before and after today that get a partition of their own

TABLES = """
CREATE TABLE IF NOT EXISTS readings (
    device text NOT NULL, seq bigint NOT NULL, id text NOT NULL, quantity text NOT NULL,
    representation text NOT NULL, value json NOT NULL, number double precision,
    time timestamptz NOT NULL, received timestamptz NOT NULL,
    UNIQUE (device, time, seq)) PARTITION BY RANGE (time);
CREATE TABLE IF NOT EXISTS newest (
    device text NOT NULL, id text NOT NULL, quantity text NOT NULL, representation text NOT NULL,
    value json NOT NULL, time timestamptz NOT NULL, received timestamptz NOT NULL,
    PRIMARY KEY (device, quantity)) WITH (fillfactor = 50);
CREATE TABLE IF NOT EXISTS workers (
    name text PRIMARY KEY, stored bigint NOT NULL DEFAULT 0, repeats bigint NOT NULL DEFAULT 0)
    WITH (fillfactor = 50);
"""
# The partition for all other days, whatever it is called; none if the operator has detached or dropped it.
DEFAULT = """
SELECT partdefid::regclass::text FROM pg_partitioned_table WHERE partrelid = 'readings'::regclass AND partdefid <> 0
"""
KIND = "SELECT relkind::text FROM pg_class WHERE oid = 'readings'::regclass"
STAGING = """
CREATE TEMPORARY TABLE IF NOT EXISTS arriving (
    device text, seq bigint, id text, quantity text, representation text, value text, number double precision,
    time timestamptz) ON COMMIT DELETE ROWS
"""
EXISTS = "SELECT to_regclass($1) IS NOT NULL"


def partition_name(day: date) -> str:
    """The name of the partition of a day."""
    return f"readings_{day:%Y_%m_%d}"


def has_partition(day: date, today: date) -> bool:
    """Whether that day gets a partition of its own; clocks of vehicles may be wrong by years."""
    return today - timedelta(PAST) <= day <= today + timedelta(FUTURE)


def make_default(name: str) -> str:
    """SQL that creates the partition of all other days."""
    return f"CREATE TABLE {name} PARTITION OF readings DEFAULT"


def make_partition(day: date, default: str) -> str:
    """SQL that creates the partition of a day in one transaction; its rows move there from the default partition."""
    name, within = partition_name(day), f"time >= '{day} 00:00Z' AND time < '{day + timedelta(1)} 00:00Z'"
    return f"""
LOCK TABLE {default} IN ACCESS EXCLUSIVE MODE;
CREATE TABLE {name} (LIKE readings INCLUDING ALL);
WITH moved AS (DELETE FROM {default} WHERE {within} RETURNING *) INSERT INTO {name} SELECT * FROM moved;
ALTER TABLE readings ATTACH PARTITION {name} FOR VALUES FROM ('{day} 00:00Z') TO ('{day + timedelta(1)} 00:00Z');
"""
