"""`VehicleTask`: a movement that goes on while its script does something else."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable

from mavproxy_uavapi.aerpaw.exceptions import NotConnectedError, TaskCancelledError

log = logging.getLogger("aerpawlib.v2.vehicle")


class VehicleTask:
    """A movement under way.

    Args:
        measure: how much of it is done, 0 to 1; it may raise NotConnectedError.
    """

    def __init__(self, measure: Callable[[], float] | None = None) -> None:
        self._measure = measure
        self._progress = 0.0
        self._done = asyncio.Event()
        self._cancelled = False
        self._error: Exception | None = None
        self._is_told = False  # somebody has waited for its end
        self._on_cancel: Callable[[], object] | None = None
        self._cancelling: asyncio.Future[None] | None = None

    @property
    def progress(self) -> float:
        """How much of it is done, 0 to 1."""
        if self._measure is not None and not self.is_done():
            with contextlib.suppress(NotConnectedError):  # there is no telemetry now
                self.set_progress(self._measure())
        return self._progress

    def is_done(self) -> bool:
        """Whether it has ended: arrived, failed or cancelled."""
        return self._done.is_set()

    def is_cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    async def wait_done(self) -> None:
        """Wait for its end; if it was cancelled, until the vehicle has returned or stopped.

        Raises:
            TaskCancelledError: it was cancelled.
            Exception: it failed, such as NavigationError.
        """
        self._is_told = True
        if self._cancelling is not None:
            await asyncio.wait({self._cancelling})
        await self._done.wait()
        if self._error is not None:
            raise self._error

    def cancel(self) -> None:
        """End it, in the background; a drone returns to launch, a rover stops.

        After a failure nothing changes. A drone that has arrived returns, unless another movement has begun.
        """
        is_over = self._error is not None or (self.is_done() and self._on_cancel is None)
        if not (is_over or self._cancelled):
            self._cancelled = True
            self._cancelling = asyncio.ensure_future(self._cancel())

    async def cancel_async(self) -> None:
        """As `cancel`, and wait until the vehicle has returned or stopped."""
        self.cancel()
        if self._cancelling is not None:
            await self._cancelling

    async def _cancel(self) -> None:
        cause: Exception | None = None
        try:
            result = self._on_cancel() if self._on_cancel is not None else None
            if asyncio.iscoroutine(result):
                await result
        except Exception as error:  # noqa: BLE001 - it is the cause of the task's error
            cause = error
            log.warning("the vehicle could not be stopped: %s", error)
        finally:
            self.set_error(TaskCancelledError("by the script", cause))

    # -- for who moves the vehicle ------------------------------------------------------------------------

    def set_on_cancel(self, callback: Callable[[], object]) -> None:
        """Call that when it is cancelled; a coroutine is awaited."""
        self._on_cancel = callback

    def set_progress(self, value: float) -> None:
        """Set how much of it is done; it becomes 0 to 1."""
        self._progress = max(0.0, min(1.0, value))

    def set_complete(self) -> None:
        """It has succeeded."""
        self._done.set()

    def set_error(self, error: Exception) -> None:
        """It has failed."""
        self._error = error
        self._done.set()

    def follow(self, movement: asyncio.Future[None]) -> None:
        """End as that movement does, unless it is cancelled."""
        movement.add_done_callback(self._moved)

    def _moved(self, movement: asyncio.Future[None]) -> None:
        error = TaskCancelledError("the movement was ended") if movement.cancelled() else movement.exception()
        if self._cancelled:
            return  # `_cancel` goes on
        if isinstance(error, Exception):
            self.set_error(error)
        else:
            self.set_progress(1.0)
            self.set_complete()

    def raise_untold(self) -> None:
        """Raise its error if nobody has heard of it: a script that waits for no task goes on otherwise."""
        if self._error is not None and not self._is_told:
            self._is_told = True
            raise self._error
