"""Runs the client in its own thread: telemetry goes on while a script blocks, and a script may use several loops."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Awaitable, Callable
from typing import TypeVar

from mavproxy_uavapi.aerpaw.exceptions import AerpawConnectionError, ConnectionTimeoutError, NotConnectedError
from mavproxy_uavapi.client.drone import Drone, connect
from mavproxy_uavapi.client.places import Position
from mavproxy_uavapi.client.readings import Status
from mavproxy_uavapi.core.errors import NotFound, UavApiError

log = logging.getLogger("aerpawlib.v1.connection")
T = TypeVar("T")

STATUS_PERIOD = 0.5  # s
HOME_PERIOD = 5.0  # s
FIRST_MESSAGES_TIMEOUT = 5.0  # s from the first heartbeat to the FIRST_MESSAGES
CLOSE_TIMEOUT = 5.0  # s
FIRST_MESSAGES = ("GLOBAL_POSITION_INT", "ATTITUDE", "SYS_STATUS", "GPS_RAW_INT")


class VehicleThread:
    """One vehicle of the API, in a thread with its own loop.

    Attributes:
        drone: the client.
        status: the vehicle's newest status; None while unknown.
        home: its home position and the altitude of home (m AMSL); None before it has one.

    Args:
        url: the API's address.
        timeout: s until it must be connected.

    Raises:
        ConnectionTimeoutError, AerpawConnectionError: the connection failed.
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
        if not self._connected.wait(timeout + 2 * FIRST_MESSAGES_TIMEOUT):
            self.close()
            raise ConnectionTimeoutError(timeout)
        if self._error is not None:
            raise AerpawConnectionError(str(self._error), self._error) from self._error

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._main = self._loop.create_task(self._stay_connected())
            with contextlib.suppress(asyncio.CancelledError):
                self._loop.run_until_complete(self._main)
            tasks = asyncio.all_tasks(self._loop)
            for task in tasks:
                task.cancel()
            self._loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
        finally:
            self._connected.set()
            self._loop.close()

    async def _stay_connected(self) -> None:
        try:
            async with connect(self._url, timeout=self._timeout) as self.drone:
                await asyncio.gather(self._update_status(), self.ask_home())
                telemetry = self.drone.telemetry
                await telemetry.shows(
                    lambda: all(telemetry.age(name) is not None for name in FIRST_MESSAGES), FIRST_MESSAGES_TIMEOUT
                )
                self._connected.set()
                await asyncio.gather(
                    self._repeat(STATUS_PERIOD, self._update_status), self._repeat(HOME_PERIOD, self.ask_home)
                )
        except UavApiError as error:
            self._error = error

    async def _repeat(self, seconds: float, update: Callable[[], Awaitable[None]]) -> None:
        while True:
            await update()
            await asyncio.sleep(seconds if self.home else STATUS_PERIOD)

    async def _update_status(self) -> None:
        try:
            self.status = await self.drone.status()
        except UavApiError as error:
            log.debug("no status: %s", error)
            self.status = None

    async def ask_home(self) -> None:
        """Request the home position; arming changes it."""
        try:
            self.home = await self.drone.home()
        except NotFound:
            self.home = None
        except UavApiError as error:
            log.debug("no home: %s", error)

    async def run(self, verb: Callable[[], Awaitable[T]]) -> T:
        """Run a verb of the client from a script's own loop; a cancellation is passed on.

        Raises:
            NotConnectedError: the vehicle was closed.
        """
        if not self._thread.is_alive() or self._loop.is_closed():
            raise NotConnectedError("the vehicle's connection was closed")

        async def running() -> T:
            return await verb()

        return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(running(), self._loop))

    def close(self) -> None:
        """End the thread; running verbs end on the vehicle."""
        if self._thread.is_alive() and self._main is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                self._loop.call_soon_threadsafe(self._main.cancel)
        self._thread.join(CLOSE_TIMEOUT)
