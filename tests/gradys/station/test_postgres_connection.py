"""A connection that fails in all the ways that a database can be killed."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from tests.support.virtual_time import FastLoop

asyncpg = pytest.importorskip("asyncpg")
from mavproxy_gradys.station.postgres_connection import StatementRefused  # noqa: E402  it needs asyncpg


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
    asyncpg.LockNotAvailableError("canceling statement due to lock timeout"),
    asyncpg.InvalidCachedStatementError("cached statement plan is invalid due to a database schema change"),
    asyncpg.ReadOnlySQLTransactionError("cannot execute INSERT in a read-only transaction"),
    asyncpg.DiskFullError("could not extend file"),
    asyncpg.InsufficientPrivilegeError("permission denied for table readings"),
    asyncpg.UndefinedColumnError("there is no such column"),
    ConnectionResetError("by peer"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_a_connection_that_failed_is_thrown_away(
    loop: FastLoop, made: list[Connection], connection: Any, error: Any
) -> None:
    async def fail(_: Any) -> None:
        raise error

    assert loop.run(connection.do(answer)) == 7
    with pytest.raises(NotStored) as raised:
        loop.run(connection.do(fail))
    assert not isinstance(raised.value, StatementRefused)
    assert [one.closed for one in made] == [True]
    assert loop.run(connection.do(answer)) == 7
    assert [one.closed for one in made] == [True, False]


def test_a_database_that_never_answers_is_given_up(loop: FastLoop, made: list[Connection], connection: Any) -> None:
    began = loop.time()
    with pytest.raises(NotStored):
        loop.run(connection.do(lambda _: asyncio.Event().wait()))
    assert loop.time() - began == pytest.approx(30.0)
    assert made[0].closed
    assert loop.run(connection.do(answer)) == 7


@pytest.mark.parametrize(
    "error",
    [asyncpg.DataError, asyncpg.CheckViolationError, asyncpg.ProgramLimitExceededError, asyncpg.RaiseError,
     asyncpg.WithCheckOptionViolationError],
)  # fmt: skip
def test_what_is_refused_costs_no_connection(
    loop: FastLoop, made: list[Connection], connection: Any, error: type[Exception]
) -> None:
    async def refuse(_: Any) -> None:
        raise error("no JSON")

    with pytest.raises(StatementRefused, match="no JSON"):
        loop.run(connection.do(refuse))
    assert [one.closed for one in made] == [False]


@pytest.mark.parametrize(
    ("error", "says"),
    [(asyncpg.InsufficientPrivilegeError, "until somebody changes it"),
     (asyncpg.InvalidPasswordError, "until somebody changes it"),
     (asyncpg.InvalidCatalogNameError, "until somebody changes it"), (asyncpg.TooManyConnectionsError, "database: ")],
)  # fmt: skip
def test_who_is_not_let_in_has_no_refused_rows(
    loop: FastLoop, connection: Any, monkeypatch: pytest.MonkeyPatch, error: type[Exception], says: str
) -> None:
    async def connect(*_: Any, **__: Any) -> Connection:
        raise error("not you")

    monkeypatch.setattr(asyncpg, "connect", connect)
    with pytest.raises(NotStored, match=says) as raised:
        loop.run(connection.do(answer))
    assert not isinstance(raised.value, StatementRefused)


def test_who_is_cancelled_leaves_no_half_transaction(loop: FastLoop, made: list[Connection], connection: Any) -> None:
    working = loop.create_task(connection.do(lambda _: asyncio.Event().wait()))
    loop.settle()
    working.cancel()
    loop.settle()
    assert made[0].closed
