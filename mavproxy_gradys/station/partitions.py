"""The tables, and the partitions of days.

Partitions are made ahead of time, by a connection of their own that gives up quickly when somebody holds a lock, such
as a long read. Who stores waits no longer than that: the rows of a day without a partition go to the default
partition, and move when their day gets one.
"""

from __future__ import annotations

import asyncio
import functools
import logging
from collections.abc import Callable, Iterable
from datetime import date, datetime, timedelta, timezone
from itertools import count
from typing import Any

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.station.postgres_connection import NO_IDLE_LOCKS, PostgresConnection
from mavproxy_gradys.station.postgres_schema import (
    DEFAULT,
    DEFAULT_PARTITION,
    EXISTS,
    FUTURE,
    KIND,
    PARTITIONED,
    SCHEMA_LOCK,
    TABLES,
    has_partition,
    make_default,
    make_partition,
    partition_name,
)

LOCK_TIMEOUT = "200ms"  # for a lock; who stores may have to wait behind us for so long
MOVE_TIMEOUT = "5s"  # for the move of rows that came before their day's partition
REST = 100  # times as long as a failed attempt took, until the next one: a day may have more rows than move in time
log = logging.getLogger("station.store")


def day_of(moment: datetime) -> date:
    """The day (UTC) of a moment."""
    return moment.astimezone(timezone.utc).date()


class Partitions:
    """Creates tables and partitions; several workers may do so at once.

    A table `readings` that we did not create (such as a hypertable) is left as it is. So is a table that has the name
    of a partition: the operator has detached it, and rows of its day stay in the default partition.

    Args:
        url: a URL for libpq.
        name: of the worker, in the database.
        clock: s since 1970.
    """

    def __init__(self, url: str, name: str, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._tried: set[date] = set()
        self._failed: dict[date, str] = {}  # days that have no partition for now, and why
        self._rests_until: dict[date, float] = {}  # s of the loop
        self._outage = Outage(log, "a day gets no partition for now", "days get their partitions again")
        settings = {"lock_timeout": LOCK_TIMEOUT, "statement_timeout": MOVE_TIMEOUT, **NO_IDLE_LOCKS}
        self._connection = PostgresConnection(url, name, self.make_tables, settings=settings)

    async def make_tables(self, connection: Any) -> None:
        """Create missing tables."""
        async with connection.transaction():
            await connection.execute("SELECT pg_advisory_xact_lock($1)", SCHEMA_LOCK)
            await connection.execute(TABLES)
            if await connection.fetchval(KIND) == PARTITIONED and await connection.fetchval(DEFAULT) is None:
                for number in count(1):
                    name = DEFAULT_PARTITION if number == 1 else f"{DEFAULT_PARTITION}_{number}"
                    if not await connection.fetchval(EXISTS, name):
                        await connection.execute(make_default(name))
                        return

    async def make(self, days: Iterable[date]) -> None:
        """Create the missing partitions of these days, one attempt each; days far from today get none."""
        now = asyncio.get_running_loop().time
        today = day_of(datetime.fromtimestamp(self._clock(), timezone.utc))
        for day in sorted(day for day in set(days) - self._tried if has_partition(day, today)):
            self._tried.add(day)
            began = now()
            try:
                await self._connection.do(functools.partial(self._make, day))
                self._failed.pop(day, None)
            except NotStored as error:
                self._failed[day] = f"{day}: {error}"
                self._rests_until[day] = now() + REST * (now() - began)
        self._outage.update("; ".join(self._failed.values()))

    async def make_again(self) -> None:
        """Create the partitions of the next days, and those that could not be made before."""
        today = day_of(datetime.fromtimestamp(self._clock(), timezone.utc))
        self._failed = {day: why for day, why in self._failed.items() if has_partition(day, today)}
        now = asyncio.get_running_loop().time()
        self._tried -= {day for day in self._failed if now >= self._rests_until[day]}
        await self.make([*self._failed, *(today + timedelta(ahead) for ahead in range(FUTURE + 1))])

    def forget(self) -> None:
        """Try all days again: perhaps it is another database."""
        self._tried.clear()

    async def _make(self, day: date, connection: Any) -> None:
        async with connection.transaction():
            await connection.execute("SELECT pg_advisory_xact_lock($1)", SCHEMA_LOCK)
            default = await connection.fetchval(DEFAULT)
            if default is not None and not await connection.fetchval(EXISTS, partition_name(day)):
                await connection.execute(make_partition(day, default))

    def terminate(self) -> None:
        """Close the connection."""
        self._connection.terminate()
