"""Going to positions in GUIDED."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Callable

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.airspace.envelope_check import Spaces
from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Ending, Job
from mavproxy_uavapi.core.errors import Busy, Invalid, Stale, Superseded, TimedOut, UavApiError
from mavproxy_uavapi.core.geodesy import moved, offset
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.link import Link
from mavproxy_uavapi.core.link.messages import NO_YAW, GlobalTarget, NedTarget, Target, VelocityTarget, Yaw
from mavproxy_uavapi.core.mainloop.permit import SETPOINT_LASTS
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import setpoint_in_force
from mavproxy_uavapi.core.vehicle.own_target import TARGET_SHOWN, OwnTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

log = logging.getLogger("uavapi.copter")

GUIDED = "GUIDED"
TOLERANCE = 1.0  # m, horizontally and vertically
ARRIVAL_SPEED = 0.5  # m/s; slower than this the vehicle does not overshoot its tolerance any more
FLOOR = 0.0  # m above home: the lowest NedTarget, less TOLERANCE for the noise of the estimate
LIFT_OFF_TIMEOUT = 5.0  # s in which an unacknowledged takeoff must show
ON_GROUND = messages.mavlink.MAV_LANDED_STATE_ON_GROUND
REPEATS = 3  # times that a place is sent again if the autopilot does not report it
MOVES_WITHIN = 1.5  # s of the vehicle's clock in which it begins to move by a setpoint in force
BEAT_TIMEOUT = 2.0  # s in which a heartbeat must come before that
TAKING_OFF = messages.mavlink.MAV_LANDED_STATE_TAKEOFF


def below_home(depth: float) -> str:
    """The sentence that refuses a NedTarget, `depth` m below home."""
    return f"the target lies {depth:.1f} m below home: down counts positive; /movement/go_to_gps flies below home"


class GuidedVehicle(Vehicle):
    """A vehicle that goes to positions in GUIDED.

    Attributes:
        begins_at_a_place: see `OwnTarget`.
    """

    begins_at_a_place = False

    def __init__(
        self,
        state: VehicleState,
        link: Link,
        pending: PendingWaits,
        clock: Callable[[], float],
        spaces: Spaces = tuple,
    ) -> None:
        super().__init__(state, link, pending, clock, spaces)
        self.own_target = OwnTarget(state, clock, begins_at_a_place=self.begins_at_a_place)
        self._lifts_off_for: Job | None = None  # the job that has sent the last takeoff
        self._reported_after_its_end: float | None = None  # since when the mode of a finished takeoff has lasted (s)
        self.yaw = NO_YAW  # where it points on its way to the newest target
        self._tasks = HeldTasks()
        self._repeating: asyncio.Task[None] | None = None

    def require_guided_flight(self) -> None:
        """Raise NotArmed, ModeChanged or Busy unless it flies in GUIDED, after its takeoff."""
        self.require_armed()
        self.require_mode(GUIDED)
        if self.state.landed:
            raise Busy("the vehicle is on the ground; `takeoff` first")
        self.require_no_takeoff()

    @property
    def is_taking_off(self) -> bool:
        """Whether the autopilot reports a takeoff, ours or another one, or that it has left the ground just now.

        A change of mode ends a takeoff, so a report from before it does not count.
        """
        received = self.state.messages.get("EXTENDED_SYS_STATE")
        if received is None or received.at < self.state.mode_since or not self.state.is_recent(received):
            return False
        reported = received.message.landed_state
        has_just_left = reported == ON_GROUND and self.state.landed is False  # as a newer heartbeat says
        return bool(reported == TAKING_OFF or has_just_left)

    def require_no_takeoff(self) -> None:
        """Raise Busy during a takeoff. One that is done, but still reported, does not count.

        If `stop` has paused the takeoff, the authority refuses movements.
        """
        is_done = self._reported_after_its_end == self.state.mode_since
        if self.is_taking_off and not is_done and not self.authority.paused:
            raise Busy("the vehicle is taking off")

    def require_ground(self, job: Job) -> None:
        """Raise Busy if it flies, or takes off for another job than this one.

        Telemetry shows a takeoff only seconds after its command; the autopilot refuses a second one before that.
        """
        if self.state.landed is False:
            raise Busy("the vehicle is flying already")
        lifts_off = self._lifts_off_for is self.authority.commander and self.authority.on_its_way
        if lifts_off and self._lifts_off_for is not job:
            raise Busy("the vehicle is taking off already")

    def require_can_take_off(self, job: Job, alt: float) -> None:
        """Raise unless it stands armed in GUIDED, and may climb to `alt` m above home."""
        self.require_armed()
        self.require_mode(GUIDED)
        self.require_ground(job)
        self.inside(messages.takeoff(alt))()

    def takeoff_is_done(self, job: Job) -> None:
        """Note that the takeoff of `job` has reached its altitude."""
        self._reported_after_its_end = self.state.mode_since if self.is_taking_off else None
        self.command(job).confirm()

    def flying(self) -> None:
        """The check before each message of a movement: the vehicle is armed and in GUIDED."""
        self.held_by(GUIDED)

    async def brake(self, job: Job) -> None:
        """Stop at once, by the holding mode."""
        await self.set_mode(job, self.holding_mode)

    async def lift_off(self, job: Job, alt: float) -> None:
        """Begin to climb to `alt` m above home in GUIDED; returns when that is acknowledged, or shows."""
        self._reported_after_its_end = None

        def noted() -> None:
            self._lifts_off_for = job

        try:
            await self.command(job).send(messages.takeoff(alt), self.flying, noted)
        except TimedOut:  # the ack may be lost: telemetry shows whether the takeoff began
            ratio = max(self.state.time_ratio.ratio, 0.1)
            await self.until(
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
            Invalid: the target is a NedTarget below home: mostly its z has the wrong sign.
        """
        self.require_guided_flight()
        north, east, up = self.leg_to(target)
        if isinstance(target, NedTarget) and self.height + up < FLOOR - TOLERANCE:
            raise Invalid(below_home(-(self.height + up)))
        await self.command(job).take(Rank.MOVEMENT, self.inside(target))
        self.yaw = messages.facing(heading, look_at_target, north, east)
        await self.take_up(job, target, self.yaw)
        self._repeating = self._tasks.start(self._repeat(job, target), "the watch over a target")
        if not wait:
            return
        limits = await self.limits()
        expected = time_limits.leg_time(limits, math.hypot(north, east), up)
        names = {"LOCAL_POSITION_NED" if isinstance(target, NedTarget) else "GLOBAL_POSITION_INT"}
        await self.until(
            GUIDED, names, lambda: self._arrived(job, target, tolerance), self.allowed(expected, timeout), "arrive"
        )

    def leg_to(self, target: NedTarget | GlobalTarget) -> tuple[float, float, float]:
        """Metres north, east and up from here to `target`."""
        if isinstance(target, NedTarget):
            local = self.local_position()
            return target.x - local.north, target.y - local.east, local.down - target.z
        here = self.position()
        return *offset(*here.place, target.lat, target.lon), target.alt - here.alt

    def _arrived(self, job: Job, target: NedTarget | GlobalTarget, tolerance: float) -> bool | None:
        try:
            north, east, up = self.leg_to(target)
        except Stale:
            return None  # a gap in the telemetry; the deadline still holds
        horizontal = math.hypot(north, east)
        self.report_leg(job, math.hypot(horizontal, up))
        self.own_target.require()
        near = horizontal <= tolerance and abs(up) <= tolerance
        return True if near and self.speed_by(target) <= ARRIVAL_SPEED else None

    @property
    def has_foreign_target(self) -> bool:
        """Whether the autopilot reports another target or velocity than the newest of ours."""
        return self.mode == GUIDED and self.own_target.is_foreign  # in AUTO it reports the mission's

    @property
    def target_place(self) -> tuple[float, float] | None:
        """Latitude and longitude (degrees) of our target in GUIDED; None without one, or without a position."""
        target = self.own_target.newest
        is_guided = self.mode == GUIDED and self.own_target.sent_at >= self.state.mode_since
        if not self.state.armed or not is_guided or self.has_foreign_target:
            return None
        if isinstance(target, GlobalTarget):
            return target.lat, target.lon
        if not isinstance(target, NedTarget):
            return None
        try:
            (north, east, _), here = self.leg_to(target), self.position()
        except Stale:
            return None
        return moved(*here.place, north, east)

    def speed_by(self, target: NedTarget | GlobalTarget) -> float:
        """Speed (m/s), from the message that has the position in the target's frame."""
        return (self.local_position() if isinstance(target, NedTarget) else self.position()).speed

    def report_leg(self, job: Job, distance: float) -> None:
        """Set the job's progress: the altitude, and the distance to go."""
        job.progress = {"altitude": self.height, "distance_to_go": distance}

    # -- setpoints ----------------------------------------------------------------------------------------

    async def send_setpoint(self, job: Job, target: Target, yaw: Yaw = NO_YAW, *, must_show: bool = False) -> None:
        """Send a setpoint of `job` to a vehicle that is still in GUIDED; `must_show`: the caller watches its report.

        Raises:
            Superseded, Paused, NotArmed, ModeChanged: the job no longer has the vehicle; nothing is sent.
        """
        command = self.command(job)
        command.require()
        self.flying()
        if job.steers:
            self.own_target.require_steered_by(job)
        self.repeat_nothing()
        await command.post(target.to(self.address, yaw), self.flying, lasts=SETPOINT_LASTS)
        self.own_target.sent(target, job, must_show=must_show)

    async def take_up(self, job: Job, target: Target, yaw: Yaw) -> None:
        """Begin a movement. ArduCopter goes back to its own speeds when the kind of setpoint changes.

        A vehicle that does not take its speeds after the setpoint is stopped: else it flies there at another speed.
        """
        other_kind, steers = not self.own_target.is_of_kind_in_force(target), job.steers
        await self.send_setpoint(job, target, yaw, must_show=not isinstance(target, VelocityTarget))
        job.steers = True
        await self.send_speeds(job, new_kind=other_kind)
        job.steers = steers

    async def send_speeds(self, job: Job, *, new_kind: bool) -> None:
        """Send the speeds of a movement; `new_kind`: whether its setpoint is of another kind than the last one."""
        for kind, speed in self.speeds.to_send(new_kind).items():
            await self.command(job).send(messages.change_speed(kind, speed), self.flying)
            self.speeds.take(kind, speed)

    async def ask_setpoint(self) -> GlobalTarget | VelocityTarget | None:
        """The setpoint in force, as the autopilot reports it now; None without an answer. Raises LinkLost."""
        return await setpoint_in_force.ask(self.state, self.waiting, self.post)

    # -- targets that are lost on the way -----------------------------------------------------------------

    def repeat_nothing(self) -> None:
        """See `BaseVehicle.repeat_nothing`."""
        if self._repeating is not None:
            self._repeating.cancel()

    async def _repeat(self, job: Job, target: NedTarget | GlobalTarget) -> None:
        """Send a target again while the autopilot does not report it, at most REPEATS times; not when in doubt.

        A setpoint has no acknowledgement, and a place may be sent twice. The vehicle is ours while no other job has
        commanded it, nobody has switched its mode, and it shows no target of another station.
        """
        began = self.own_target.sent_at

        def require_ours() -> None:
            if self.state.mode_since > began or not (job.running or job.ending is Ending.DONE):
                raise Superseded(f"{job.verb} does not fly the vehicle any more")
            self.command(job).require()
            self.require_guided_flight()

        with contextlib.suppress(UavApiError):
            for _ in range(REPEATS):
                if await self._is_shown_soon():
                    distance = math.hypot(*self.leg_to(target))
                    if distance > TOLERANCE:
                        await self.end_unknown_pause(job, require_ours)
                    return
                await self.waiting.message({"HEARTBEAT"}, lambda beat: beat, BEAT_TIMEOUT, "report its mode")
                require_ours()
                asked_at = self.clock()
                await self.ask_setpoint()
                if not self._is_lost(target, asked_at):
                    return
                require_ours()
                log.info("vehicle %d does not show its target: it is sent again", self.state.system)
                message = target.to(self.address, self.yaw)
                await self.command(job).post(message, require_ours, lasts=SETPOINT_LASTS)
                self.own_target.sent_again()
                await self.send_speeds(job, new_kind=True)

    async def end_unknown_pause(self, job: Job, require_ours: Callable[[], None]) -> None:
        """Let a vehicle go on that should move by our setpoint and stands: it was paused before we knew it.

        No message shows a pause in GUIDED. A restarted MAVProxy does not know of one.
        """
        if not self.authority.pause_is_unknown or not self.pauses_in_guided:
            return
        await asyncio.sleep(MOVES_WITHIN / max(self.state.time_ratio.ratio, 0.1))
        require_ours()
        if self.speed_by(NedTarget(0, 0, 0)) > ARRIVAL_SPEED:
            self.authority.know_pause()
            return
        log.info("vehicle %d should move and stands: a pause from before is ended", self.state.system)
        await self.end_stop(job, GUIDED)

    @property
    def pauses_in_guided(self) -> bool:
        """Whether its autopilot can be paused in GUIDED."""
        return False

    async def _is_shown_soon(self) -> bool:
        names = {setpoint_in_force.PLACE}
        with contextlib.suppress(TimedOut):
            return await self.waiting.until(names, lambda: self.own_target.look() or None, TARGET_SHOWN, "show it")
        return False

    def _is_lost(self, target: NedTarget | GlobalTarget, asked_at: float) -> bool:
        """Whether `target` has certainly not reached the vehicle.

        Since `asked_at` (s) it reports an older target, or it reports none and stands elsewhere. Raises Stale.
        """
        is_replaced = self.own_target.is_replaced_since(asked_at)
        north, east, up = self.leg_to(target)
        if is_replaced is not None:
            return is_replaced
        return math.hypot(north, east, up) > TOLERANCE and self.speed_by(target) <= ARRIVAL_SPEED
