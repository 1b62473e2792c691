"""A copter, as aerpawlib's scripts fly it."""

from __future__ import annotations

import asyncio

from mavproxy_uavapi.aerpaw.constants import (
    DEFAULT_GOTO_TIMEOUT_S,
    DEFAULT_POSITION_TOLERANCE_M,
    DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE,
)
from mavproxy_uavapi.aerpaw.exceptions import (
    HeadingError,
    LandingError,
    NavigationError,
    RTLError,
    TakeoffError,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.helpers import normalize_heading, validate_tolerance
from mavproxy_uavapi.aerpaw.moving import MovingVehicle
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.client.places import Position

CLIMBED_WITHIN = 30.0  # s after a take-off to the share of the altitude that the script wants


class Drone(MovingVehicle):
    """A multirotor."""

    kind = "Drone"
    hovers = True

    async def takeoff(self, target_alt: float, min_alt_tolerance: float = DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE) -> None:
        """Arm it where it is not armed, and climb to `target_alt` m above home.

        The script goes on from `min_alt_tolerance` of it on; the next movement waits for the end of the climb.

        Raises:
            TakeoffError.
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
        deadline = loop.time() + CLIMBED_WITHIN
        while not high_enough():
            if loop.time() > deadline:
                raise TakeoffError(f"it hovers at {self.position.alt:.1f} m, and {target_alt} m were wanted")
            await asyncio.sleep(0.05)

    async def land(self) -> None:
        """Land where it is; done when it has disarmed.

        Raises:
            LandingError.
        """
        self._log_event("command", type="land")
        async with self._turn():
            await self._command(LandingError, lambda drone: drone.land())

    async def return_to_launch(self) -> None:
        """Return to where it was armed and land there, by the autopilot's RTL; done when it has disarmed.

        Raises:
            RTLError.
        """
        self._log_event("command", type="return_to_launch")
        async with self._turn():
            await self._command(RTLError, lambda drone: drone.rtl())

    async def goto_coordinates(
        self,
        coordinates: Coordinate,
        tolerance: float = DEFAULT_POSITION_TOLERANCE_M,
        target_heading: float | None = None,
        timeout: float = DEFAULT_GOTO_TIMEOUT_S,
    ) -> None:
        """Fly to a place; done within `tolerance` m of it. It points to `target_heading`, or to where it goes.

        Raises:
            ValueError: the tolerance is none.
            NavigationError: it did not arrive, within `timeout` s.
        """
        validate_tolerance(tolerance, "tolerance")
        if target_heading is not None:
            await self.set_heading(target_heading, blocking=False)
        self._log_event(
            "command", type="goto_coordinates", lat=coordinates.lat, lon=coordinates.lon, alt_m=coordinates.alt
        )
        async with self._turn():
            heading, self._current_heading = self._current_heading, None
            target = Position(coordinates.lat, coordinates.lon, coordinates.alt)

            async def fly(drone: Client) -> None:
                await drone.go_to(target, heading=heading, look_at_target=True, tolerance=tolerance, timeout=timeout)

            await self._until(
                self._command(NavigationError, fly),
                lambda: self.connected and coordinates.distance(self.position) <= tolerance,
            )

    async def set_heading(self, heading: float | None, blocking: bool = True, lock_in: bool = True) -> None:
        """Turn to `heading` degrees, the shorter way round.

        Args:
            heading: clockwise from north, any number; None forgets the one that is locked in.
            blocking: turn, and wait for it; else it only turns with the next movement.
            lock_in: have the next movement keep it.

        Raises:
            HeadingError.
        """
        if heading is None:
            self._current_heading = None
            return
        wanted = normalize_heading(heading)
        if not blocking:
            if lock_in:
                self._current_heading = wanted
            return
        async with self._turn():
            if lock_in:
                self._current_heading = wanted
            await self._command(HeadingError, lambda drone: drone.turn_to(wanted))
