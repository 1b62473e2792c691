"""Work that simultaneous callers share. Pure asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Hashable
from typing import Any, Generic, TypeVar

from mavproxy_uavapi.core.timeout import kept

T = TypeVar("T")
LONG = 100  # things, such as the items of a mission, up to which the asyncio thread works on them itself


class SharedTasks(Generic[T]):
    """Tasks by key. A caller of a running task waits for its outcome. The task goes on if its callers leave."""

    def __init__(self) -> None:
        self._running: dict[Hashable, asyncio.Task[T]] = {}

    async def outcome(self, key: Hashable, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """What `work` gives, begun unless it is under way for that key.

        Raises:
            Exception: what `work` raises.
        """
        task = self._running.get(key)
        if task is None:
            task = self._running[key] = asyncio.get_running_loop().create_task(work())
            task.add_done_callback(lambda _: self._running.pop(key))
        return await kept(task)


async def in_thread_if_long(count: int, call: Callable[..., T], *args: Any) -> T:
    """What `call` gives; in a thread if it works on so many things that it would hold the asyncio thread too long."""
    return await asyncio.to_thread(call, *args) if count > LONG else call(*args)
