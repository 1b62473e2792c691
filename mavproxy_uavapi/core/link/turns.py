"""One transfer at a time: the mission protocol and the log protocol know no more."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from mavproxy_uavapi.core.errors import Busy
from mavproxy_uavapi.core.timeout import wait_with_timeout

TURN_TIMEOUT = 10.0  # s that a transfer waits for those before it


class Turns:
    """The turns of the transfers of one kind.

    Args:
        kind: names them in the error, such as `transfers of the mission`.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._lock = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def one(self) -> AsyncIterator[None]:
        """Wait for a turn, and have it while the context lasts. Raises Busy when others take too long."""
        turn = asyncio.ensure_future(self._lock.acquire())
        try:
            await wait_with_timeout(TURN_TIMEOUT, turn)
        except asyncio.TimeoutError:
            raise Busy(f"other {self._kind} have taken {TURN_TIMEOUT:g} s; try again") from None
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled():  # both came in the same turn of the loop
                self._lock.release()
            raise
        try:
            yield
        finally:
            self._lock.release()
