"""Stores readings in PostgreSQL, for any number of workers at once."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncGenerator, Callable, Iterable, Sequence
from datetime import datetime, timezone
from typing import Any

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.newest import Newest, NewestReadings, newest_of
from mavproxy_gradys.station.partitions import Partitions, day_of
from mavproxy_gradys.station.postgres_connection import PostgresConnection
from mavproxy_gradys.station.postgres_schema import STAGING
from mavproxy_gradys.station.reading_row import COLUMNS, ReadingRow
from mavproxy_gradys.station.store import CHUNK, FleetNow, HistoryBucket, HistoryQuery, ReadingQuery, StoreCounts
from mavproxy_uavapi.core.held_tasks import HeldTasks

EXPORTS = 4  # running at once
SHOW_EVERY = 1.0  # s between the updates of the fleet's table
INSERT = """
WITH fresh AS (
    INSERT INTO readings (device, seq, id, quantity, representation, value, number, time, received)
    SELECT device, seq, id, quantity, representation, value::json, number, time, now() FROM arriving
    ORDER BY device, time, seq ON CONFLICT DO NOTHING RETURNING 1)
SELECT (SELECT count(*) FROM fresh), extract(epoch FROM now())::float8
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
        WHERE excluded.time >= known.time UNION ALL SELECT known.id, known.representation, known.value, known.time
        WHERE excluded.time < known.time),
    received = greatest(excluded.received, known.received)
"""
FLEET = """
SELECT device, id, quantity, representation, value::text, extract(epoch FROM time)::float8,
    extract(epoch FROM received)::float8 FROM newest ORDER BY device, quantity
"""
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
        self._partitions = Partitions(clock)
        self._newest = NewestReadings()
        self._writing = PostgresConnection(url, worker, self._prepare)
        self._looking = PostgresConnection(url, worker, self._partitions.make_tables)
        self._exports = asyncio.Semaphore(EXPORTS)
        self._tasks = HeldTasks()
        self._showing: asyncio.Task[None] | None = None

    async def _prepare(self, connection: Any) -> None:
        await self._partitions.make_tables(connection)
        await connection.execute(STAGING)

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """See `Store.add`; device, time and number identify a reading."""
        self._start_showing()
        new, received = await self._writing.do(lambda connection: self._insert(connection, rows))
        self._newest.put(newest_of(rows, received))
        return new

    async def _insert(self, connection: Any, rows: Sequence[ReadingRow]) -> tuple[int, float]:
        """The number of new rows, and the time of storage by the database's clock."""
        records = [(*row[:7], utc(row.time)) for row in rows]
        await self._partitions.make(connection, {day_of(record[7]) for record in records})
        async with connection.transaction():
            await connection.copy_records_to_table("arriving", records=records)
            new, received = await connection.fetchrow(INSERT)
            await connection.execute(COUNT, self._worker, new, len(rows) - new)
        return new, received

    async def show(self, newest: Iterable[Newest]) -> None:
        """See `Store.show`."""
        self._start_showing()
        self._newest.put(newest)

    def _start_showing(self) -> None:
        if self._showing is None:
            self._showing = self._tasks.start(self._show_changes(), "the update of the fleet's table")

    async def _show_changes(self) -> None:
        """Update the fleet's table at a fixed rate, whatever the number of readings."""
        while True:
            await asyncio.sleep(SHOW_EVERY)
            with contextlib.suppress(NotStored):
                await self._show(self._newest.take_changed())

    async def _show(self, newest: Sequence[Newest]) -> None:
        if not newest:
            return
        cells = [(*reading[:5], utc(reading.time), utc(reading.received)) for reading in newest]
        columns = list(map(list, zip(*cells, strict=True)))
        try:
            await self._writing.do(lambda connection: connection.execute(SHOW, *columns))
        except NotStored:
            self._newest.put_back(newest)
            raise

    async def fleet(self) -> FleetNow:
        """See `Store.fleet`."""
        now, rows = await self._looking.do(self._fleet)
        return FleetNow(now, [Newest(*row) for row in rows])

    async def _fleet(self, connection: Any) -> tuple[float, list[Any]]:
        now = await connection.fetchval("SELECT extract(epoch FROM now())::float8")
        return now, await connection.fetch(FLEET)

    async def counts(self) -> StoreCounts:
        """See `Store.counts`."""
        return StoreCounts(*await self._looking.do(lambda connection: connection.fetchrow(COUNTS)))

    async def readings(self, query: ReadingQuery) -> AsyncGenerator[Sequence[tuple[Any, ...]], None]:
        """See `Store.readings`; it has a transaction and a connection of its own."""
        conditions = query.conditions()
        where = " AND ".join(f"{column} {operator} ${n}" for n, (column, operator, _) in enumerate(conditions, 1))
        columns = ", ".join(map(expression, COLUMNS))
        select = (
            f"SELECT {columns} FROM readings WHERE {where or 'TRUE'} ORDER BY {query.order} LIMIT {query.limit:d}"
        )
        operands = [utc(operand) if column == "time" else operand for column, _, operand in conditions]
        async with self._exports:
            export = PostgresConnection(self._url, self._worker, begin)
            try:
                cursor = await export.do(lambda connection: connection.cursor(select, *operands))
                while rows := await export.do(lambda _: cursor.fetch(CHUNK)):
                    yield [tuple(row) for row in rows]
            finally:
                export.terminate()

    async def history(self, query: HistoryQuery) -> list[HistoryBucket]:
        """See `Store.history`."""
        number = "number" if query.element is None else ELEMENT.format(query.element)
        operands = query.device, query.quantity, utc(query.start), utc(query.end), query.width
        select = HISTORY.format(number=number)
        async with self._exports:
            connection = PostgresConnection(self._url, self._worker)
            try:
                return [HistoryBucket(*row) for row in await connection.do(lambda one: one.fetch(select, *operands))]
            finally:
                connection.terminate()

    async def close(self) -> None:
        """See `Store.close`; the fleet's table is updated first."""
        await self._tasks.end()
        with contextlib.suppress(NotStored):
            await self._show(self._newest.take_changed())
        self._writing.terminate()
        self._looking.terminate()


async def begin(connection: Any) -> None:
    """Begin a read-only transaction."""
    await connection.execute("BEGIN READ ONLY")


def utc(seconds: float) -> datetime:
    """The datetime of s since 1970."""
    return datetime.fromtimestamp(seconds, timezone.utc)


def expression(column: str) -> str:
    """The SQL expression of a column in an answer."""
    if column in ("time", "received"):
        return f"extract(epoch FROM {column})::float8"
    return "value::text" if column == "value" else column
