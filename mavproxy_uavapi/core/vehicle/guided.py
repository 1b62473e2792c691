"""Going to positions in GUIDED."""

from __future__ import annotations

import math
from collections.abc import Callable

from mavproxy_uavapi.core.errors import Busy, Invalid, Stale, Superseded, TimedOut
from mavproxy_uavapi.core.mavlink.link import Link
from mavproxy_uavapi.core.mavlink.pending_waits import PendingWaits
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import messages, setpoint_in_force, time_limits
from mavproxy_uavapi.core.vehicle.authority import Rank
from mavproxy_uavapi.core.vehicle.envelope_check import Spaces
from mavproxy_uavapi.core.vehicle.geodesy import moved, offset
from mavproxy_uavapi.core.vehicle.jobs import Job
from mavproxy_uavapi.core.vehicle.messages import NO_YAW, GlobalTarget, NedTarget, Target, VelocityTarget, Yaw
from mavproxy_uavapi.core.vehicle.start_gate import pass_gate
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

GUIDED = "GUIDED"
TOLERANCE = 1.0  # m, horizontally and vertically
ARRIVAL_SPEED = 0.5  # m/s; slower than this the vehicle does not overshoot its tolerance any more
FLOOR = 0.0  # m above home: the lowest target, less TOLERANCE for the noise of the estimate
TARGET_SHOWN = 2.0  # s after a setpoint, until which telemetry does not count
LATEST = 8.0  # s after a setpoint, until which a slow link or a busy MAVProxy may still report the target before it
LIFT_OFF_TIMEOUT = 5.0  # s in which an unacknowledged takeoff must show
SAME_PLACE = 2.0  # m on each axis: reported targets within this are the same
SAME_MOMENT = 3.0  # s between two messages, in which a vehicle does not change its velocity much
NEAR_EXPECTED = 10.0  # m on each axis: our target in the local frame, whose origin the autopilot does not tell
TAKING_OFF = messages.mavlink.MAV_LANDED_STATE_TAKEOFF


class GuidedVehicle(Vehicle):
    """A vehicle that goes to positions in GUIDED."""

    def __init__(
        self,
        state: VehicleState,
        link: Link,
        pending: PendingWaits,
        clock: Callable[[], float],
        spaces: Spaces = tuple,
    ) -> None:
        super().__init__(state, link, pending, clock, spaces)
        self._sent: Target | None = None  # our newest setpoint
        self._sent_at = 0.0
        self._shown: GlobalTarget | None = None  # our target as the autopilot reports it
        self._expected: GlobalTarget | None = None  # where it will report our target in the local frame, about
        self._before: GlobalTarget | VelocityTarget | None = None  # what it reported last before our setpoint

    def require_guided_flight(self) -> None:
        """Raise NotArmed, ModeChanged or Busy unless it flies in GUIDED."""
        self.require_armed()
        self.require_mode(GUIDED)
        if self.state.landed:
            raise Busy("the vehicle is on the ground; `takeoff` first")

    @property
    def is_taking_off(self) -> bool:
        """Whether the autopilot reports a takeoff, ours or another one."""
        return bool(self.state.recent_field("EXTENDED_SYS_STATE", "landed_state") == TAKING_OFF)

    def require_no_takeoff(self) -> None:
        """Raise Busy during a takeoff."""
        if self.is_taking_off:
            raise Busy("the vehicle is taking off")

    def flying(self) -> None:
        """The check before each message of a movement: the vehicle is armed and in GUIDED."""
        self.held_by(GUIDED)

    async def brake(self, job: Job) -> None:
        """Stop at once, by the holding mode."""
        await self.set_mode(job, self.holding_mode)

    async def lift_off(self, job: Job, alt: float) -> None:
        """Begin to climb to `alt` m above home in GUIDED; returns when that is acknowledged, or shows."""
        try:
            await self.commands.send(messages.takeoff(alt), self.commanding(job, self.flying))
        except TimedOut:  # the ack may be lost: telemetry shows whether the takeoff began
            ratio = max(self.state.time_ratio.ratio, 0.1)
            await self.flown(
                GUIDED,
                {"EXTENDED_SYS_STATE"},
                lambda: True if self.state.landed is False else None,
                max(LIFT_OFF_TIMEOUT, LIFT_OFF_TIMEOUT / ratio),
                "acknowledge the takeoff, and did not leave the ground",
            )

    # -- position -----------------------------------------------------------------------------------------

    async def go_to(
        self,
        job: Job,
        target: NedTarget | GlobalTarget,
        *,
        look_at_target: bool = False,
        heading: float | None = None,
        wait: bool = False,
        tolerance: float = TOLERANCE,
        timeout: float | None = None,
    ) -> None:
        """Fly to a position; with `wait`, done on arrival. `heading`: where to point, degrees clockwise from north.

        Arrival is on all three axes: within `tolerance` m horizontally and vertically, and slow.

        Raises:
            Invalid: the target lies below home.
        """
        self.require_guided_flight()
        north, east, up = self.leg_to(target)
        if self.height + up < FLOOR - TOLERANCE:
            raise Invalid(f"the target lies {-(self.height + up):.1f} m below home")
        self.authority.take(job, Rank.MOVEMENT, self.inside(target))
        yaw = messages.facing(heading, look_at_target, north, east)
        await self.take_up(job, target, yaw)
        if not wait:
            return
        limits = await self.limits()
        expected = time_limits.leg_time(limits, math.hypot(north, east), up)
        names = {"LOCAL_POSITION_NED" if isinstance(target, NedTarget) else "GLOBAL_POSITION_INT"}
        await self.flown(
            GUIDED, names, lambda: self._arrived(job, target, tolerance), self.allowed(expected, timeout), "arrive"
        )

    def leg_to(self, target: NedTarget | GlobalTarget) -> tuple[float, float, float]:
        """Metres north, east and up from here to `target`."""
        if isinstance(target, NedTarget):
            here = self.fresh("LOCAL_POSITION_NED")
            return target.x - here.x, target.y - here.y, here.z - target.z
        here = self.fresh("GLOBAL_POSITION_INT")
        north, east = offset(here.lat / 1e7, here.lon / 1e7, target.lat, target.lon)
        return north, east, target.alt - here.relative_alt / 1000.0

    def _arrived(self, job: Job, target: NedTarget | GlobalTarget, tolerance: float) -> bool | None:
        try:
            north, east, up = self.leg_to(target)
        except Stale:
            return None  # a gap in the telemetry; the deadline still holds
        horizontal = math.hypot(north, east)
        self.report_leg(job, math.hypot(horizontal, up))
        self.require_own_target()
        near = horizontal <= tolerance and abs(up) <= tolerance
        return True if near and self.speed_by(target) <= ARRIVAL_SPEED else None

    def require_own_target(self) -> None:
        """Raise Superseded if the autopilot reports another target than ours."""
        flown = self._flown()
        if flown is None:
            return
        if isinstance(flown, GlobalTarget) and self._is_ours(flown):
            return
        raise Superseded("another ground station gave the vehicle another target")

    @property
    def has_foreign_target(self) -> bool:
        """Whether the autopilot reports another target or velocity than the newest of ours."""
        flown = self._flown()
        if flown is None:
            return False
        if isinstance(flown, VelocityTarget):
            speed = math.hypot(flown.vx, flown.vy, flown.vz)
            ours = self._sent
            own = math.hypot(ours.vx, ours.vy, ours.vz) if isinstance(ours, VelocityTarget) else 0.0
            return speed > ARRIVAL_SPEED and abs(speed - own) > ARRIVAL_SPEED
        if self._sent is None or isinstance(self._sent, VelocityTarget):
            return True
        return not self._is_ours(flown)

    def _flown(self) -> GlobalTarget | VelocityTarget | None:
        """The setpoint that the autopilot reports since ours must show; None without one."""
        flown = setpoint_in_force.shown(self.state, self._sent_at + TARGET_SHOWN)
        is_early = self.clock() < self._sent_at + LATEST
        return None if is_early and _are_alike(self._before, flown) else flown

    def _is_ours(self, flown: GlobalTarget) -> bool:
        """Whether a reported target is our newest one; the first report that is near ours counts as ours."""
        if self._shown is None:
            if self._expected is not None and _apart(self._expected, flown) > NEAR_EXPECTED:
                return False
            self._shown = flown
        return _apart(self._shown, flown) <= SAME_PLACE

    @property
    def target_place(self) -> tuple[float, float] | None:
        """Latitude and longitude (degrees) of our target in GUIDED; None without one, or without a position."""
        target, is_guided = self._sent, self.mode == GUIDED and self._sent_at >= self.state.mode_since
        if not self.state.armed or not is_guided or self.has_foreign_target:
            return None
        if isinstance(target, GlobalTarget):
            return target.lat, target.lon
        if not isinstance(target, NedTarget):
            return None
        try:
            (north, east, _), here = self.leg_to(target), self.fresh("GLOBAL_POSITION_INT")
        except Stale:
            return None
        return moved(here.lat / 1e7, here.lon / 1e7, north, east)

    def speed_by(self, target: NedTarget | GlobalTarget) -> float:
        """Speed (m/s), from the message that has the position in the target's frame."""
        if isinstance(target, NedTarget):
            here, scale = self.fresh("LOCAL_POSITION_NED"), 1.0
        else:
            here, scale = self.fresh("GLOBAL_POSITION_INT"), 0.01
        return math.hypot(here.vx, here.vy, here.vz) * scale

    def report_leg(self, job: Job, distance: float) -> None:
        """Set the job's progress: the altitude, and the distance to go."""
        job.progress = {"altitude": self.height, "distance_to_go": distance}

    # -- setpoints ----------------------------------------------------------------------------------------

    async def send_setpoint(self, job: Job, target: Target, yaw: Yaw = NO_YAW) -> None:
        """Send a setpoint of `job` to a vehicle that is still in GUIDED.

        Raises:
            Superseded, Paused, NotArmed, ModeChanged: the job no longer has the vehicle; nothing is sent.
        """
        await pass_gate()
        self.commanding(job, self.flying)()
        await self.link.send(target.to(self.address, yaw), self.state.system)
        self.sent(target)

    def sent(self, target: Target) -> None:
        """Remember the setpoint that went out last."""
        self._before = setpoint_in_force.shown(self.state, self.state.mode_since)
        self._sent, self._sent_at = target, self.clock()
        self._shown = target if isinstance(target, GlobalTarget) else None
        self._expected = self._place_of(target) if isinstance(target, NedTarget) else None

    def _place_of(self, target: NedTarget) -> GlobalTarget | None:
        """About where a target in the local frame is, by the vehicle's own place in both; None without these.

        The vehicle has moved between the two messages.
        """
        local, place = self.state.messages.get("LOCAL_POSITION_NED"), self.state.messages.get("GLOBAL_POSITION_INT")
        if local is None or place is None:
            return None
        here, there = local.message, place.message
        later = (there.time_boot_ms - here.time_boot_ms) / 1000.0  # s
        if abs(later) > SAME_MOMENT:
            return None
        north = target.x - here.x - later * here.vx
        east = target.y - here.y - later * here.vy
        down = target.z - here.z - later * here.vz
        lat, lon = moved(there.lat / 1e7, there.lon / 1e7, north, east)
        return GlobalTarget(lat, lon, there.relative_alt / 1000.0 - down)

    async def take_up(self, job: Job, target: Target, yaw: Yaw) -> None:
        """Begin a movement. ArduCopter goes back to its own speeds when the kind of setpoint changes."""
        other_kind = not self._flies_kind_of(target)
        await self.send_setpoint(job, target, yaw)
        await self.send_speeds(job, new_kind=other_kind)

    async def send_speeds(self, job: Job, *, new_kind: bool) -> None:
        """Send the speeds that go with a movement; `new_kind`: whether its setpoint is of another kind."""
        for kind, speed in self.speeds.to_send(new_kind).items():
            await self.commands.send(messages.change_speed(kind, speed), self.commanding(job, self.flying))
            self.speeds.take(kind, speed)

    def _flies_kind_of(self, target: Target) -> bool:
        """Whether the setpoint in force is known to be of the same kind: a place, or a velocity."""
        ours = self._sent if self._sent_at >= self.state.mode_since else None
        before = setpoint_in_force.shown(self.state, max(self._sent_at, self.state.mode_since)) or ours
        return before is not None and isinstance(before, VelocityTarget) == isinstance(target, VelocityTarget)


def _are_alike(one: GlobalTarget | VelocityTarget | None, other: GlobalTarget | VelocityTarget | None) -> bool:
    """Whether two reports are of the same setpoint."""
    if isinstance(one, GlobalTarget) and isinstance(other, GlobalTarget):
        return _apart(one, other) <= SAME_PLACE
    if isinstance(one, VelocityTarget) and isinstance(other, VelocityTarget):
        return math.dist((one.vx, one.vy, one.vz), (other.vx, other.vy, other.vz)) <= ARRIVAL_SPEED
    return False


def _apart(one: GlobalTarget, other: GlobalTarget) -> float:
    """Metres between two places, on the axis where they are farther apart."""
    return max(*map(abs, offset(one.lat, one.lon, other.lat, other.lon)))
