"""`aerpawlib.v1.vehicle`: waits and verbs of all types of vehicles."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, TypeVar

from mavproxy_uavapi.aerpaw.constants import (
    ARMABLE_TIMEOUT_S,
    CONNECTION_TIMEOUT_S,
    DEFAULT_GOTO_TIMEOUT_S,
    POLLING_DELAY_S,
)
from mavproxy_uavapi.aerpaw.event_log import StructuredEventLogger
from mavproxy_uavapi.aerpaw.exceptions import (
    AerpawConnectionError,
    ArmError,
    CommandError,
    DisarmError,
    InvalidSpeedError,
    LandingError,
    NotArmableError,
    NotConnectedError,
    NotImplementedForVehicleError,
    RTLError,
    TakeoffError,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.platform import AERPAW_Platform
from mavproxy_uavapi.aerpaw.vehicle_telemetry import VehicleTelemetry
from mavproxy_uavapi.aerpaw.vehicle_thread import VehicleThread
from mavproxy_uavapi.client.drone import Drone as Client
from mavproxy_uavapi.core.errors import Rejected, Superseded, UavApiError
from mavproxy_uavapi.core.timeout import kept

log = logging.getLogger("aerpawlib.v1.vehicle")
T = TypeVar("T")

HEARTBEAT_AGE = 3.0  # s; without a heartbeat for longer the vehicle is not connected
CHECK_PERIOD = 0.05  # s between checks whether the script may go on
MOST_SPEED = 50.0  # m/s, the API's limit
SLIGHTLY = 1e-4  # s by which times of requests differ at most
LANDS = (LandingError, RTLError, DisarmError)  # the errors of the commands that end with a disarmed vehicle
LIFTS = (ArmError, TakeoffError)
SCHEMES = ("http://", "https://")


def distinct(seconds: float) -> float:
    """That many s, slightly changed: a number that no other request has. The API joins equal requests to one job."""
    change = SLIGHTLY * (1.0 - random.random())
    return seconds - change if seconds > SLIGHTLY else seconds + change  # it stays within the API's limits


class Vehicle(VehicleTelemetry):
    """A vehicle of any type: telemetry and arming. Its subclasses move.

    Movements wait for earlier ones; each ends after its timeout at the latest.

    Args:
        connection_string: the address of the vehicle's API, `http://127.0.0.1:8000`.
        mavsdk_server_port: ignored; MAVSDK is not used.
        timeout: s until it must be connected.

    Raises:
        AerpawConnectionError: nothing answers there, or it is not such an address.
    """

    kind = "generic Vehicle"
    hovers = False
    _platform = AERPAW_Platform

    def __init__(
        self, connection_string: str, mavsdk_server_port: int = 50051, *, timeout: float | None = None
    ) -> None:
        super().__init__(self._connect(connection_string, CONNECTION_TIMEOUT_S if timeout is None else timeout))
        self._will_arm = True
        self._is_ours = False  # it was in GUIDED for us; in another mode it belongs to its pilot from then on
        self._commands = 0  # of the script that took it, ever
        self._superseded = 0  # the newest of them that was superseded
        self._may_disarm = False  # a command lands or disarms it, and none has armed it since
        self._current_heading: float | None = None  # degrees, for the next movement
        self._refused_speed: float | None = None  # m/s, for the next movement
        self._moves: list[asyncio.Future[None]] = []  # running and waiting movements, oldest first
        self._turns = 0  # movements that have begun or wait, ever
        self._background: set[asyncio.Task[None]] = set()  # verbs that still run; a newer one ends them
        self._readying: asyncio.Task[None] | None = None
        self._mission_start_time: float | None = None
        self._events: StructuredEventLogger | None = None

    def _connect(self, address: str, timeout: float) -> VehicleThread:
        if not address.startswith(SCHEMES):
            raise AerpawConnectionError(
                f"{address!r} is not the address of an HTTP API; use http://127.0.0.1:8000, because "
                "MAVProxy has the MAVLink connection"
            )
        return VehicleThread(address, timeout)

    # -- the order of movements ---------------------------------------------------------------------------

    def done_moving(self) -> bool:
        """Whether it is connected, and no movement runs or waits."""
        return self.connected and not self._moves

    async def await_ready_to_move(self) -> None:
        """Wait until it is armed, and the present movements have ended.

        Raises:
            NotArmableError, ArmError: it is not armed.
            TimeoutError: the movements take too long.
        """
        before = list(self._moves)
        await self._get_ready()
        await self._ended(before)

    async def _ended(self, moves: list[asyncio.Future[None]]) -> None:
        if moves and (await asyncio.wait(moves, timeout=DEFAULT_GOTO_TIMEOUT_S))[1]:
            raise TimeoutError(f"the earlier movements have not ended within {DEFAULT_GOTO_TIMEOUT_S:g} s")

    @contextlib.asynccontextmanager
    async def _turn(self) -> AsyncIterator[None]:
        """The context of a movement; it waits for earlier ones. `done_moving` is false from now until its end."""
        mine, before = asyncio.get_running_loop().create_future(), list(self._moves)
        self._moves.append(mine)
        self._turns += 1
        try:
            await self._get_ready()
            await self._ended(before)
            if self._refused_speed is not None:
                await self._set_speed(self._refused_speed)
            if self._mission_start_time is None:
                self._mission_start_time = time.time()
            yield
        finally:
            self._moves.remove(mine)
            mine.cancel()

    async def _until(self, verb: Awaitable[None], reached: Callable[[], bool], mark: float | None = None) -> None:
        """Wait until the verb has ended, or `reached` holds; then the verb goes on until a newer one ends it.

        Args:
            verb: the verb.
            reached: whether the script may go on.
            mark: a number that only the verb's request has, see `distinct`. Then the script goes on only when this
                request commands the vehicle: a request that arrives later would supersede the script's next one.
        """

        task = asyncio.ensure_future(verb)
        try:
            while not (await asyncio.wait({task}, timeout=CHECK_PERIOD))[0]:
                if reached() and (mark is None or await self._is_commanded_with(mark)):
                    self._continue_in_background(task)
                    return
        except asyncio.CancelledError:
            task.cancel()
            raise
        task.result()

    async def _is_commanded_with(self, mark: float) -> bool:
        """Whether the request that commands the vehicle now has that number."""
        try:
            command = await self._thread.run(self._thread.drone.command)
        except (UavApiError, NotConnectedError) as error:  # the verb's own request says what is wrong
            log.debug("it is unknown who commands the vehicle: %s", error)
            return False
        return command is not None and mark in command.request.values()

    def _continue_in_background(self, task: asyncio.Task[None]) -> None:
        self._background.add(task)
        task.add_done_callback(self._background_ended)

    def _background_ended(self, task: asyncio.Task[None]) -> None:
        self._background.discard(task)
        if task.cancelled() or (error := task.exception()) is None:
            return
        cause = getattr(error, "original_error", None) or error
        level = logging.DEBUG if isinstance(cause, Superseded) else logging.WARNING
        log.log(level, "a movement in the background ended: %s", error)

    # -- arming -------------------------------------------------------------------------------------------

    def initialize(self, should_arm: bool = True) -> None:
        """Wait until it is ready to arm, at most ARMABLE_TIMEOUT_S. It blocks."""
        self._will_arm = should_arm
        deadline = time.monotonic() + ARMABLE_TIMEOUT_S
        while not (self.armable and self.home_coords) and time.monotonic() < deadline:
            time.sleep(POLLING_DELAY_S)
        if not self.armable:
            log.warning("the vehicle is not ready to be armed: %s", self._why_not())

    _preflight_wait = initialize

    def _why_not(self) -> str:
        status = self._thread.status
        return "its status is unknown" if status is None else "; ".join(status.why_not) or "it is armed"

    async def _get_ready(self) -> None:
        """Arm it if necessary and switch it to GUIDED at the first command; all callers share one attempt."""
        if self._readying is None or self._readying.done():
            self._readying = asyncio.ensure_future(self._arm_vehicle())
        await kept(self._readying)

    async def _arm_vehicle(self) -> None:
        """Arm it and switch it to GUIDED. In AERPAW's environment its safety pilot arms it.

        A vehicle that was ours and has left GUIDED belongs to its pilot; the API then refuses the command.
        """
        if not self.armed and self._will_arm:
            if self._platform._connected:
                await asyncio.to_thread(self._platform.log_to_oeo, "[aerpawlib] Waiting for safety pilot to arm")
                while not self.armed:  # noqa: ASYNC110 - a property of another thread
                    await asyncio.sleep(CHECK_PERIOD)
                self._is_ours = False
            else:
                await self.set_armed(True)
                self._is_ours = True
            await self._thread.run(self._thread.ask_home)
        if not self._is_ours and self.mode != "GUIDED":
            await self._command(ArmError, lambda drone: drone.guided())
        self._is_ours = True

    async def set_armed(self, value: bool) -> None:
        """Arm or disarm it; returns when telemetry shows it.

        Raises:
            NotArmableError: it is not ready to arm.
            ArmError, DisarmError: the command failed.
        """
        if not value:
            await self._command(DisarmError, lambda drone: drone.disarm())
            return
        if not (self.armable or self.armed):
            raise NotArmableError(self._why_not())
        await self._command(ArmError, lambda drone: drone.arm(ARMABLE_TIMEOUT_S))

    # -- verbs --------------------------------------------------------------------------------------------

    async def _command(
        self, kind: type[CommandError], verb: Callable[[Client], Awaitable[None]], *, takes: bool = True
    ) -> None:
        """Run a verb of the client, which `takes` the vehicle or not; its error becomes one of class `kind`."""
        self._commands += takes
        number = self._commands
        self._may_disarm = kind in LANDS or (self._may_disarm and kind not in LIFTS)
        try:
            await self._thread.run(lambda: verb(self._thread.drone))
        except UavApiError as error:
            self._may_disarm = self._may_disarm and kind not in LANDS
            if takes and isinstance(error, Superseded):
                self._superseded = max(self._superseded, number)
            texts = error.statustext if isinstance(error, Rejected) else ()
            reasons = f" ({'; '.join(texts)})" if texts else ""
            raise kind(f"{error}{reasons}", error) from error

    async def goto_coordinates(
        self,
        coordinates: Coordinate,
        tolerance: float | None = None,
        target_heading: float | None = None,
        timeout: float = DEFAULT_GOTO_TIMEOUT_S,
    ) -> None:
        """Go to a position; returns within `tolerance` m of it, by default 2 m, for a rover 2.1 m.

        A drone points to `target_heading`, or in the direction of travel.

        Raises:
            ValueError: the tolerance is invalid.
            NavigationError: it did not arrive within `timeout` s.
            NotImplementedForVehicleError: a generic vehicle does not move.
        """
        await self._go_to(coordinates, tolerance, target_heading, distinct(timeout))

    async def _go_to(
        self, coordinates: Coordinate, tolerance: float | None, heading: float | None, limit: float
    ) -> None:
        """As `goto_coordinates`, with the timeout `limit` as the number that only its request has."""
        raise NotImplementedForVehicleError("goto_coordinates", self.kind)

    async def set_velocity(
        self, velocity_vector: VectorNED, global_relative: bool = True, duration: float | None = None
    ) -> None:
        """Raise NotImplementedForVehicleError: a generic vehicle does not move."""
        raise NotImplementedForVehicleError("set_velocity", self.kind)

    async def set_groundspeed(self, velocity: float) -> None:
        """Set the ground speed (m/s) for flights to positions.

        A rover refuses it before it drives; then it is set with the next movement.

        Raises:
            InvalidSpeedError: it is not above 0, or above the API's limit.
        """
        speed = float(velocity)
        if not 0 < speed <= MOST_SPEED:
            raise InvalidSpeedError(speed, 0, MOST_SPEED)
        self._log_event("command", type="set_groundspeed", speed_m_s=speed)
        self._refused_speed = None
        await self._set_speed(speed)

    async def _set_speed(self, speed: float) -> None:
        """Set the ground speed. A refusal is logged, and the next movement tries again: scripts do not expect one."""
        is_last_try = self._refused_speed is not None
        self._refused_speed = None
        try:
            await self._command(CommandError, lambda drone: drone.set_speed(speed), takes=False)
        except CommandError as error:
            self._refused_speed = None if is_last_try else speed
            log.log(logging.WARNING if is_last_try else logging.INFO, "the ground speed was not set: %s", error)

    async def _stop(self) -> None:
        """End the verbs in the background; the vehicle stops."""
        for task in list(self._background):
            task.cancel()

    # -- the end of the script ----------------------------------------------------------------------------

    @property
    def has_commanded(self) -> bool:
        """Whether the script has commanded it."""
        return self._commands > 0

    @property
    def is_superseded(self) -> bool:
        """Whether its last command was superseded: by another client's, because the script has given no later one."""
        return self.has_commanded and self._superseded == self._commands

    async def run_last(self, verb: Callable[[Client], Awaitable[T]]) -> T:
        """Run a verb of the client after the script's end; its errors are the API's."""
        return await self._thread.run(lambda: verb(self._thread.drone))

    def log_telemetry(self) -> None:
        """Write its telemetry to the event log."""
        if self._events is None:
            return
        with contextlib.suppress(NotConnectedError):  # there is no telemetry now
            here, v, battery, gps = self.position, self.velocity, self.battery, self.gps
            place = {"lat": here.lat, "lon": here.lon, "alt_m": here.alt, "heading_deg": self.heading}
            motion = {"vel_n_m_s": v.north, "vel_e_m_s": v.east, "vel_d_m_s": v.down}
            state = {"mode": self.mode, "armed": self.armed, "gps_fix": gps.fix_type}
            power = {"battery_v": battery.voltage, "battery_pct": battery.level}
            self._log_event("telemetry", **place, **motion, **state, **power)

    def set_event_log(self, event_log: StructuredEventLogger | None) -> None:
        """Write commands and telemetry to that log."""
        self._events = event_log

    def _log_event(self, event: str, **members: Any) -> None:
        if self._events is not None:
            self._events.log_event(event, **members)

    def close(self) -> None:
        """Close the connection; a running movement ends, and the vehicle stops."""
        if not self._closed:
            self._closed = True
            self._thread.close()
