"""Background tasks, held until they are done: asyncio itself holds only weak references."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any


class HeldTasks:
    """The tasks of one owner. When a defect ends one, the loop's exception handler is called at once."""

    def __init__(self) -> None:
        self._tasks: set[asyncio.Task[None]] = set()

    def start(self, work: Coroutine[Any, Any, None], name: str) -> asyncio.Task[None]:
        """Run `work` in the running loop.

        Args:
            work: what to do.
            name: of the task; ends the sentence "a defect ended …".
        """
        task = asyncio.get_running_loop().create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        error = None if task.cancelled() else task.exception()
        if error is not None:
            context = {"message": f"a defect ended {task.get_name()}", "exception": error}
            task.get_loop().call_exception_handler(context)

    async def end(self) -> None:
        """Cancel the unfinished ones, and wait until they have cleaned up."""
        unfinished = list(self._tasks)
        for task in unfinished:
            task.cancel()
        await asyncio.gather(*unfinished, return_exceptions=True)
