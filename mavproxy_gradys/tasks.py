"""Tasks that run until they are cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Iterable
from typing import Any


def begin(work: Coroutine[Any, Any, None], name: str) -> asyncio.Task[None]:
    """Run `work` in the loop; when a defect ends it, the loop's exception handler is told at once."""
    loop = asyncio.get_running_loop()
    task = loop.create_task(work, name=name)

    def ended(task: asyncio.Task[None]) -> None:
        error = None if task.cancelled() else task.exception()
        if error is not None:
            loop.call_exception_handler({"message": f"gradys: a defect ended {name}", "exception": error})

    task.add_done_callback(ended)
    return task


async def end(tasks: Iterable[asyncio.Task[None]]) -> None:
    """Cancel tasks, and wait until they have cleaned up."""
    found = list(tasks)
    for task in found:
        task.cancel()
    await asyncio.gather(*found, return_exceptions=True)
