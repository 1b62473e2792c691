"""An asyncio loop that never waits."""

from __future__ import annotations

import asyncio
import selectors
import threading
from typing import Any

FULL_SOCKET = 0.25  # real s that a full socket gets besides: TCP may open its window as late as that
NOTHING_HAPPENS = 5.0  # real s after which a loop that waits for nothing but other threads is called stuck


class FastLoop(asyncio.SelectorEventLoop):
    """An asyncio loop that never waits: when nothing is ready, its clock jumps to the next timer.

    Attributes:
        real_wait: real s that sockets and threads get to become ready before the clock jumps; 0 without them.
        defects: what reached the loop's exception handler; a test that expects some clears them.
    """

    def __init__(self) -> None:
        self.now = 1000.0
        self.real_wait = 0.0
        self.defects: list[dict[str, Any]] = []
        self._thread = threading.get_ident()
        super().__init__(_JumpingSelector(self))
        self.set_exception_handler(lambda _, context: self.defects.append(context))

    def time(self) -> float:
        return self.now

    def call_soon_threadsafe(self, callback: Any, *args: Any, context: Any = None) -> asyncio.Handle:
        """As `call_soon` in the loop's own thread, which need not be woken."""
        own = threading.get_ident() == self._thread
        return (self.call_soon if own else super().call_soon_threadsafe)(callback, *args, context=context)

    def run(self, coroutine: Any) -> Any:
        """The coroutine's result."""
        return self.run_until_complete(coroutine)

    def pass_time(self, seconds: float) -> None:
        """Let that much time go by."""
        self.run_until_complete(asyncio.sleep(seconds))

    def end(self) -> None:
        """End all tasks, those that begin while others end, too, and close the loop."""
        while tasks := asyncio.all_tasks(self):
            for task in tasks:
                task.cancel()
            self.run_until_complete(asyncio.wait(tasks))
        self.run_until_complete(self.shutdown_asyncgens())
        self.run_until_complete(self.shutdown_default_executor())
        self.close()
        asyncio.set_event_loop(None)

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:
        """Wait for the threads without turning: the clock would run on meanwhile, and call every timer on its way."""
        if self._default_executor is not None:
            self._default_executor.shutdown()
            self._default_executor = None

    def settle(self) -> None:
        """Run what is ready, without any time going by."""

        async def a_few_rounds() -> None:
            for _ in range(20):
                await asyncio.sleep(0)
                if self._is_idle:
                    return

        self.run_until_complete(a_few_rounds())

    @property
    def _is_idle(self) -> bool:
        """Whether nothing can happen before time goes by: there is no socket but the loop's own."""
        is_due = self._scheduled and self._scheduled[0]._when <= self.now
        return not self._ready and not is_due and len(self._selector.get_map()) <= 1


class _JumpingSelector(selectors.DefaultSelector):
    def __init__(self, loop: FastLoop) -> None:
        super().__init__()
        self._loop = loop
        self._stuck: set[int] = set()  # full sockets that nobody reads at the other end

    def select(self, timeout: float | None = None) -> Any:
        if timeout is not None and not self._loop.real_wait and len(self.get_map()) <= 1:
            if not self._loop._ready:  # else work is ready, perhaps from another thread
                self._loop.now += max(timeout, 0.0)
            return []  # there is no socket but the loop's own
        if timeout is None:
            ready = super().select(NOTHING_HAPPENS)
            if not ready:
                raise RuntimeError("nothing will ever happen: no timer, no socket")
            return ready
        full = self._full() if self._loop.real_wait else set()
        for_full = FULL_SOCKET if full - self._stuck else 0.0
        ready = super().select(min(timeout, max(self._loop.real_wait, for_full)))
        if ready:
            self._stuck -= {key.fd for key, _ in ready}
        else:
            self._stuck = full
            self._loop.now += max(timeout, 0.0)
        return ready

    def _full(self) -> set[int]:
        return {key.fd for key in self.get_map().values() if key.events & selectors.EVENT_WRITE}
