"""A connection to PostgreSQL that is reopened after a failure."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

import asyncpg

from mavproxy_gradys.errors import NotStored
from mavproxy_uavapi.core.timeout import wait_with_timeout

T = TypeVar("T")
CONNECT_TIMEOUT = 5.0  # s
ANSWER_TIMEOUT = 60.0  # s of one statement
REFUSALS = (asyncpg.DataError, asyncpg.IntegrityConstraintViolationError, asyncpg.ProgramLimitExceededError)
FAILURES = (
    asyncpg.PostgresError,
    asyncpg.InterfaceError,
    asyncpg.InternalClientError,  # a connection that broke within a transaction
    OSError,
    asyncio.TimeoutError,
)


class PostgresConnection:
    """One connection, for one operation at a time.

    It is not a pool: a connection that failed in any way is closed and replaced.

    Args:
        url: a URL for libpq.
        name: its name in the database.
        prepare: called with each new connection.
        longest: s that an operation may take.
    """

    def __init__(
        self, url: str, name: str, prepare: Callable[[Any], Awaitable[None]] | None = None, longest: float = 120.0
    ) -> None:
        self._url = url
        self._name = name
        self._prepare = prepare
        self._longest = longest
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
                raise NotStored(f"database: {str(error) or type(error).__name__}") from error
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
            server_settings={"application_name": self._name, "TimeZone": "UTC"},
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
