"""One asyncio loop in one thread."""

from __future__ import annotations

import asyncio
import concurrent.futures
import sys
import threading
import traceback
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from mavproxy_uavapi.core.terminal import say

T = TypeVar("T")
DEEPEST = 5  # calls that the error for a loop that does not answer names


class EventLoopThread:
    """Runs an asyncio loop in a daemon thread from `start` to `stop`; both are called from other threads.

    Args:
        name: of the thread.
        loop: a loop that the caller runs, in place of a thread of its own.
    """

    def __init__(self, name: str, loop: asyncio.AbstractEventLoop | None = None) -> None:
        self.loop = loop or asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def _run(self) -> None:
        asyncio.set_event_loop(self.loop)
        try:
            self.loop.run_forever()
            self._cancel_tasks()
        finally:
            asyncio.set_event_loop(None)
            self.loop.close()

    def _cancel_tasks(self) -> None:
        tasks = asyncio.all_tasks(self.loop)
        for task in tasks:
            task.cancel()
        if tasks:
            self.loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
        self.loop.run_until_complete(self.loop.shutdown_asyncgens())
        self.loop.run_until_complete(self.loop.shutdown_default_executor())

    @property
    def running(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def call_soon(self, call: Callable[..., object], *args: Any) -> bool:
        """Run `call(*args)` in the loop; False when the loop has ended."""
        try:
            self.loop.call_soon_threadsafe(call, *args)
        except RuntimeError:  # the loop is closed
            return False
        return True

    def run(self, coroutine: Coroutine[Any, Any, T], timeout: float) -> T:
        """Run `coroutine` in the loop and wait for its result, at most `timeout` seconds.

        Not for the loop's own thread.

        Raises:
            TimeoutError: it took longer; the coroutine is cancelled.
        """
        future = asyncio.run_coroutine_threadsafe(coroutine, self.loop)
        try:
            return future.result(timeout)
        except concurrent.futures.TimeoutError as error:
            future.cancel()
            raise TimeoutError(f"no answer from the loop within {timeout:g} s; it is in {self._where()}") from error

    def _where(self) -> str:
        """What the thread does now: its innermost calls, the last one first."""
        frame = sys._current_frames().get(self._thread.ident or 0)
        calls = traceback.extract_stack(frame)[: -DEEPEST - 1 : -1] if frame else []
        return ", called by ".join(f"{call.name} ({call.filename}:{call.lineno})" for call in calls) or "no thread"

    def stop(self, timeout: float = 4.0) -> bool:
        """Cancel all tasks and end the thread; whether it ended within `timeout` s; if not, its place is said."""
        if not self._thread.ident:
            self.loop.close()
            return True
        self.call_soon(self.loop.stop)
        self._thread.join(timeout)
        if self.running:
            say(f"{self._thread.name} has not ended within {timeout:g} s; it is in {self._where()}")
        return not self.running
