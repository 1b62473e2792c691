"""Rows of a station's stores, and what the stores show of them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from mavproxy_gradys.station.reading_row import ReadingRow, reading_row


def row(seq: int, **members: Any) -> ReadingRow:
    """A height of 1.5 m from uav-1, its number in seconds after 1_699_999_000; `members` are what differs."""
    reading = {"device": "uav-1", "id": "1", "seq": seq, "quantity": "alt", "representation": "m", "value": 1.5}
    return reading_row({**reading, "time": 1_699_999_000 + seq, **members})


async def shown(stores: Sequence[Any], look: Callable[[], Awaitable[Any]], expected: Any) -> None:
    """Wait until `look` gives what is expected; so it stays when the stores have shown all that they hold."""
    deadline = time.monotonic() + 60.0
    while await look() != expected and time.monotonic() < deadline:  # noqa: ASYNC110  the store shows it by itself
        await asyncio.sleep(0.02)
    for store in stores:
        if hasattr(store, "_show"):  # SQLite's shows all at once
            await store._show(store._newest.take_changed())
    assert await look() == expected
