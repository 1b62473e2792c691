"""The `Drone` of aerpawlib's scripts: a copter."""

from __future__ import annotations

import asyncio

from mavproxy_uavapi.aerpaw.constants import DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE
from mavproxy_uavapi.aerpaw.exceptions import HeadingError, LandingError, RTLError, TakeoffError
from mavproxy_uavapi.aerpaw.helpers import normalize_heading
from mavproxy_uavapi.aerpaw.moving import MovingVehicle

CLIMB_TIMEOUT = 30.0  # s after the takeoff's answer for the rest of the climb


class Drone(MovingVehicle):
    """A multirotor."""

    kind = "Drone"
    hovers = True

    async def takeoff(self, target_alt: float, min_alt_tolerance: float = DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE) -> None:
        """Arm it if necessary, and climb to `target_alt` m above home.

        Returns at the share `min_alt_tolerance` of that altitude; the next movement waits for the end of the climb.

        Raises:
            TakeoffError: it did not reach that altitude.
        """
        self._log_event("command", type="takeoff", altitude_m=target_alt)

        def high_enough() -> bool:
            return self.connected and self.position.alt >= target_alt * min_alt_tolerance

        async def climb() -> None:
            async with self._turn():
                await self._command(TakeoffError, lambda drone: drone.takeoff(target_alt))

        early = min_alt_tolerance < DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE
        await self._until(climb(), high_enough if early else lambda: False)
        loop = asyncio.get_running_loop()
        deadline = loop.time() + CLIMB_TIMEOUT
        while not high_enough():
            if loop.time() > deadline:
                raise TakeoffError(f"it hovers at {self.position.alt:.1f} m instead of {target_alt} m")
            await asyncio.sleep(0.05)

    async def land(self) -> None:
        """Land where it is; returns when it has disarmed.

        Raises:
            LandingError: the landing failed.
        """
        self._log_event("command", type="land")
        async with self._turn():
            await self._command(LandingError, lambda drone: drone.land())

    async def return_to_launch(self) -> None:
        """Return to launch and land there, in the autopilot's RTL; returns when it has disarmed.

        Raises:
            RTLError: the return failed.
        """
        self._log_event("command", type="return_to_launch")
        async with self._turn():
            await self._command(RTLError, lambda drone: drone.rtl())

    def _lock(self, heading: float | None) -> None:
        if heading is not None:
            self._current_heading = normalize_heading(heading)

    async def set_heading(self, heading: float | None, blocking: bool = True, lock_in: bool = True) -> None:
        """Turn to `heading` degrees, the shorter way round.

        Args:
            heading: clockwise from north, any number; None clears the heading for the next movement.
            blocking: whether to turn now and wait for it; otherwise it turns with the next movement.
            lock_in: whether the next movement keeps this heading.

        Raises:
            HeadingError: it did not turn.
        """
        if heading is None:
            self._current_heading = None
            return
        degrees = normalize_heading(heading)
        if not blocking:
            self._lock(degrees if lock_in else None)
            return
        async with self._turn():
            self._lock(degrees if lock_in else None)
            await self._command(HeadingError, lambda drone: drone.turn_to(degrees))
