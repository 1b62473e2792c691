"""Readings in PostgreSQL: any number of workers at once."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Iterable, Sequence
from datetime import datetime, timezone
from typing import Any

import asyncpg

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.newest import Newest, NewestReadings, newest_of
from mavproxy_gradys.station.partitions import Partitions, day_of
from mavproxy_gradys.station.postgres_schema import STAGING
from mavproxy_gradys.station.reading_row import COLUMNS, ReadingRow
from mavproxy_gradys.station.store import CHUNK, Bucket, FleetNow, HistoryQuery, ReadingQuery, StoreCounts
from mavproxy_uavapi.core.held_tasks import HeldTasks

CONNECT_TIMEOUT = 5.0  # s
ANSWER_TIMEOUT = 60.0  # s
CONNECTIONS = 4
SHOW_EVERY = 1.0  # s between the updates of the fleet's table
REFUSALS = (asyncpg.DataError, asyncpg.IntegrityConstraintViolationError, asyncpg.ProgramLimitExceededError)
FAILURES = (asyncpg.PostgresError, asyncpg.InterfaceError, OSError, asyncio.TimeoutError)
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
      WHERE device = $1 AND quantity = $2 AND time >= $3 AND time < $4) AS found
WHERE number IS NOT NULL GROUP BY floor(extract(epoch FROM time - $3) / $5::float8) ORDER BY 1
"""
# A text is not looked into: PostgreSQL finds no NUL and no half a letter in it. A list has numbers only.
ELEMENT = """
CASE WHEN value::text LIKE '[%' THEN
    CASE WHEN json_typeof(value->{0:d}) = 'number' THEN (value->>{0:d})::float8 END END
"""


class PostgresStore:
    """See `Store`; it connects when it is first asked, and again after the database was away.

    Args:
        url: postgresql://[USER[:PASSWORD]@]HOST[:PORT]/DATABASE; further parameters as libpq knows them.
        worker: its name, under which it counts.
        clock: s since 1970.
    """

    def __init__(self, url: str, worker: str, clock: Callable[[], float] = time.time) -> None:
        self._url = url
        self._worker = worker
        self._pool: Any = None
        self._connecting = asyncio.Lock()
        self._partitions = Partitions(clock)
        self._newest = NewestReadings()
        self._tasks = HeldTasks()

    @contextlib.asynccontextmanager
    async def _connection(self) -> AsyncIterator[Any]:
        """A connection of the pool.

        Raises:
            NotStored: the database is away, or fails.
            ValueError: it refuses what it was given.
        """
        try:
            async with self._connecting:
                if self._pool is None:
                    self._pool = await self._connect()
                    self._tasks.start(self._show_changes(), "the update of the fleet's table")
            async with self._pool.acquire(timeout=CONNECT_TIMEOUT) as connection:
                yield connection
        except REFUSALS as error:
            raise ValueError(f"{type(error).__name__}: {error}") from error
        except FAILURES as error:
            raise NotStored(f"database: {str(error) or type(error).__name__}") from error

    async def _connect(self) -> Any:
        pool = await asyncpg.create_pool(
            self._url,
            min_size=1,
            max_size=CONNECTIONS,
            timeout=CONNECT_TIMEOUT,
            command_timeout=ANSWER_TIMEOUT,
            init=lambda connection: connection.execute(STAGING),
            server_settings={"application_name": self._worker, "TimeZone": "UTC"},
        )
        try:
            async with pool.acquire() as connection:
                await self._partitions.make_tables(connection)
        except BaseException:
            pool.terminate()
            raise
        return pool

    async def add(self, rows: Sequence[ReadingRow]) -> int:
        """See `Store.add`; a device, a time and a number are one reading."""
        records = [(*row[:7], utc(row.time)) for row in rows]
        async with self._connection() as connection:
            await self._partitions.make(connection, {day_of(record[7]) for record in records})
            async with connection.transaction():
                await connection.copy_records_to_table("arriving", records=records)
                new, received = await connection.fetchrow(INSERT)
                await connection.execute(COUNT, self._worker, new, len(rows) - new)
        self._newest.put(newest_of(rows, received))
        return int(new)

    async def show(self, newest: Iterable[Newest]) -> None:
        """See `Store.show`."""
        self._newest.put(newest)

    async def _show_changes(self) -> None:
        """Bring the fleet's table up to date, again and again: as often whether few readings come or many."""
        while True:
            await asyncio.sleep(SHOW_EVERY)
            with contextlib.suppress(NotStored):
                await self._show(self._newest.take_changed())

    async def _show(self, newest: Sequence[Newest]) -> None:
        if not newest:
            return
        cells = [(*reading[:5], utc(reading.time), utc(reading.received)) for reading in newest]
        try:
            async with self._connection() as connection:
                await connection.execute(SHOW, *map(list, zip(*cells, strict=True)))
        except NotStored:
            self._newest.put_back(newest)
            raise

    async def fleet(self) -> FleetNow:
        """See `Store.fleet`."""
        async with self._connection() as connection:
            now = await connection.fetchval("SELECT extract(epoch FROM now())::float8")
            return FleetNow(now, [Newest(*row) for row in await connection.fetch(FLEET)])

    async def counts(self) -> StoreCounts:
        """See `Store.counts`."""
        async with self._connection() as connection:
            return StoreCounts(*await connection.fetchrow(COUNTS))

    async def readings(self, query: ReadingQuery) -> AsyncGenerator[Sequence[tuple[Any, ...]], None]:
        """See `Store.readings`."""
        conditions = query.conditions()
        where = " AND ".join(f"{column} {operator} ${n}" for n, (column, operator, _) in enumerate(conditions, 1))
        select = (
            f"SELECT {', '.join(map(told, COLUMNS))} FROM readings WHERE {where or 'TRUE'} ORDER BY {query.order}"
        )
        operands = [utc(operand) if column == "time" else operand for column, _, operand in conditions]
        async with self._connection() as connection, connection.transaction(readonly=True):
            cursor = await connection.cursor(f"{select} LIMIT {query.limit:d}", *operands)
            while rows := await cursor.fetch(CHUNK):
                yield [tuple(row) for row in rows]

    async def history(self, query: HistoryQuery) -> list[Bucket]:
        """See `Store.history`."""
        number = "number" if query.element is None else ELEMENT.format(query.element)
        operands = query.device, query.quantity, utc(query.start), utc(query.end), query.width
        async with self._connection() as connection:
            return [Bucket(*row) for row in await connection.fetch(HISTORY.format(number=number), *operands)]

    async def close(self) -> None:
        """See `Store.close`; the fleet's table is brought up to date first."""
        await self._tasks.end()
        if self._pool is None:
            return
        with contextlib.suppress(NotStored):
            await self._show(self._newest.take_changed())
        self._pool.terminate()


def utc(seconds: float) -> datetime:
    """A moment, from s since 1970."""
    return datetime.fromtimestamp(seconds, timezone.utc)


def told(column: str) -> str:
    """A column as it is told."""
    if column in ("time", "received"):
        return f"extract(epoch FROM {column})::float8"
    return "value::text" if column == "value" else column
