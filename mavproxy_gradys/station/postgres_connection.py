"""A connection to PostgreSQL that is reopened after a failure."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, TypeVar

import asyncpg

from mavproxy_gradys.errors import NotStored
from mavproxy_uavapi.core.timeout import wait_with_timeout

T = TypeVar("T")
CONNECT_TIMEOUT = 5.0  # s
ANSWER_TIMEOUT = 60.0  # s of one statement
NO_IDLE_LOCKS = {"idle_in_transaction_session_timeout": "10s"}  # a worker that is frozen must not hold up the others
# Classes of SQLSTATE that say nothing of the rows: the connection, the server, locks, the state of the transaction, a
# cached plan. Of any other error a row may be the cause, by a constraint for example.
PASSING = ("08", "0A", "25", "28", "3D", "40", "53", "55", "57", "58", "XX")
PERMANENT = (
    asyncpg.SyntaxOrAccessError,
    asyncpg.InvalidAuthorizationSpecificationError,
    asyncpg.InvalidCatalogNameError,
)
FAILURES = (
    asyncpg.PostgresError,
    asyncpg.InterfaceError,
    asyncpg.InternalClientError,  # a connection that broke within a transaction
    OSError,
    asyncio.TimeoutError,
)


class StatementRefused(NotStored):
    """The database refuses the statement: another attempt does not help, other rows may."""


def is_of_rows(error: Any) -> bool:
    """Whether other rows may be taken.

    A right, a table or a column is missing for all rows (class 42), unless a trigger for some of them misses it, as
    the context of the error tells, or a policy of the table refuses them.
    """
    if str(error.sqlstate).startswith(PASSING):
        return False
    for_all = isinstance(error, asyncpg.SyntaxOrAccessError) and not error.context
    return not for_all or error.server_source_function == "ExecWithCheckOptions"


def told(error: BaseException) -> str:
    """An error of the database as a text; what only its operator can mend, such as a missing right, is said so."""
    begin = "the database refuses, until somebody changes it" if isinstance(error, PERMANENT) else "database"
    return f"{begin}: {str(error) or type(error).__name__}"


class PostgresConnection:
    """One connection, for one operation at a time.

    It is not a pool: a connection that failed in any way is closed and replaced.

    Args:
        url: a URL for libpq.
        name: its name in the database.
        prepare: called with each new connection.
        longest: s that an operation may take.
        settings: further settings of PostgreSQL for the session.
    """

    def __init__(
        self,
        url: str,
        name: str,
        prepare: Callable[[Any], Awaitable[None]] | None = None,
        longest: float = 120.0,
        settings: Mapping[str, str] = {},  # noqa: B006  it is read only
    ) -> None:
        self._url = url
        self._prepare = prepare
        self._longest = longest
        self._settings = {"application_name": name, "TimeZone": "UTC", **settings}
        self._connection: Any = None
        self._turn = asyncio.Lock()

    async def do(self, work: Callable[[Any], Awaitable[T]]) -> T:
        """Call `work` with the connection and return its result.

        Raises:
            NotStored: the database cannot be reached, fails, or is too slow.
            StatementRefused: it refuses this work; nothing of a transaction is stored.
        """
        async with self._turn:
            try:
                return await wait_with_timeout(self._longest, self._do(work))
            except StatementRefused:
                raise
            except FAILURES as error:
                self.terminate()
                raise NotStored(told(error)) from error
            except BaseException:
                self.terminate()
                raise

    async def _do(self, work: Callable[[Any], Awaitable[T]]) -> T:
        if self._connection is None or self._connection.is_closed():
            self._connection = await self._connect()
        try:
            return await work(self._connection)
        except asyncpg.PostgresError as error:
            if not is_of_rows(error):
                raise
            raise StatementRefused(told(error)) from error

    async def _connect(self) -> Any:
        connection = await asyncpg.connect(
            self._url,
            timeout=CONNECT_TIMEOUT,
            command_timeout=ANSWER_TIMEOUT,
            server_settings=self._settings,
        )
        try:
            if self._prepare is not None:
                await self._prepare(connection)
        except BaseException:
            connection.terminate()
            raise
        return connection

    def terminate(self) -> None:
        """Close the connection at once; a running operation fails."""
        if self._connection is not None:
            self._connection.terminate()
            self._connection = None
