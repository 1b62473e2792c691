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
REFUSALS = (asyncpg.DataError, asyncpg.IntegrityConstraintViolationError, asyncpg.ProgramLimitExceededError)
FAILURES = (
    asyncpg.PostgresError,
    asyncpg.InterfaceError,
    asyncpg.InternalClientError,  # a connection that broke within a transaction
    OSError,
    asyncio.TimeoutError,
)


def cause(error: BaseException) -> str:
    """The beginning of a failure's text: what a retry cannot mend, such as a missing right, is the operator's."""
    permanent = isinstance(error, asyncpg.SyntaxOrAccessError)
    return "the database refuses, until somebody changes it" if permanent else "database"


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
            ValueError: it refuses the data; none of it is stored.
        """
        async with self._turn:
            try:
                return await wait_with_timeout(self._longest, self._do(work))
            except REFUSALS as error:
                raise ValueError(f"{type(error).__name__}: {error}") from error
            except FAILURES as error:
                self.terminate()
                raise NotStored(f"{cause(error)}: {str(error) or type(error).__name__}") from error
            except BaseException:
                self.terminate()
                raise

    async def _do(self, work: Callable[[Any], Awaitable[T]]) -> T:
        if self._connection is None or self._connection.is_closed():
            self._connection = await self._connect()
        return await work(self._connection)

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
