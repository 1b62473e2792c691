"""The partitions of days, when the database makes none; with a real one: test_postgres_store."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.partitions import Partitions
from tests.support.virtual_time import FastLoop

PAUSE = 10.0  # s between the attempts of the store
HOUR = 3600.0  # s
SHARE = 0.1


@pytest.mark.parametrize("takes", [0.2, 5.0])
def test_attempts_to_make_partitions_leave_the_tables_to_who_stores(
    loop: FastLoop, monkeypatch: pytest.MonkeyPatch, takes: float
) -> None:
    """A day of millions of rows in the default partition is never moved in time."""
    partitions = Partitions("postgresql://nowhere", "worker-1", loop.time)
    begun: list[float] = []

    async def fails(_work: Callable[[object], Awaitable[None]]) -> None:
        begun.append(loop.time())
        await asyncio.sleep(takes)
        raise NotStored("canceling statement due to statement timeout")

    monkeypatch.setattr(partitions._connection, "do", fails)

    async def for_an_hour() -> None:
        until = loop.time() + HOUR
        while loop.time() < until:
            await partitions.make_again()
            await asyncio.sleep(PAUSE)

    loop.run(for_an_hour())
    assert len(begun) > 3
    assert takes * len(begun) < SHARE * HOUR
