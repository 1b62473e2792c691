"""The client's own thread: a vehicle goes on telling while its script blocks, and a script may have many loops."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Awaitable, Callable
from typing import TypeVar

from mavproxy_uavapi.aerpaw.exceptions import AerpawConnectionError, ConnectionTimeoutError, NotConnectedError
from mavproxy_uavapi.client.drone import Drone, Status, connect
from mavproxy_uavapi.client.places import Position
from mavproxy_uavapi.core.errors import NotFound, UavApiError

log = logging.getLogger("aerpawlib.v1.connection")
T = TypeVar("T")

STATUS_EVERY = 0.5  # s
HOME_EVERY = 5.0  # s
FIRST_MESSAGES = 5.0  # s in which a vehicle that is heard tells the rest
CLOSE_TIMEOUT = 5.0  # s
WANTED = ("GLOBAL_POSITION_INT", "ATTITUDE", "SYS_STATUS", "GPS_RAW_INT")


class VehicleThread:
    """One vehicle of the API, in a thread with a loop of its own.

    Attributes:
        drone: the client's side of it.
        status: what the API last said of it; None while it cannot say.
        home: its home, and the altitude of that in m AMSL; None before it has one.

    Args:
        url: of the API.
        timeout: s until it must be connected.

    Raises:
        ConnectionTimeoutError, AerpawConnectionError: it is not.
    """

    drone: Drone

    def __init__(self, url: str, timeout: float) -> None:
        self.status: Status | None = None
        self.home: tuple[Position, float] | None = None
        self._url, self._timeout = url, timeout
        self._loop = asyncio.new_event_loop()
        self._main: asyncio.Task[None] | None = None
        self._connected = threading.Event()
        self._error: UavApiError | None = None
        self._thread = threading.Thread(target=self._run, name=f"vehicle {url}", daemon=True)
        self._thread.start()
        if not self._connected.wait(timeout + 2 * FIRST_MESSAGES):
            self.close()
            raise ConnectionTimeoutError(timeout)
        if self._error is not None:
            raise AerpawConnectionError(str(self._error), self._error) from self._error

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._main = self._loop.create_task(self._live())
            with contextlib.suppress(asyncio.CancelledError):
                self._loop.run_until_complete(self._main)
            left = asyncio.all_tasks(self._loop)
            for task in left:
                task.cancel()
            self._loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
        finally:
            self._connected.set()
            self._loop.close()

    async def _live(self) -> None:
        try:
            async with connect(self._url, timeout=self._timeout) as self.drone:
                await asyncio.gather(self._look(), self.look_home())
                told = self.drone.telemetry
                await told.shows(lambda: all(told.age(name) is not None for name in WANTED), FIRST_MESSAGES)
                self._connected.set()
                await asyncio.gather(self._every(STATUS_EVERY, self._look), self._every(HOME_EVERY, self.look_home))
        except UavApiError as error:
            self._error = error

    async def _every(self, seconds: float, look: Callable[[], Awaitable[None]]) -> None:
        while True:
            await look()
            await asyncio.sleep(seconds if self.home else STATUS_EVERY)

    async def _look(self) -> None:
        try:
            self.status = await self.drone.status()
        except UavApiError as error:
            log.debug("no status: %s", error)
            self.status = None

    async def look_home(self) -> None:
        """Ask where home is: it moves when the vehicle is armed."""
        try:
            self.home = await self.drone.home()
        except NotFound:
            self.home = None
        except UavApiError as error:
            log.debug("no home: %s", error)

    async def run(self, verb: Callable[[], Awaitable[T]]) -> T:
        """What a verb of the client gives, for a script's own loop; a cancellation goes through.

        Raises:
            NotConnectedError: the vehicle was closed.
        """
        if not self._thread.is_alive() or self._loop.is_closed():
            raise NotConnectedError("the vehicle's connection was closed")

        async def running() -> T:
            return await verb()

        return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(running(), self._loop))

    def close(self) -> None:
        """End the thread; what is in flight ends on the vehicle."""
        if self._thread.is_alive() and self._main is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                self._loop.call_soon_threadsafe(self._main.cancel)
        self._thread.join(CLOSE_TIMEOUT)
