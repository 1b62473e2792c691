"""Stores: SQLite, and PostgreSQL where it is installed."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.store import Store
from tests.support.ports import free_port
from tests.support.postgres import PostgresCluster

Run = Callable[[Coroutine[Any, Any, Any]], Any]


class Clock:
    """A station's clock; it stands."""

    now = 1_700_000_000.0  # 2023-11-14 22:13:20 UTC

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    """The clock."""
    return Clock()


@pytest.fixture
def run() -> Iterator[Run]:
    """Runs a coroutine in a loop with a real clock: a database is another process."""
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)
    yield loop.run_until_complete
    for task in (left := asyncio.all_tasks(loop)):  # as `asyncio.run` does
        task.cancel()
    loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
    loop.run_until_complete(loop.shutdown_asyncgens())
    loop.run_until_complete(loop.shutdown_default_executor())
    loop.close()
    asyncio.set_event_loop(None)


@pytest.fixture(scope="session")
def cluster() -> Iterator[PostgresCluster]:
    """A database server."""
    made = PostgresCluster(free_port(), "fsync = off")
    try:
        made.start()
        yield made
    finally:
        made.remove()


@pytest.fixture
def database(cluster: PostgresCluster) -> Iterator[str]:
    """The URL of an empty database."""
    cluster.sql("DROP SCHEMA public CASCADE; CREATE SCHEMA public")
    yield cluster.url


@pytest.fixture(params=["sqlite", pytest.param("postgres", marks=pytest.mark.needs("pg_lsclusters", "postgresql"))])
def store(request: pytest.FixtureRequest, tmp_path: Path, clock: Clock, run: Run) -> Iterator[Store]:
    """Each kind of store."""
    made: Store
    if request.param == "sqlite":
        made = SqliteStore(tmp_path / "station.db", clock)
    else:
        from mavproxy_gradys.station.postgres_store import PostgresStore

        made = PostgresStore(request.getfixturevalue("database"), "worker-1", clock)
    yield made
    run(made.close())
