"""Partitions of the table of readings; each is created when the first reading of its day arrives."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import date, datetime, timezone
from typing import Any

from mavproxy_gradys.station.postgres_schema import (
    DAYS,
    KIND,
    OTHER_DAYS,
    PARTITIONED,
    SCHEMA_LOCK,
    TABLES,
    has_partition,
    make_partition,
    partition_name,
)


def day_of(moment: datetime) -> date:
    """The day (UTC) of a moment."""
    return moment.astimezone(timezone.utc).date()


class Partitions:
    """Creates tables and partitions; several workers may do so at once.

    A table `readings` that we did not create (such as a hypertable) is left as it is.

    Args:
        clock: s since 1970.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._known: set[date] = set()
        self._ours = True

    async def make_tables(self, connection: Any) -> None:
        """Create missing tables, and today's partition."""
        async with connection.transaction():
            await connection.execute("SELECT pg_advisory_xact_lock($1)", SCHEMA_LOCK)
            await connection.execute(TABLES)
            self._ours = await connection.fetchval(KIND) == PARTITIONED
            if self._ours:
                await connection.execute(OTHER_DAYS)
        self._known.clear()
        await self.make(connection, [self._today()])

    async def make(self, connection: Any, days: Iterable[date]) -> None:
        """Create the missing partitions for these days; days far from today get none."""
        if not self._ours:
            return
        today = self._today()
        for day in sorted(set(days) - self._known):
            if has_partition(day, today):
                await self._make(connection, day)
                self._known.add(day)

    async def _make(self, connection: Any, day: date) -> None:
        async with connection.transaction():
            await connection.execute("SELECT pg_advisory_xact_lock($1)", SCHEMA_LOCK)
            existing = {row[0] for row in await connection.fetch(DAYS)}
            if partition_name(day) not in existing:
                await connection.execute(make_partition(day))

    def _today(self) -> date:
        return day_of(datetime.fromtimestamp(self._clock(), timezone.utc))
