"""Waiting for a limited time, without losing a cancellation."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Any, TypeVar

T = TypeVar("T")


async def wait_with_timeout(seconds: float | None, awaited: Awaitable[T]) -> T:
    """What `awaited` gives, in at most so many seconds; for ever with None.

    Not `asyncio.wait_for`: up to Python 3.11 that swallows a cancellation which comes in the turn of the loop in
    which what it waits for has come, and a flight that was stopped then flies on.

    Raises:
        asyncio.TimeoutError: it took longer; `awaited` is cancelled.
    """
    task = asyncio.ensure_future(awaited)
    task.add_done_callback(_heed)  # whoever is cancelled meanwhile does not ask how it ended
    try:
        done, _ = await asyncio.wait({task}, timeout=seconds)
    finally:
        if not task.done():
            task.cancel()
    if not done:
        raise asyncio.TimeoutError
    return task.result()


def _heed(task: asyncio.Future[Any]) -> None:
    """Have asyncio not complain of an error that nobody asked for."""
    if not task.cancelled():
        task.exception()
