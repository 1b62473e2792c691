"""Flight by setpoints in GUIDED: positions, velocities and yaw."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable

from mavproxy_uavapi.core.errors import Busy, Invalid, Stale, Superseded, TimedOut
from mavproxy_uavapi.core.mavlink.link import Link
from mavproxy_uavapi.core.mavlink.pending_waits import PendingWaits
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import messages, setpoint_in_force, time_limits
from mavproxy_uavapi.core.vehicle.authority import YAW, Rank
from mavproxy_uavapi.core.vehicle.geodesy import offset, rotate
from mavproxy_uavapi.core.vehicle.jobs import Job
from mavproxy_uavapi.core.vehicle.messages import NO_YAW, GlobalTarget, NedTarget, Target, VelocityTarget, Yaw
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

GUIDED = "GUIDED"
TOLERANCE = 1.0  # m, horizontally and vertically
ARRIVAL_SPEED = 0.5  # m/s; slower than this the vehicle does not overshoot its tolerance any more
FLOOR = 0.0  # m above home: no target lies lower, but for the noise of the estimate
RESENDS_PER_TIMEOUT = 3  # velocity setpoints sent in each GUID_TIMEOUT
HEADING_TOLERANCE = 3.0  # degrees
RATE_TOLERANCE = 2.0, 0.2  # deg/s, and a share of the rate
SLOWEST_TURN = 10.0  # deg/s: a vehicle that turns slower than this does not turn
REST_PERIOD = 0.3  # s between two zero velocities
REST_SHOWN = 1.0  # s
REST_TIMEOUT = 10.0  # s
TARGET_SHOWN = 2.0  # s after a setpoint in which telemetry may still tell the one before
SAME_PLACE = 2.0  # m on each axis, between targets that are told
TAKING_OFF = messages.mavlink.MAV_LANDED_STATE_TAKEOFF


class GuidedVehicle(Vehicle):
    """A vehicle that hovers, and takes setpoints in GUIDED."""

    def __init__(self, state: VehicleState, link: Link, pending: PendingWaits, clock: Callable[[], float]) -> None:
        super().__init__(state, link, pending, clock)
        self._sent: Target | None = None  # our newest setpoint, until telemetry tells the one in force
        self._sent_at = 0.0
        self._shown: GlobalTarget | None = None  # as the autopilot tells it

    def require_guided_flight(self) -> None:
        """Raises NotArmed, ModeChanged or Busy unless it flies in GUIDED."""
        self.require_armed()
        self.require_mode(GUIDED)
        if self.state.landed:
            raise Busy("the vehicle is on the ground; `takeoff` first")

    @property
    def is_taking_off(self) -> bool:
        """Whether the autopilot says that it climbs from the ground, whoever told it to."""
        return bool(self.state.recent_field("EXTENDED_SYS_STATE", "landed_state") == TAKING_OFF)

    def require_no_takeoff(self) -> None:
        """Raises Busy while it climbs from the ground."""
        if self.is_taking_off:
            raise Busy("the vehicle is taking off")

    def flying(self) -> None:
        """What a movement needs before each message: it is armed, in GUIDED."""
        self.held_by(GUIDED)

    # -- position -----------------------------------------------------------------------------------------

    async def go_to(
        self,
        job: Job,
        target: NedTarget | GlobalTarget,
        *,
        look_at_target: bool = False,
        wait: bool = False,
        tolerance: float = TOLERANCE,
        timeout: float | None = None,
    ) -> None:
        """Fly to a position; with `wait`, done on arrival.

        Arrival is on all three axes: within `tolerance` m horizontally and vertically, and slow.

        Raises:
            Invalid: the target lies below home.
        """
        self.require_guided_flight()
        north, east, up = self._leg_to(target)
        if self.height + up < FLOOR - TOLERANCE:
            raise Invalid(f"the target lies {-(self.height + up):.1f} m below home")
        self.authority.take(job, Rank.MOVEMENT)
        yaw = messages.towards(north, east) if look_at_target else NO_YAW
        await self._take_up(job, target, yaw)
        if not wait:
            return
        limits = await self.limits()
        expected = time_limits.leg_time(limits, math.hypot(north, east), up)
        names = {"LOCAL_POSITION_NED" if isinstance(target, NedTarget) else "GLOBAL_POSITION_INT"}
        await self.flown(
            GUIDED, names, lambda: self._arrived(job, target, tolerance), self.allowed(expected, timeout), "arrive"
        )

    def _leg_to(self, target: NedTarget | GlobalTarget) -> tuple[float, float, float]:
        """Metres north, east and up from here to `target`."""
        if isinstance(target, NedTarget):
            here = self.fresh("LOCAL_POSITION_NED")
            return target.x - here.x, target.y - here.y, here.z - target.z
        here = self.fresh("GLOBAL_POSITION_INT")
        north, east = offset(here.lat / 1e7, here.lon / 1e7, target.lat, target.lon)
        return north, east, target.alt - here.relative_alt / 1000.0

    def _arrived(self, job: Job, target: NedTarget | GlobalTarget, tolerance: float) -> bool | None:
        try:
            north, east, up = self._leg_to(target)
        except Stale:
            return None  # a gap in the telemetry: nobody knows yet, and the deadline is still there
        horizontal = math.hypot(north, east)
        self._report_leg(job, math.hypot(horizontal, up))
        self._require_own_target()
        near = horizontal <= tolerance and abs(up) <= tolerance
        return True if near and self._speed_by(target) <= ARRIVAL_SPEED else None

    def _require_own_target(self) -> None:
        """Raises Superseded where the autopilot says that it flies to another target than when we sent ours."""
        flown = setpoint_in_force.shown(self.state, self._sent_at + TARGET_SHOWN)
        if flown is None:
            return
        if isinstance(flown, GlobalTarget):
            self._shown = self._shown or flown
            if max(*map(abs, offset(self._shown.lat, self._shown.lon, flown.lat, flown.lon))) <= SAME_PLACE:
                return
        raise Superseded("another ground station gave the vehicle another target")

    def _speed_by(self, target: NedTarget | GlobalTarget) -> float:
        """Speed (m/s) by the message that tells the position in the target's frame."""
        if isinstance(target, NedTarget):
            here, scale = self.fresh("LOCAL_POSITION_NED"), 1.0
        else:
            here, scale = self.fresh("GLOBAL_POSITION_INT"), 0.01
        return math.hypot(here.vx, here.vy, here.vz) * scale

    def _report_leg(self, job: Job, distance: float) -> None:
        job.progress = {"altitude": self.height, "distance_to_go": distance}

    def ned_from_here(self, x: float, y: float, z: float) -> NedTarget:
        """The target `x` m north, `y` m east, `z` m down of here."""
        here = self.fresh("LOCAL_POSITION_NED")
        return NedTarget(here.x + x, here.y + y, here.z + z)

    def body_from_here(self, front: float, right: float, down: float) -> NedTarget:
        """The target `front`, `right`, `down` m from here, by the heading that the vehicle has now."""
        north, east = rotate(front, right, self.fresh("ATTITUDE").yaw)
        return self.ned_from_here(north, east, down)

    # -- setpoints ----------------------------------------------------------------------------------------

    async def send_setpoint(self, job: Job, target: Target, yaw: Yaw = NO_YAW) -> None:
        """Send a setpoint of `job` to a vehicle that is still in GUIDED.

        Raises:
            Superseded, Paused, NotArmed, ModeChanged: somebody else has it; nothing is sent.
        """
        self.commanding(job, self.flying)()
        await self.link.send(target.to(self.address, yaw), self.state.system)
        self._sent, self._sent_at = target, self.clock()
        self._shown = target if isinstance(target, GlobalTarget) else None  # another frame: as it is told first

    async def _take_up(self, job: Job, target: Target, yaw: Yaw) -> None:
        """Begin a movement. ArduCopter takes up its own speeds again whenever the kind of setpoint changes."""
        other_kind = not self._flies_kind_of(target)
        await self.send_setpoint(job, target, yaw)
        for kind, speed in self.speeds.to_send(other_kind).items():
            await self.commands.send(messages.change_speed(kind, speed), self.commanding(job, self.flying))
            self.speeds.take(kind, speed)

    def _flies_kind_of(self, target: Target) -> bool:
        """Whether the setpoint in force is known to be of the same kind: a place, or a velocity."""
        ours = self._sent if self._sent_at >= self.state.mode_since else None
        before = setpoint_in_force.shown(self.state, max(self._sent_at, self.state.mode_since)) or ours
        return before is not None and isinstance(before, VelocityTarget) == isinstance(target, VelocityTarget)

    async def travel(
        self,
        job: Job,
        velocity: VelocityTarget,
        *,
        look_at_target: bool = False,
        duration: float | None = None,
    ) -> None:
        """Fly at a velocity: one setpoint, which the autopilot drops after GUID_TIMEOUT.

        With `duration` (s of the vehicle's clock) the setpoint is repeated for so long, then a stop is sent.
        """
        self.require_guided_flight()
        self.authority.take(job, Rank.MOVEMENT)
        yaw = messages.towards(velocity.vx, velocity.vy) if look_at_target else NO_YAW
        job.steers = duration is not None
        await self._take_up(job, velocity, yaw)
        if duration is None:
            return
        period = (await self.limits()).guided_timeout / RESENDS_PER_TIMEOUT
        remaining = duration
        while remaining > 0:
            stretch = min(period, remaining)
            await self._travelled(stretch)
            remaining = round(remaining - stretch, 6)  # what is left of a float is no setpoint
            await self.send_setpoint(job, velocity if remaining > 0 else VelocityTarget(0, 0, 0), yaw)

    async def _travelled(self, seconds: float) -> None:
        """Let `seconds` of the vehicle's clock pass while it stays armed and in GUIDED."""
        clock = self.state.time_ratio
        ends_at = clock.boot_time(self.clock()) + seconds
        while (remaining := ends_at - clock.boot_time(self.clock())) > 0:
            self.flying()
            with contextlib.suppress(TimedOut):  # the time has passed, unless the vehicle's clock ran slower
                await self.waiting.message(
                    {"HEARTBEAT"}, lambda beat: beat, max(remaining / clock.ratio, 0.01), "beat"
                )

    # -- yaw ----------------------------------------------------------------------------------------------

    async def set_heading(self, job: Job, heading: float, timeout: float | None = None) -> None:
        """Turn to `heading` degrees clockwise from north, the shorter way round; done when the attitude shows it.

        A movement goes on.
        """
        self.require_armed()
        self.require_mode(GUIDED)
        self.authority.accompany(job, YAW)
        await self.commands.send(messages.yaw_to(heading), self.commanding(job, self.flying))

        def turned() -> bool | None:
            yaw = math.degrees(self.fresh("ATTITUDE").yaw)
            degrees_to_go = abs((heading - yaw + 180.0) % 360.0 - 180.0)
            job.progress = {"degrees_to_go": round(degrees_to_go, 1)}
            return True if degrees_to_go <= HEADING_TOLERANCE else None

        if not self.state.landed:  # on the ground it turns when it has taken off
            allowed = self.allowed(180.0 / SLOWEST_TURN, timeout)
            await self.flown(GUIDED, {"ATTITUDE"}, turned, allowed, f"turn to {heading:g} degrees")

    async def set_yaw_rate(self, job: Job, rate: float, timeout: float | None = None) -> None:
        """Turn at `rate` deg/s, clockwise positive; done when the attitude shows it. A movement goes on.

        ArduCopter takes a yaw rate only with a setpoint: so the one that it flies is repeated, or the place where it
        is, where it does not say what it flies.
        """
        self.require_guided_flight()
        self.require_no_takeoff()
        self.authority.accompany(job, YAW)
        target = await setpoint_in_force.ask(self.state, self.waiting, self.link)
        self.require_no_takeoff()
        await self.send_setpoint(job, target or self.ned_from_here(0, 0, 0), Yaw(rate=math.radians(rate)))
        least, share = RATE_TOLERANCE

        def turns() -> bool | None:
            shown = math.degrees(self.fresh("ATTITUDE").yawspeed)
            return True if abs(shown - rate) <= max(least, share * abs(rate)) else None

        allowed = self.allowed(abs(rate) / SLOWEST_TURN, timeout)
        await self.flown(GUIDED, {"ATTITUDE"}, turns, allowed, f"turn at {rate:g} deg/s")

    # -- holding ------------------------------------------------------------------------------------------

    async def rest(self, job: Job) -> None:
        """Stop by zero velocities in GUIDED, sent until telemetry shows that it stands still.

        A setpoint may be lost and a climb begins slowly: so it must be shown for a while.

        Raises:
            TimedOut: it goes on moving.
        """
        deadline = self.clock() + REST_TIMEOUT
        still_since = self.clock()
        while self.clock() - still_since < REST_SHOWN:
            if self.clock() > deadline:
                raise TimedOut(f"vehicle {self.state.system} does not stop within {REST_TIMEOUT:g} s")
            await self.send_setpoint(job, VelocityTarget(0, 0, 0))
            self.authority.shown(job)  # a newer movement replaces it as it replaced the one before
            await asyncio.sleep(REST_PERIOD)
            if not self.stands_still:
                still_since = self.clock()

    @property
    def stands_still(self) -> bool:
        """Whether fresh telemetry shows that it hardly moves."""
        try:
            return self._speed_by(NedTarget(0, 0, 0)) <= ARRIVAL_SPEED
        except Stale:
            return False
