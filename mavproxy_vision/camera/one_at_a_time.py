"""Runs work that needs much memory one piece at a time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TypeVar

from mavproxy_uavapi.core.timeout import kept

T = TypeVar("T")


class OneAtATime:
    """Runs blocking work in the loop's executor, one piece after another."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    async def run(self, work: Callable[[], T]) -> T:
        """Run `work` in its turn and return its result. Even when cancelled, wait until work that has begun ends."""
        async with self._turn:
            running = asyncio.get_running_loop().run_in_executor(None, work)
            try:
                return await kept(running)
            finally:
                if not running.done():
                    await asyncio.wait({running})
