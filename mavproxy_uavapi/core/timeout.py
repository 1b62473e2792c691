"""Waiting for a limited time without losing a cancellation, and waiting that ends nothing when it is cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Any, TypeVar

T = TypeVar("T")


async def wait_with_timeout(seconds: float | None, awaited: Awaitable[T]) -> T:
    """The result of `awaited`, within that many seconds; None means no limit.

    Unlike `asyncio.wait_for` it never loses a cancellation. Up to Python 3.11 that one does, if the cancellation
    comes in the same turn of the loop as the result: a flight that was stopped would fly on then.

    Raises:
        asyncio.TimeoutError: it took longer; `awaited` is cancelled.
    """
    task = asyncio.ensure_future(awaited)
    task.add_done_callback(_retrieve_exception)  # a caller that is cancelled meanwhile does not ask for the exception
    try:
        done, _ = await asyncio.wait({task}, timeout=seconds)
    finally:
        if not task.done():
            task.cancel()
    if not done:
        raise asyncio.TimeoutError
    return task.result()


async def kept(awaited: Awaitable[T]) -> T:
    """The result of `awaited`, which goes on if the caller is cancelled.

    Unlike `asyncio.shield` it never reports the exception of what no caller awaits any more; that one does from
    Python 3.14 on.
    """
    task = asyncio.ensure_future(awaited)
    task.remove_done_callback(_retrieve_exception)  # an earlier caller's
    task.add_done_callback(_retrieve_exception)
    await asyncio.wait({task})
    return task.result()


def _retrieve_exception(task: asyncio.Future[Any]) -> None:
    """Retrieve the exception, so that asyncio does not report it as never retrieved."""
    if not task.cancelled():
        task.exception()
