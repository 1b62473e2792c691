"""Stores readings in PostgreSQL, for any number of workers at once."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable, Iterable, Sequence
from datetime import datetime, timezone
from typing import Any

import asyncpg

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.newest import MOST, Newest, NewestReadings, newest_of
from mavproxy_gradys.station.partitions import Partitions, day_of
from mavproxy_gradys.station.postgres_connection import NO_IDLE_LOCKS, PostgresConnection, StatementRefused
from mavproxy_gradys.station.postgres_schema import STAGING
from mavproxy_gradys.station.reading_row import COLUMNS, NumberTaken, ReadingRow
from mavproxy_gradys.station.store import (
    LONGEST_READ,
    READERS,
    FleetNow,
    HistoryBucket,
    HistoryQuery,
    Page,
    ReadingQuery,
    StoreCounts,
)
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.text import reason_of

SHOW_EVERY = 1.0  # s between the updates of the fleet's table
SHOWS = 3  # updates in a row that fail until the table says nothing of the present
PARTITIONS_EVERY = 10.0  # s
FORGET_EVERY = 60.0  # s between looks whether the fleet's table is too large
ATTEMPTS = 3  # to store rows whose partitions change meanwhile
LOCK_TIMEOUT = "10s"  # for who stores: an operator's lock is told of, and tried again
INSERT = """
WITH fresh AS (
    INSERT INTO readings (device, seq, id, quantity, representation, value, number, time, received)
    SELECT device, seq, id, quantity, representation, value::json, number, time, now() FROM arriving
    ORDER BY device, time, seq ON CONFLICT DO NOTHING RETURNING 1)
SELECT (SELECT count(*) FROM fresh), extract(epoch FROM now())::float8
"""
# LIMIT keeps it at one look at the index for each row that arrives, whatever the planner believes of their number.
TAKEN = """
SELECT a.device, a.seq FROM arriving AS a CROSS JOIN LATERAL (
    SELECT * FROM readings AS r WHERE r.device = a.device AND r.time = a.time AND r.seq = a.seq LIMIT 1) AS kept
WHERE (kept.id, kept.quantity, kept.representation, kept.value::text) <> (a.id, a.quantity, a.representation, a.value)
LIMIT 1
"""
COUNT = """
INSERT INTO workers AS known (name, stored, repeats) VALUES ($1, $2, $3)
ON CONFLICT (name) DO UPDATE SET stored = known.stored + $2, repeats = known.repeats + $3
"""
SHOW = """
INSERT INTO newest AS known (device, id, quantity, representation, value, time, received)
SELECT * FROM unnest($1::text[], $2::text[], $3::text[], $4::text[], $5::json[], $6::timestamptz[], $7::timestamptz[])
    AS new (device, id, quantity, representation, value, time, received) ORDER BY device, quantity
ON CONFLICT (device, quantity) DO UPDATE SET
    (id, representation, value, time) = (SELECT excluded.id, excluded.representation, excluded.value, excluded.time
        WHERE NOT excluded.time < known.time OR known.time > now()
        UNION ALL SELECT known.id, known.representation, known.value, known.time
        WHERE excluded.time < known.time AND known.time <= now()),
    received = CASE WHEN known.received > now() THEN excluded.received
        ELSE greatest(excluded.received, known.received) END
"""  # what lies in the future was stored before the clock was set back
FLEET = f"""
SELECT device, id, quantity, representation, value::text, extract(epoch FROM time)::float8,
    extract(epoch FROM received)::float8 FROM newest ORDER BY newest.received DESC LIMIT {MOST}
"""
FORGET = f"DELETE FROM newest WHERE ctid IN (SELECT ctid FROM newest ORDER BY received DESC OFFSET {MOST})"
COUNTS = "SELECT coalesce(sum(stored), 0)::bigint, coalesce(sum(repeats), 0)::bigint FROM workers"
HISTORY = """
SELECT extract(epoch FROM min(time))::float8, extract(epoch FROM max(time))::float8, min(number), max(number),
    count(*), extract(epoch FROM max(received - time))::float8
FROM (SELECT time, received, {number} AS number FROM readings
      WHERE device = $1 AND quantity = $2 AND time >= $3 AND time < $4) AS numbers
WHERE number IS NOT NULL GROUP BY floor(extract(epoch FROM time - $3) / $5::float8) ORDER BY 1
"""
# Texts are not parsed: PostgreSQL's JSON functions fail on a NUL and on unpaired surrogates. A list has numbers only.
ELEMENT = """
CASE WHEN value::text LIKE '[%' THEN
    CASE WHEN json_typeof(value->{0:d}) = 'number' THEN (value->>{0:d})::float8 END END
"""


class PartitionChanged(NotStored):
    """There was no partition for a row, or it was made or detached while the row was on its way."""


class PostgresStore:
    """See `Store`; it connects at first use, and again after a failure.

    Args:
        url: postgresql://[USER[:PASSWORD]@]HOST[:PORT]/DATABASE; with libpq's parameters.
        worker: the worker's name, for its counts.
        clock: s since 1970.
    """

    def __init__(self, url: str, worker: str, clock: Callable[[], float] = time.time) -> None:
        self._url = url
        self._worker = worker
        self._partitions = Partitions(url, worker, clock)
        self._newest = NewestReadings()
        limits = {"lock_timeout": LOCK_TIMEOUT, **NO_IDLE_LOCKS}
        self._writing = PostgresConnection(url, worker, self._prepare, settings=limits)
        self._showing = PostgresConnection(url, worker, self._partitions.make_tables, settings=limits)
        self._unshown, self._why_unshown = 0, ""  # updates of the fleet's table that have failed, in a row
        self._looking = PostgresConnection(url, worker, self._partitions.make_tables, settings=NO_IDLE_LOCKS)
        bounds = {"default_transaction_read_only": "on", "statement_timeout": f"{LONGEST_READ:g}s"}
        self._idle = [PostgresConnection(url, worker, settings=bounds) for _ in range(READERS)]
        self._reading = asyncio.Semaphore(READERS)
        self._tasks = HeldTasks()
        self._begun = False

    async def _prepare(self, connection: Any) -> None:
        await self._partitions.make_tables(connection)
        await connection.execute(STAGING)
        self._partitions.forget()

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """See `Store.add`; device, time and number identify a reading."""
        self._begin()
        records = [(*row[:7], utc(row.time)) for row in rows]
        await self._partitions.make({day_of(record[7]) for record in records})
        for _ in range(ATTEMPTS):
            try:
                new, received = await self._writing.do(lambda connection: self._insert(connection, records))
                break
            except PartitionChanged as error:  # the next connection makes the default one if that is gone
                changed = error
            except StatementRefused as error:
                raise ValueError(str(error)) from error
        else:
            raise changed
        self._newest.put(newest_of(rows, received))
        return new

    async def _insert(self, connection: Any, records: Sequence[tuple[Any, ...]]) -> tuple[int, float]:
        """The number of new rows, and the time of storage by the database's clock."""
        async with connection.transaction():
            await connection.copy_records_to_table("arriving", records=records)
            try:
                new, received = await connection.fetchrow(INSERT)
            except asyncpg.CheckViolationError as error:
                if error.constraint_name is None:
                    raise PartitionChanged(f"database: {reason_of(error)}") from error
                raise
            taken = await connection.fetchrow(TAKEN) if new < len(records) else None
            if taken:
                raise NumberTaken(*taken)
            await connection.execute(COUNT, self._worker, new, len(records) - new)
        return new, received

    async def show(self, newest: Iterable[Newest]) -> None:
        """See `Store.show`."""
        self._begin()
        self._newest.put(newest)

    def _begin(self) -> None:
        """Begin the work beside the storing."""
        if not self._begun:
            self._begun = True
            self._tasks.start(self._every(SHOW_EVERY, self._show_changes), "the update of the fleet's table")
            self._tasks.start(self._every(PARTITIONS_EVERY, self._partitions.make_again), "the partitions of days")
            self._tasks.start(self._every(FORGET_EVERY, self._forget), "the bound of the fleet's table")

    async def _every(self, seconds: float, work: Callable[[], Awaitable[None]]) -> None:
        """Do `work` at a fixed rate, whatever the number of readings."""
        while True:
            await asyncio.sleep(seconds)
            with contextlib.suppress(NotStored):
                await work()

    async def _forget(self) -> None:
        await self._showing.do(lambda connection: connection.execute(FORGET))

    async def _show_changes(self) -> None:
        await self._show(self._newest.take_changed())

    async def _show(self, newest: Sequence[Newest]) -> None:
        if not newest:
            return
        cells = [(*reading[:5], utc(reading.time), utc(reading.received)) for reading in newest]
        columns = list(map(list, zip(*cells, strict=True)))
        try:
            await self._showing.do(lambda connection: connection.execute(SHOW, *columns))
        except NotStored as error:
            self._newest.put_back(newest)
            self._unshown += 1
            self._why_unshown = str(error)
            raise
        self._unshown = 0

    async def fleet(self) -> FleetNow:
        """See `Store.fleet`.

        Raises:
            NotStored: also if its table cannot be updated, by somebody's lock for example: it shows the past then.
        """
        if self._unshown >= SHOWS:
            raise NotStored(f"the fleet's table is not updated: {self._why_unshown}")
        now, rows = await self._looking.do(self._fleet)
        return FleetNow(now, sorted(Newest(*row) for row in rows))

    async def _fleet(self, connection: Any) -> tuple[float, list[Any]]:
        now = await connection.fetchval("SELECT extract(epoch FROM now())::float8")
        return now, await connection.fetch(FLEET)

    async def counts(self) -> StoreCounts:
        """See `Store.counts`."""
        return StoreCounts(*await self._looking.do(lambda connection: connection.fetchrow(COUNTS)))

    async def page(self, query: ReadingQuery, after: Any, limit: int) -> Page:
        """See `Store.page`."""
        conditions = query.conditions()
        where = [f"{column} {operator} ${n}" for n, (column, operator, _) in enumerate(conditions, 1)]
        operands = [utc(operand) if column == "time" else operand for column, _, operand in conditions]
        if after is not None:
            first = len(operands) + 1
            where.append(f"({query.order}) > (${first}, ${first + 1}, ${first + 2})")
            operands += after
        columns = ", ".join(map(expression, COLUMNS))
        select = (
            f"SELECT {columns}, {query.order} FROM readings WHERE {' AND '.join(where) or 'TRUE'}"
            f" ORDER BY {query.order} LIMIT {limit:d}"
        )
        rows = [tuple(row) for row in await self._read(select, operands)]
        return Page([row[: len(COLUMNS)] for row in rows], rows[-1][len(COLUMNS) :] if rows else None)

    async def history(self, query: HistoryQuery) -> list[HistoryBucket]:
        """See `Store.history`."""
        number = "number" if query.element is None else ELEMENT.format(query.element)
        operands = query.device, query.quantity, utc(query.start), utc(query.end), query.width
        return [HistoryBucket(*row) for row in await self._read(HISTORY.format(number=number), operands)]

    async def _read(self, select: str, operands: Sequence[Any]) -> list[Any]:
        """The rows of a query, by a read-only connection, in a transaction that ends with it.

        Raises:
            NotStored: it fails, or takes too long.
        """
        async with self._reading:
            connection = self._idle.pop()
            try:
                rows: list[Any] = await connection.do(lambda one: one.fetch(select, *operands))
                return rows
            finally:
                self._idle.append(connection)

    async def close(self) -> None:
        """See `Store.close`; the fleet's table is updated first."""
        await self._tasks.end()
        with contextlib.suppress(NotStored):
            await self._show(self._newest.take_changed())
        self._partitions.terminate()
        for connection in (self._writing, self._showing, self._looking, *self._idle):
            connection.terminate()


def utc(seconds: float) -> datetime:
    """The datetime of s since 1970."""
    return datetime.fromtimestamp(seconds, timezone.utc)


def expression(column: str) -> str:
    """The SQL expression of a column in an answer."""
    if column in ("time", "received"):
        return f"extract(epoch FROM {column})::float8"
    return "value::text" if column == "value" else column
