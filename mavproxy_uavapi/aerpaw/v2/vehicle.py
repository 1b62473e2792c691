"""`aerpawlib.v2.vehicle`: the vehicles of `v1`, with `connect`, movements as tasks, and checks before commands."""

# ruff: noqa: PLR0917 - the signatures are aerpawlib's

from __future__ import annotations

import asyncio
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

from typing_extensions import Self

from mavproxy_uavapi.aerpaw import drone as v1
from mavproxy_uavapi.aerpaw import dummy_vehicle, on_exit, rover, vehicle
from mavproxy_uavapi.aerpaw.constants import (
    CONNECTION_TIMEOUT_S,
    DEFAULT_GOTO_TIMEOUT_S,
    DEFAULT_MAVSDK_SERVER_PORT,
    DEFAULT_MIN_BATTERY_PERCENT,
    DEFAULT_POSITION_TOLERANCE_M,
    DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE,
)
from mavproxy_uavapi.aerpaw.exceptions import HeartbeatLostError, RTLError
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.helpers import validate_tolerance
from mavproxy_uavapi.aerpaw.safety_rules import ALLOWED, Verdict
from mavproxy_uavapi.aerpaw.v2.platform import AerpawPlatform
from mavproxy_uavapi.aerpaw.v2.safety import PreflightChecks, SafetyChecker
from mavproxy_uavapi.aerpaw.v2.task import VehicleTask
from mavproxy_uavapi.aerpaw.vehicle_thread import VehicleThread
from mavproxy_uavapi.client.places import Position
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.timeout import kept

CHECK_PERIOD = 0.2  # s between checks of the heartbeat


class Vehicle(vehicle.Vehicle):
    """A vehicle of any type. Its properties are the newest telemetry; its subclasses move.

    Attributes:
        safety: the safety checker that the `can_…` methods ask, too; None without one.

    Args, errors:
        See `connect`.
    """

    def __init__(
        self,
        connection_string: str,
        mavsdk_server_port: int = DEFAULT_MAVSDK_SERVER_PORT,
        *,
        timeout: float = CONNECTION_TIMEOUT_S,
        safety: SafetyChecker | None = None,
        aerpaw_platform: AerpawPlatform | None = None,
    ) -> None:
        super().__init__(connection_string, mavsdk_server_port, timeout=timeout)
        self.safety = safety
        self._platform = aerpaw_platform or self._platform
        self._watches: set[asyncio.Task[None]] = set()
        self._task: VehicleTask | None = None
        self._was_armed = False

    # -- the connection -----------------------------------------------------------------------------------

    @classmethod
    async def connect(
        cls,
        connection_string: str = "",
        mavsdk_server_port: int = DEFAULT_MAVSDK_SERVER_PORT,
        *,
        timeout: float = CONNECTION_TIMEOUT_S,
        safety: SafetyChecker | None = None,
        aerpaw_platform: AerpawPlatform | None = None,
    ) -> Self:
        """Connect to a vehicle's API, such as `http://127.0.0.1:8000`, within `timeout` s.

        Raises:
            ConnectionTimeoutError, AerpawConnectionError: nothing answers there, or it is not such an address.
        """
        make = partial(cls, connection_string, timeout=timeout, safety=safety, aerpaw_platform=aerpaw_platform)
        making = asyncio.ensure_future(asyncio.to_thread(make))
        try:
            return await kept(making)
        except asyncio.CancelledError:
            making.add_done_callback(_close)
            raise

    async def aclose(self) -> None:
        """Close the connection; a running movement ends, and the vehicle stops."""
        for task in [*self._watches, *self._background]:
            task.cancel()
        await asyncio.to_thread(super().close)

    def close(self) -> None:
        """As `aclose`; it blocks."""
        warnings.warn("use 'await vehicle.aclose()' instead of close()", DeprecationWarning, stacklevel=2)
        super().close()

    async def initialize(self, should_arm: bool = True) -> None:  # type: ignore[override]  # v1's blocks
        """Wait until it is ready to arm, at most ARMABLE_TIMEOUT_S."""
        await asyncio.to_thread(super().initialize, should_arm)

    _preflight_wait = initialize  # type: ignore[assignment]

    @property
    def link_alive(self) -> bool:
        """As `connected`."""
        return self.connected

    def heartbeat_tick(self) -> None:
        """Do nothing: its heartbeats arrive by themselves."""

    def watch_disconnect(
        self, timeout: float, *, on_disconnect: Callable[[], None] | None = None
    ) -> asyncio.Future[None]:
        """A future that fails with HeartbeatLostError after `timeout` s without a heartbeat.

        `on_disconnect` is called then, in a thread.
        """
        watch = asyncio.ensure_future(self._watch(timeout, on_disconnect))
        self._watches.add(watch)
        watch.add_done_callback(self._watches.discard)
        return watch

    async def _watch(self, timeout: float, on_disconnect: Callable[[], None] | None) -> None:
        while self.heartbeat_age <= timeout:  # noqa: ASYNC110 - a property of another thread
            await asyncio.sleep(CHECK_PERIOD)
        if on_disconnect is not None:
            await asyncio.to_thread(on_disconnect)
        raise HeartbeatLostError(self.heartbeat_age)

    def has_disarmed_unexpectedly(self) -> bool:
        """Whether it has disarmed since the last call, and no command of the script lands or disarms it."""
        before, self._was_armed = self._was_armed, self.connected and self.armed
        return before and self.connected and not self._was_armed and not self._may_disarm

    # -- checks before commands ---------------------------------------------------------------------------

    async def can_takeoff(self, altitude: float, min_battery_percent: float = DEFAULT_MIN_BATTERY_PERCENT) -> Verdict:
        """Whether a takeoff to `altitude` m above home would be allowed now, and if not, why; nothing moves."""
        if not self.armable:
            return False, f"Vehicle not armable: {self._why_not()}"
        if not PreflightChecks.check_gps_fix(self):
            return False, f"No 3D GPS fix (fix_type={self.gps.fix_type})"
        if not PreflightChecks.check_battery(self, min_battery_percent):
            return False, f"Battery {self.battery.level}% below {min_battery_percent}%"
        here = self.position
        allowed = await self._may_go_to(Coordinate(here.lat, here.lon, altitude))
        if allowed[0] and self.safety is not None:
            return await self.safety.validate_takeoff(altitude, here.lat, here.lon)
        return allowed

    async def can_goto(self, target: Coordinate, tolerance: float = DEFAULT_POSITION_TOLERANCE_M) -> Verdict:
        """Whether it would be allowed to go to a position now, and if not, why; nothing moves."""
        try:
            validate_tolerance(tolerance, "tolerance")
        except ValueError as error:
            return False, str(error)
        allowed = await self._may_go_to(target)
        if allowed[0] and self.safety is not None:
            return await self.safety.validate_waypoint(self.position, target)
        return allowed

    async def can_land(self) -> Verdict:
        """Whether it would be allowed to land here. The API never refuses a landing."""
        if self.safety is not None:
            return await self.safety.validate_landing(self.position.lat, self.position.lon)
        return ALLOWED

    async def _may_go_to(self, target: Coordinate) -> Verdict:
        try:
            await self._thread.run(lambda: self._thread.drone.check(Position(target.lat, target.lon, target.alt)))
        except UavApiError as error:
            return False, str(error)
        return ALLOWED

    # -- movements ----------------------------------------------------------------------------------------

    async def await_ready_to_move(self) -> None:
        """Wait until it is armed, and the present movements have ended.

        Raises:
            AerpawlibError: the last task has failed, and nobody waited for it; or it cannot be armed.
            TimeoutError: the movements take too long.
        """
        await super().await_ready_to_move()
        if self._task is not None:
            self._task.raise_untold()

    async def goto_coordinates(  # type: ignore[override]  # v1's makes no task
        self,
        coordinates: Coordinate,
        tolerance: float | None = None,
        target_heading: float | None = None,
        timeout: float = DEFAULT_GOTO_TIMEOUT_S,
        blocking: bool = True,
    ) -> VehicleTask | None:
        """Go to a position; returns within `tolerance` m of it (2 m; for a rover 2.1 m), or at once with a task.

        Args:
            coordinates: the position.
            tolerance: m.
            target_heading: where a drone points on the way, degrees; in the direction of travel by default.
            timeout: s that it may take.
            blocking: False for a task, as soon as the vehicle goes there.

        Raises:
            ValueError: the tolerance is invalid.
            NavigationError: it was refused, or did not arrive.
        """
        if blocking:
            await super().goto_coordinates(coordinates, tolerance, target_heading, timeout)
            return None
        limit = vehicle.distinct(timeout)
        distance = coordinates.distance if self.hovers else coordinates.ground_distance
        way = distance(self.position) or 1.0
        task = VehicleTask(lambda: 1.0 - distance(self.position) / way)
        movement = asyncio.ensure_future(self._go_to(coordinates, tolerance, target_heading, limit))
        await self._until(movement, lambda: True, limit)
        task.follow(movement)
        task.set_on_cancel(partial(self._break_off, movement, self._turns))
        self._task = task
        return task

    def _break_off(self, movement: asyncio.Future[None], turn: int) -> Any:
        """End the movement that has that number; the vehicle stops."""
        movement.cancel()

    async def goto_ned(
        self, north: float, east: float, down: float = 0, *way: Any, **more: Any
    ) -> VehicleTask | None:
        """As `goto_coordinates`, to a place in m from here."""
        return await self.goto_coordinates(self.position + VectorNED(north, east, down), *way, **more)

    async def goto_north(self, meters: float, *way: Any, **more: Any) -> VehicleTask | None:
        """As `goto_coordinates`, to the north."""
        return await self.goto_ned(meters, 0, 0, *way, **more)

    async def goto_east(self, meters: float, *way: Any, **more: Any) -> VehicleTask | None:
        """As `goto_coordinates`, to the east."""
        return await self.goto_ned(0, meters, 0, *way, **more)

    async def goto_south(self, meters: float, *way: Any, **more: Any) -> VehicleTask | None:
        """As `goto_coordinates`, to the south."""
        return await self.goto_ned(-meters, 0, 0, *way, **more)

    async def goto_west(self, meters: float, *way: Any, **more: Any) -> VehicleTask | None:
        """As `goto_coordinates`, to the west."""
        return await self.goto_ned(0, -meters, 0, *way, **more)

    async def goto_bearing(self, bearing_deg: float, distance_m: float, *way: Any, **more: Any) -> VehicleTask | None:
        """As `goto_coordinates`, in that direction, degrees clockwise from north."""
        to = VectorNED(distance_m, 0, 0).rotate_by_angle(-bearing_deg)
        return await self.goto_ned(to.north, to.east, 0, *way, **more)


def _close(connected: asyncio.Future[Any]) -> None:
    """Close a vehicle that nobody waits for any more."""
    if connected.exception() is None:
        vehicle.Vehicle.close(connected.result())


class Drone(Vehicle, v1.Drone):
    """A multirotor."""

    async def takeoff(self, altitude: float, min_alt_tolerance: float = DEFAULT_TAKEOFF_ALTITUDE_TOLERANCE) -> None:
        """As `v1`'s, to `altitude` m above home."""
        await super().takeoff(altitude, min_alt_tolerance)

    async def set_velocity(
        self, velocity: VectorNED, global_relative: bool = True, duration: float | None = None
    ) -> None:
        """As `v1`'s."""
        await super().set_velocity(velocity, global_relative, duration)

    async def stop_velocity(self) -> None:
        """End the velocity; the drone stops."""
        if self._mark and await self._is_commanded_with(self._mark):
            await self._stop()

    async def _break_off(self, movement: asyncio.Future[None], turn: int) -> None:
        """Return to launch instead, unless the pilot has the vehicle, or it has arrived and does something else."""
        if movement.done() and turn != self._turns:
            return
        self._may_disarm = True
        try:
            if not await on_exit.apply_policy(self, "rtl", "the task was cancelled"):
                self._may_disarm = False
                raise RTLError("the task was cancelled")
        finally:
            movement.cancel()


class Rover(Vehicle, rover.Rover):
    """A rover or boat; altitudes and target headings are ignored."""


class DummyVehicle(dummy_vehicle.DummyVehicle, Vehicle):
    """A vehicle that does nothing. It reports that it is connected, and ready to arm on the ground."""

    def __init__(self, connection_string: str = "", *, safety: SafetyChecker | None = None, **_: Any) -> None:
        Vehicle.__init__(self, connection_string, safety=safety)

    async def _go_to(self, *_: Any) -> None:
        """Do nothing."""

    async def goto_coordinates(  # type: ignore[override]
        self, coordinates: Coordinate, tolerance: float | None = None, *_: Any, blocking: bool = True, **__: Any
    ) -> VehicleTask | None:
        """Do nothing; a task is done."""
        task = VehicleTask()
        task.set_progress(1.0)
        task.set_complete()
        return None if blocking else task

    def close(self) -> None:
        """Mark it as closed."""
        vehicle.Vehicle.close(self)


class MockVehicle(DummyVehicle):
    """A DummyVehicle at places that a test chooses.

    Args:
        position: where it is.
        home: its home; by default the position.
        armed: whether it reports that it is armed.
        connected: False for a vehicle that is closed already.
    """

    def __init__(
        self,
        position: Coordinate | None = None,
        home: Coordinate | None = None,
        *,
        armed: bool = False,
        connected: bool = True,
    ) -> None:
        super().__init__()
        self._closed = not connected
        self._state.update_armed(armed)
        if position is not None:
            self._state.update_position(position.lat, position.lon, position.alt)
        if (home := home or position) is not None:
            self._state.update_home(home.lat, home.lon)

    def _connect(self, address: str, timeout: float) -> VehicleThread:
        self._state = dummy_vehicle.DummyThread(time.monotonic)
        return self._state

    def heartbeat_tick(self) -> None:
        """Report a heartbeat."""
        self._state.update_armed(self.armed)
