"""Taking hold of what must be given back: a program that starts, a folder, an open file."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import TypeVar

T = TypeVar("T")


async def acquire(awaited: Awaitable[T]) -> T:
    """The result of `awaited`, even if the caller is cancelled meanwhile.

    A plain `await` drops the result then, and nobody gives it back. Here the cancellation comes at the caller's next
    `await`, which is inside the `try` whose `finally` does. What `awaited` raises is raised.
    """
    task = asyncio.ensure_future(awaited)
    cancelled = False
    while not task.done():
        try:
            await asyncio.wait({task})
        except asyncio.CancelledError:
            cancelled = True
    if cancelled:
        caller = asyncio.current_task()
        assert caller is not None
        caller.cancel()
    return task.result()
