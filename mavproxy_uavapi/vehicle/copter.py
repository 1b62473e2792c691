"""The verbs of a copter."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

from mavproxy_uavapi.errors import Busy, Invalid, ModeChanged, NotArmed, Stale, TimedOut
from mavproxy_uavapi.host.link import Link
from mavproxy_uavapi.host.pending import Pending
from mavproxy_uavapi.host.state import VehicleState
from mavproxy_uavapi.vehicle import deadlines, messages
from mavproxy_uavapi.vehicle.geodesy import offset, rotate
from mavproxy_uavapi.vehicle.jobs import Job
from mavproxy_uavapi.vehicle.messages import NO_YAW, GlobalTarget, NedTarget, Target, VelocityTarget, Yaw
from mavproxy_uavapi.vehicle.touchdown import Touchdown
from mavproxy_uavapi.vehicle.vehicle import Vehicle

TOLERANCE = 1.0  # m, horizontally and vertically
ARRIVAL_SPEED = 0.5  # m/s; slower than this the vehicle does not overshoot its tolerance any more
TAKEOFF_SHARE = 0.05  # of the altitude, between TAKEOFF_TOLERANCE's two ends
TAKEOFF_TOLERANCE = (0.3, 1.0)  # m
LIFT_OFF_TIMEOUT = 5.0  # s in which an unacknowledged takeoff must show
FLOOR = 0.0  # m above home: no target lies lower, but for the noise of the estimate
HOME_RADIUS = 10.0  # m; closer than this a vehicle on the ground is at home
RESENDS_PER_TIMEOUT = 3  # velocity setpoints sent in each GUID_TIMEOUT


class Copter(Vehicle):
    """A multicopter or helicopter."""

    def __init__(self, state: VehicleState, link: Link, pending: Pending, clock: Callable[[], float]) -> None:
        super().__init__(state, link, pending, clock)
        self._setpoint: Target | None = None  # what set_yaw_rate repeats, while GUIDED flies it
        self._setpoint_at = 0.0
        self._paused_at: float | None = None  # by our stop; a new target would wait until it is resumed

    # -- flight -------------------------------------------------------------------------------------------

    async def takeoff(self, job: Job, alt: float, timeout: float | None = None) -> None:
        """Climb to `alt` m above home from the ground, armed and in GUIDED; done within tolerance of it.

        The tolerance is 5 % of `alt`, at least 0.3 m and at most 1 m.
        """
        self.require_armed()
        self.require_mode("GUIDED")
        if self.state.landed is False:
            raise Busy("the vehicle is flying already")
        self.seat.take(job)
        self._setpoint = self._paused_at = None
        limits = await self.limits()
        self.held_by("GUIDED")  # the pilot may have switched it meanwhile
        await self._lift_off(alt)
        low, high = TAKEOFF_TOLERANCE
        tolerance = min(max(TAKEOFF_SHARE * alt, low), high)

        def reached() -> bool | None:
            self._report_leg(job, abs(alt - self.height))
            climb = self.state.field("GLOBAL_POSITION_INT", "vz") or 0
            slow = abs(climb) / 100.0 <= 2 * ARRIVAL_SPEED
            return True if abs(alt - self.height) <= tolerance and slow else None

        allowed = self.allowed(deadlines.leg_time(limits, 0.0, alt), timeout)
        await self.flown("GUIDED", {"GLOBAL_POSITION_INT"}, reached, allowed, f"reach {alt:g} m")

    async def _lift_off(self, alt: float) -> None:
        try:
            await self.commands.send(messages.takeoff(alt))
        except TimedOut:  # the ack may be lost; then the vehicle itself shows that it was heard
            ratio = max(self.state.time_ratio.ratio, 0.1)
            await self.flown(
                "GUIDED",
                {"EXTENDED_SYS_STATE"},
                lambda: True if self.state.landed is False else None,
                max(LIFT_OFF_TIMEOUT, LIFT_OFF_TIMEOUT / ratio),
                "acknowledge the takeoff, nor lift off",
            )

    async def land(self, job: Job, timeout: float | None = None) -> None:
        """Land where it is; done when it has disarmed. On the ground and disarmed nothing is sent."""
        if self.state.armed is False:
            return
        self.seat.take(job)
        limits = await self._limits_in_this_mode()
        expected = deadlines.landing_time(limits, self.height)
        await self.switch_to("LAND")
        await self._flown_home(job, "LAND", limits, self.allowed(expected, timeout))

    async def rtl(self, job: Job, timeout: float | None = None) -> None:
        """Return to launch; done when the vehicle has landed there and disarmed.

        On the ground and disarmed it is not switched: at home it is done, elsewhere `NotArmed`.

        Raises:
            NotFound: disarmed, and it has no home yet.
        """
        distance = self.distance_home()
        if self.state.armed is False:
            if distance is None:
                await self.home()
                self.fresh("GLOBAL_POSITION_INT")
                distance = self.distance_home() or 0.0
            if distance > HOME_RADIUS:
                raise NotArmed(f"the vehicle is disarmed, {distance:.0f} m from home")
            return
        self.seat.take(job)
        limits = await self._limits_in_this_mode()
        expected = deadlines.return_time(limits, distance or 0.0, self.height)
        await self.switch_to("RTL")
        await self._flown_home(job, "RTL", limits, self.allowed(expected, timeout))

    async def _limits_in_this_mode(self) -> deadlines.Limits:
        """Its speeds, which it may have to be asked for.

        Raises:
            ModeChanged: meanwhile the pilot switched the mode, after the command that is on its way.
        """
        before = self.mode
        limits = await self.limits()
        if self.mode != before:
            raise ModeChanged(f"the vehicle is in {self.mode} now: somebody else switched it meanwhile")
        return limits

    async def _flown_home(self, job: Job, mode: str, limits: deadlines.Limits, timeout: float) -> None:
        """Wait until it has landed and disarmed in that mode; motors that stop in flight are no landing."""
        landing = Touchdown(limits)

        def landed() -> bool | None:
            self._report(job)
            landing.sinks_at((self.state.field("GLOBAL_POSITION_INT", "vz") or 0) / 100.0)
            if self.state.armed is not False or self.mode != mode:
                self.held_by(mode)
                return None
            if landing.fell:
                raise NotArmed("the vehicle was disarmed in flight, and fell")
            return landing.is_over(self.clock(), self.state.age("GLOBAL_POSITION_INT", self.clock()))

        names = {"HEARTBEAT", "GLOBAL_POSITION_INT"}
        await self.waiting.until(names, landed, timeout, f"land and disarm in {mode}")

    def _report(self, job: Job) -> None:
        job.progress = {"altitude": self.height}
        distance = self.distance_home()
        if distance is not None:
            job.progress["distance_to_go"] = distance

    # -- position -----------------------------------------------------------------------------------------

    def require_guided_flight(self) -> None:
        """Raises NotArmed, ModeChanged or Busy unless it flies in GUIDED."""
        self.require_armed()
        self.require_mode("GUIDED")
        if self.state.landed:
            raise Busy("the vehicle is on the ground; /command/takeoff first")

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
            raise Invalid(f"the target lies {-(self.height + up):.1f} m below home", "body")
        self.seat.take(job)
        yaw = messages.towards(north, east) if look_at_target else NO_YAW
        await self._take_up(target, yaw)
        if not wait:
            return
        limits = await self.limits()
        expected = deadlines.leg_time(limits, math.hypot(north, east), up)
        names = {"LOCAL_POSITION_NED" if isinstance(target, NedTarget) else "GLOBAL_POSITION_INT"}
        await self.flown(
            "GUIDED",
            names,
            lambda: self._arrived(job, target, tolerance),
            self.allowed(expected, timeout),
            "arrive",
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
        near = horizontal <= tolerance and abs(up) <= tolerance
        return True if near and self._speed_by(target) <= ARRIVAL_SPEED else None

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

    async def _send_setpoint(self, target: Target, yaw: Yaw) -> None:
        await self.link.send(target.to(self.address, yaw), self.state.system)
        self._setpoint, self._setpoint_at = target, self.clock()

    async def _take_up(self, target: Target, yaw: Yaw) -> None:
        """Begin a movement; a pause that is in force would hold it back, so it ends."""
        same_kind = self._setpoint_at >= self.state.mode_since and _same_kind(self._setpoint, target)
        await self._send_setpoint(target, yaw)
        if not same_kind and self._speeds_at >= self.state.mode_since:
            # ArduCopter takes up its own speeds again whenever the kind of setpoint changes.
            for kind, speed in list(self.speeds.items()):  # others may set theirs meanwhile
                self.held_by("GUIDED")
                await self.commands.send(messages.change_speed(kind, speed))
        paused_at, self._paused_at = self._paused_at, None
        if paused_at is not None and paused_at >= self.state.mode_since:
            # In this order, so that it does not take up the old movement for a moment.
            await self.commands.send(messages.pause(False))

    # -- velocity and yaw ---------------------------------------------------------------------------------

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
        self.seat.take(job)
        yaw = messages.towards(velocity.vx, velocity.vy) if look_at_target else NO_YAW
        await self._take_up(velocity, yaw)
        if duration is None:
            return
        period = (await self.limits()).guided_timeout / RESENDS_PER_TIMEOUT
        remaining = duration
        while remaining > 0:
            stretch = min(period, remaining)
            await self._travelled(stretch)
            remaining = round(remaining - stretch, 6)  # what is left of a float is no setpoint
            await self._send_setpoint(velocity if remaining > 0 else VelocityTarget(0, 0, 0), yaw)

    async def _travelled(self, seconds: float) -> None:
        """Let `seconds` of the vehicle's clock pass while it stays armed and in GUIDED."""
        clock = self.state.time_ratio
        over = clock.boot_time(self.clock()) + seconds
        while (left := over - clock.boot_time(self.clock())) > 0:
            self.held_by("GUIDED")
            with contextlib.suppress(TimedOut):  # the time has passed, unless the vehicle's clock ran slower
                await self.waiting.message({"HEARTBEAT"}, lambda beat: beat, max(left / clock.ratio, 0.01), "beat")

    async def set_heading(self, heading: float) -> None:
        """Turn to `heading` degrees clockwise from north, the shorter way round; a movement goes on."""
        self.require_armed()
        self.require_mode("GUIDED")
        await self.commands.send(messages.yaw_to(heading))

    async def set_yaw_rate(self, rate: float) -> None:
        """Turn at `rate` deg/s, clockwise positive; a movement in flight goes on.

        ArduCopter takes a yaw rate only with a setpoint, and stops at one that holds nothing else: so the
        setpoint that it flies is repeated, or the place where it is.
        """
        self.require_guided_flight()
        target = await self._flown_setpoint() or self.ned_from_here(0, 0, 0)
        self.held_by("GUIDED")  # the pilot may have switched it meanwhile
        await self._send_setpoint(target, Yaw(rate=math.radians(rate)))

    async def _flown_setpoint(self) -> Target | None:
        """The setpoint that the autopilot still flies.

        A velocity is dropped after GUID_TIMEOUT, and everything when GUIDED is left.
        """
        if self._setpoint_at < self.state.mode_since:
            return None
        if not isinstance(self._setpoint, VelocityTarget):
            return self._setpoint
        timeout = (await self.limits()).guided_timeout
        flown_for = (self.clock() - self._setpoint_at) * self.state.time_ratio.ratio
        return self._setpoint if flown_for < timeout else None

    async def hold(self) -> None:
        """Stop and stay: by a zero velocity in GUIDED, by BRAKE where the autopilot flies by itself for us.

        On the ground, disarmed, or in a mode of the pilot's nothing is sent.
        """
        if not self.state.armed or self.state.landed:
            return
        if self.mode == "GUIDED":
            await self._send_setpoint(VelocityTarget(0, 0, 0), NO_YAW)
        elif self.mode in ("LAND", "RTL"):
            await self.switch_to("BRAKE")

    async def pause(self) -> None:
        """Pause the guided movement: the vehicle stops where it is. Whoever waits for its end waits on."""
        self.require_armed()
        self.require_mode("GUIDED")
        await self.commands.send(messages.pause(True))
        self._paused_at = self.clock()

    async def resume(self) -> None:
        """Continue the movement that `pause` stopped."""
        self.require_armed()
        self.require_mode("GUIDED")
        await self.commands.send(messages.pause(False))
        self._paused_at = None


def _same_kind(one: Target | None, other: Target) -> bool:
    """Whether ArduCopter flies both in the same way: to a position, or at a velocity."""
    return one is not None and isinstance(one, VelocityTarget) == isinstance(other, VelocityTarget)
