"""A connection that fails in all the ways that a database can be killed."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored

asyncpg = pytest.importorskip("asyncpg")


class Connection:
    def __init__(self) -> None:
        self.closed = False

    def is_closed(self) -> bool:
        return self.closed

    def terminate(self) -> None:
        self.closed = True


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Connection]:
    """The connections that were made, in the place of asyncpg's."""
    connections: list[Connection] = []

    async def connect(*_: Any, **__: Any) -> Connection:
        connections.append(Connection())
        return connections[-1]

    monkeypatch.setattr(asyncpg, "connect", connect)
    return connections


@pytest.fixture
def connection() -> Any:
    from mavproxy_gradys.station.postgres_connection import PostgresConnection

    return PostgresConnection("postgresql://nowhere", "worker", longest=30.0)


async def answer(_: Any) -> int:
    return 7


ERRORS = [
    asyncpg.InternalClientError("cannot switch to state 12; another operation (2) is in progress"),
    asyncpg.ConnectionDoesNotExistError("closed in the middle"),
    asyncpg.InterfaceError("the handler is closed"),
    asyncpg.CannotConnectNowError("starting up"),
    ConnectionResetError("by peer"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_a_connection_that_failed_is_thrown_away(
    loop: Any, made: list[Connection], connection: Any, error: Any
) -> None:
    async def fail(_: Any) -> None:
        raise error

    assert loop.run(connection.do(answer)) == 7
    with pytest.raises(NotStored):
        loop.run(connection.do(fail))
    assert [one.closed for one in made] == [True]
    assert loop.run(connection.do(answer)) == 7
    assert [one.closed for one in made] == [True, False]


def test_a_database_that_never_answers_is_given_up(loop: Any, made: list[Connection], connection: Any) -> None:
    began = loop.time()
    with pytest.raises(NotStored):
        loop.run(connection.do(lambda _: asyncio.Event().wait()))
    assert loop.time() - began == pytest.approx(30.0)
    assert made[0].closed
    assert loop.run(connection.do(answer)) == 7


def test_what_is_refused_costs_no_connection(loop: Any, made: list[Connection], connection: Any) -> None:
    async def refuse(_: Any) -> None:
        raise asyncpg.DataError("no JSON")

    with pytest.raises(ValueError, match="no JSON"):
        loop.run(connection.do(refuse))
    assert [one.closed for one in made] == [False]


def test_who_is_cancelled_leaves_no_half_transaction(loop: Any, made: list[Connection], connection: Any) -> None:
    working = loop.create_task(connection.do(lambda _: asyncio.Event().wait()))
    loop.settle()
    working.cancel()
    loop.settle()
    assert made[0].closed
