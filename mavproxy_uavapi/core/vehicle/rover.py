"""The verbs of a rover or boat: it moves in two dimensions, and stops on command."""

from __future__ import annotations

from mavproxy_uavapi.core.airspace import braking, time_limits
from mavproxy_uavapi.core.airspace.time_limits import FlightLimits
from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, Rejected
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget, Target
from mavproxy_uavapi.core.telemetry.flight_modes import MISSION_MODES, flies_mission
from mavproxy_uavapi.core.vehicle.guided import GUIDED, TOLERANCE
from mavproxy_uavapi.core.vehicle.travelling import TravellingVehicle

RADIUS = 2.0  # m; used until WP_RADIUS is known
SPEED = 2.0  # m/s; used until CRUISE_SPEED is known
AT_HOME = 2.0  # waypoint radii from home within which a returned rover stops
DRIVING_MODES = {"GUIDED", "RTL", "SMART_RTL", *MISSION_MODES}  # in others a pilot drives, or it stands


class Rover(TravellingVehicle):
    """A ground rover or boat. It ignores altitudes."""

    holding_mode = "HOLD"
    stops_by = braking.WANTED_OF_ROVER

    def require_guided_flight(self) -> None:
        """Raise NotArmed or ModeChanged unless it is armed in GUIDED."""
        self.require_armed()
        self.require_mode(GUIDED)

    @property
    def stands(self) -> bool:
        """False: it is always on the ground, and may drive there."""
        return False

    @property
    def is_under_way(self) -> bool:
        """Whether it is armed and drives, or flies its mission, which may have it drive on at any moment."""
        return bool(self.state.armed) and (flies_mission(self.mode) or not self.stands_still)

    @property
    def takes_speeds(self) -> bool:
        """Whether its autopilot takes a speed in the mode that it is in."""
        return self.mode in DRIVING_MODES

    def leg_to(self, target: NedTarget | GlobalTarget) -> tuple[float, float, float]:
        """Metres north and east from here to `target`, and 0 down."""
        north, east, _ = super().leg_to(target)
        return north, east, 0.0

    @property
    def standstill(self) -> Target:
        """The place where it can stop: for a rover even a velocity of 0 has a direction, and it might turn.

        A place that it has passed by then would make it turn round.
        """
        here, age = self.local_position(), self.state.age("LOCAL_POSITION_NED", self.clock()) or 0.0
        north, east, _ = here.velocity
        stopping = braking.of_rover(self.state.parameters)
        north, east, _ = stopping.to_rest((north, east, 0.0), age + braking.LATENCY)
        return self.ned_from_here(north, east, 0.0)

    async def limits(self) -> FlightLimits:
        """Its speed, for deadlines; it requests it if it is unknown, and so how it brakes, for `standstill`."""
        parameters = await self.parameters.read([("WP_SPEED",), ("CRUISE_SPEED",), *braking.WANTED_OF_ROVER])
        cruise = parameters.get("WP_SPEED") or parameters.get("CRUISE_SPEED") or SPEED
        return time_limits.limits({"WP_SPD": cruise, "WP_ACC": 1.0}, self.speeds.in_force)

    async def _radius(self) -> float:
        """The distance (m) from a waypoint at which the autopilot counts it as reached, and stops."""
        return (await self.parameters.read([("WP_RADIUS",)])).get("WP_RADIUS", RADIUS)

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
        """Drive to a position; with `wait`, done when it has stopped there.

        It has arrived within `tolerance` m, or WP_RADIUS if that is more. It always points in the direction of
        travel.
        """
        self.require_guided_flight()
        radius = max(tolerance, await self._radius()) if wait else tolerance
        await super().go_to(job, target, wait=wait, tolerance=radius, timeout=timeout)

    async def rtl(self, job: Job, timeout: float | None = None) -> None:
        """Return to launch; done when it has stopped there. A disarmed rover at home has nothing to do."""
        await self.command(job).take(Rank.STOP)
        if await self.is_done_at_home(job):
            return
        await self.command(job).switch_mode("RTL")
        self.command(job).confirm()
        await self.know_home()
        near = AT_HOME * await self._radius()
        expected = time_limits.leg_time(await self.limits(), self.distance_home() or 0.0, 0.0)

        def at_home() -> bool | None:
            self.report_home(job)
            distance = self.distance_home()
            return True if distance is not None and distance <= near and self.stands_still else None

        names = {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"}
        await self.until("RTL", names, at_home, self.allowed(expected, timeout), "stop at home")

    async def stop(self, job: Job) -> None:
        """Stop in HOLD; done when telemetry shows that it stands still.

        Raises:
            NotArmed: there is nothing to stop.
        """
        await self.end_waiting_arm(job)
        self.require_armed()
        await self.hold(job)
        self.held_by(self.holding_mode)

    async def brake(self, job: Job) -> None:
        """As `stop`, also while it is disarmed."""
        await self.end_waiting_arm(job)
        await self.hold(job)

    async def hold(self, job: Job) -> None:
        """Stop in HOLD; done when telemetry shows that it stands still."""
        began = self.clock()
        await self._switch_to_hold(job)
        if self.state.armed:
            await self.until_it_stands(job, self.holding_mode, began)

    async def land_or_return(self, job: Job) -> None:
        """Stop where it is."""
        await self.hold(job)

    async def set_speed(self, job: Job, kind: str, speed: float) -> bool:
        """As for every vehicle. A standing rover refuses a speed, so it is kept for the next movement."""
        try:
            return await super().set_speed(job, kind, speed)
        except Rejected:
            if speed == 0 or self.mode != GUIDED or not self.stands_still:
                raise
            self.speeds.remember(kind, speed)
            return False

    async def set_reverse(self, job: Job, reverse: bool) -> None:
        """Drive backwards, or forwards again; a change of mode ends it.

        Raises:
            Busy: it is in a mode that does not drive by itself, so the autopilot would forget it.
        """
        self.require_armed()
        if self.mode not in DRIVING_MODES:
            raise Busy(f"the vehicle is in {self.mode}, and forgets it with the next mode; `guided` first")
        self.authority.accompany(job, "reverse")
        mode = self.mode
        await self.command(job).send(messages.set_reverse(reverse), lambda: self.held_by(mode))
