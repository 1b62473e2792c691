"""The verbs of a plane: it cannot stand still in the air, so it circles where it stays.

ArduPlane has no LAND mode: a landing is a sequence of its mission (DO_LAND_START), or QLAND for a QuadPlane. It takes
off in TAKEOFF, and flies to positions in GUIDED by DO_REPOSITION only.
"""

from __future__ import annotations

import contextlib
import math
from typing import Any

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.airspace.time_limits import FlightLimits
from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import (
    Busy,
    Invalid,
    ModeChanged,
    OutsideEnvelope,
    Rejected,
    Stale,
    TimedOut,
    TooNear,
)
from mavproxy_uavapi.core.geodesy import moved
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget
from mavproxy_uavapi.core.mission import landing_pattern
from mavproxy_uavapi.core.mission.list_transfers import MISSION
from mavproxy_uavapi.core.mission.table import landing_starts
from mavproxy_uavapi.core.telemetry.flight_modes import LANDING_MODES, RETURN_MODES, flies_mission
from mavproxy_uavapi.core.vehicle import arming, mission_flight
from mavproxy_uavapi.core.vehicle.guided import GUIDED, TOLERANCE, GuidedVehicle, below_home
from mavproxy_uavapi.core.vehicle.own_target import TARGET_SHOWN
from mavproxy_uavapi.core.vehicle.touchdown import Touchdown

AUTO, LOITER, TAKEOFF, RTL = "AUTO", "LOITER", "TAKEOFF", "RTL"
QLAND, QLOITER = "QLAND", "QLOITER"
SPEED_MODES = {GUIDED, AUTO}  # others refuse DO_CHANGE_SPEED
LANDING_RETURNS = (1, 2)  # values of RTL_AUTOLAND with which a return goes on with the mission's landing, in AUTO
RADIUS = 60.0  # m; used until WP_LOITER_RAD is known
CIRCLING = 1.5  # radii from the centre within which a circling plane stays, including wind and entry
HEIGHT_TOLERANCE = 10.0  # m
LEVEL = 2.0  # m/s; a plane that climbs or sinks slower than this has done so
LOWEST_CIRCLE = 15.0  # m above home; below it a plane climbs, and does not turn
CLIMB_AWAY_TO = 30.0  # m above home; the height of ArduPlane's own go-around
STRAIGHT_ON = 300.0  # m ahead of the plane; it has climbed long before
CLIMB_AWAY = 20.0  # s for that climb, for deadlines
SLOW = 1.0  # m/s; the direction of what moves slower is not known
# Values of vtol_state: a QuadPlane hovers, also at a place in GUIDED; it climbs there, or brakes; it gathers speed.
HOVER = messages.mavlink.MAV_VTOL_STATE_MC
LIFTED = {
    HOVER,
    messages.mavlink.MAV_VTOL_STATE_TRANSITION_TO_MC,
    messages.mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW,
}
# Quantities and their defaults: cruise airspeed, climb and sink rates, m/s.
CRUISE = (("AIRSPEED_CRUISE", "TRIM_ARSPD_CM"), 12.0)
CLIMB, SINK = (("TECS_CLMB_MAX",), 5.0), (("TECS_SINK_MAX",), 5.0)
HEADWIND = 0.5  # share of the airspeed that remains as ground speed, for deadlines
CIRCLES = 60.0  # s for circles at both ends of a way, for deadlines
LANDING = 300.0  # s for a landing pattern and the disarming after it, for deadlines


class Plane(GuidedVehicle):
    """A fixed-wing plane or QuadPlane."""

    holding_modes = frozenset({LOITER, QLOITER})
    moving_modes = frozenset({GUIDED, TAKEOFF})
    begins_at_a_place = True
    failsafe_modes = frozenset({*LANDING_MODES, *RETURN_MODES, AUTO})  # it jumps to its mission's landing
    stops_by = (("WP_LOITER_RAD",),)

    @property
    def circles(self) -> bool:
        """Whether the wing carries it, so that it cannot stand."""
        return self._vtol_state not in LIFTED

    @property
    def _vtol_state(self) -> int | None:
        state: int | None = self.state.recent_field("EXTENDED_SYS_STATE", "vtol_state")
        return state

    @property
    def holding_mode(self) -> str:
        """LOITER on the wing. With lift motors that would begin a transition, so it is QLOITER.

        A QuadPlane that hovers in GUIDED stays there: in QLOITER the throttle stick may make it sink.
        """
        if self.circles:
            return LOITER
        return GUIDED if self._hovers_in_guided else QLOITER

    @property
    def _hovers_in_guided(self) -> bool:
        """Whether a report newer than the last order shows that it hovers. It hovers until the next order."""
        if self._vtol_state != HOVER or not self.mode == self.next_mode == GUIDED:
            return False
        shown_after = self.guard.ordered.at + TARGET_SHOWN + self.state.trip.deadline
        return self.state.messages["EXTENDED_SYS_STATE"].at > shown_after

    async def limits(self) -> FlightLimits:
        """Its speeds, for deadlines; it requests those that are unknown."""
        parameters = await self.parameters.read([CRUISE[0], CLIMB[0], SINK[0], ("RTL_AUTOLAND",)])
        cruise = parameters.get("AIRSPEED_CRUISE") or parameters.get("TRIM_ARSPD_CM", 100 * CRUISE[1]) / 100
        climb, sink = parameters.get(*CLIMB[0], CLIMB[1]), parameters.get(*SINK[0], SINK[1])
        return time_limits.limits(
            {"WP_SPD": HEADWIND * cruise, "WP_SPD_UP": climb / 2, "WP_SPD_DN": sink / 2, "LAND_SPD_MS": sink},
            self.speeds.in_force,
        )

    @property
    def takes_speeds(self) -> bool:
        """Whether its autopilot takes a speed in the mode that it is in."""
        return self.mode in SPEED_MODES

    async def _radius(self, *own: str) -> float:
        """The radius of its circles in m; `own`: parameters that come before WP_LOITER_RAD unless they are 0."""
        parameters = await self.parameters.read([(name,) for name in (*own, "WP_LOITER_RAD")])
        return next((abs(radius) for name in (*own, "WP_LOITER_RAD") if (radius := parameters.get(name))), RADIUS)

    async def is_vtol(self) -> bool:
        """Whether it can take off and land vertically: only then it reports a `vtol_state`. It is asked without."""
        if self._vtol_state is not None:
            return bool(self._vtol_state != messages.mavlink.MAV_VTOL_STATE_UNDEFINED)
        return bool((await self.parameters.read([("Q_ENABLE",)])).get("Q_ENABLE"))

    async def arm(self, job: Job, timeout: float | None = None) -> None:
        """As for every vehicle; first sets its mission to item 1: ArduPlane does not arm after a landing sequence.

        If item 1 is a landing, selecting it must not begin the landing, which would prevent arming, too. If the
        mission was cleared, only the older message ends the landing sequence.
        """
        await self.command(job).resumed()
        if self.state.armed is False:
            self.authority.take(job, Rank.ARM)
            if flies_mission(self.mode):
                await self.command(job).switch_mode(GUIDED, self.require_disarmed)
            await self._select_first_item(job)
        await super().arm(job, timeout)

    async def _select_first_item(self, job: Job) -> None:
        modes = (self.state.mode, GUIDED, None)  # None: it has rebooted meanwhile

        def check_unclaimed() -> None:
            self.require_disarmed()
            if self.state.mode not in modes:
                raise ModeChanged(f"the pilot or another client switched the vehicle to {self.mode} meanwhile")

        command = self.command(job)
        try:
            await command.send(messages.set_mission_current(1, reset=False), check_unclaimed)
        except Rejected:
            await command.post(messages.select_item(self.address, 1), check_unclaimed)
        command.require()
        check_unclaimed()

    # -- up and down --------------------------------------------------------------------------------------

    async def takeoff(self, job: Job, alt: float, *, vtol: bool = False, timeout: float | None = None) -> None:
        """Take off to `alt` m above home; done when it circles there in GUIDED, within 10 m of that height.

        It climbs in TAKEOFF, by its own parameters TKOFF_…; with `vtol` a QuadPlane climbs in GUIDED and hovers.
        """
        await self.command(job).take(Rank.ARM, lambda: self.require_can_take_off(job, alt))
        if vtol:
            await self.lift_off(job, alt)
        else:
            await self.command(job).switch_mode(TAKEOFF)
        # Read only now: a pilot may switch the mode while the vehicle is asked.
        allowed = self.allowed(CIRCLES + time_limits.leg_time(await self.limits(), 0.0, alt), timeout)
        if not vtol:
            await self._climb(job, alt, allowed)

        def reached() -> bool | None:
            self.report_leg(job, abs(alt - self.height))
            position = self.state.position
            climb = 0.0 if position is None else position.velocity[2]
            level = abs(alt - self.height) <= HEIGHT_TOLERANCE and abs(climb) <= LEVEL
            return True if level and self.state.landed is False else None

        await self.until(GUIDED, {"GLOBAL_POSITION_INT"}, reached, allowed, f"reach {alt:g} m")
        self.command(job).confirm()

    async def _climb(self, job: Job, alt: float, allowed: float) -> None:
        """Climb in TAKEOFF, then circle at `alt` in GUIDED; `allowed`: s for the climb."""
        handover = max(alt - HEIGHT_TOLERANCE, LOWEST_CIRCLE)

        def has_climbed() -> bool | None:
            self.report_leg(job, abs(alt - self.height))
            over = self.state.landed is False and not self.is_taking_off
            return True if self.height >= LOWEST_CIRCLE and (over or self.height >= handover) else None

        names = {"GLOBAL_POSITION_INT", "EXTENDED_SYS_STATE"}
        await self.until(TAKEOFF, names, has_climbed, allowed, f"climb in {TAKEOFF}")
        await self.wait_for_heartbeat()
        self.held_by(TAKEOFF)
        await self.command(job).switch_mode(GUIDED)

        def here() -> tuple[float, float] | None:
            with contextlib.suppress(Stale):  # after a stand of the main loop heartbeats come before positions
                return self.position().place
            return None

        place = await self.until(GUIDED, {"GLOBAL_POSITION_INT"}, here, arming.SHOWN_WITHIN, "report its position")
        await self._reposition(job, GlobalTarget(*place, alt))

    async def land(self, job: Job, timeout: float | None = None) -> None:
        """Land and disarm: a QuadPlane where it is, another plane by its mission's landing sequence.

        On the ground it is disarmed: a landing sequence would wait there for a takeoff.

        Raises:
            Busy: the mission has no landing sequence; `land_at` makes one.
            ModeChanged: the pilot has switched it since.
        """
        await self.command(job).take(Rank.STOP)  # a waiting arm ends
        if await self.stays_disarmed(job):
            return
        tells = self._vtol_state is not None
        vertical = await self.is_vtol()
        if not tells:  # it was asked, and the pilot may have switched it meanwhile
            await self.confirm_own_mode(job, self.authority.taken_in)
        if vertical:
            await self.command(job).switch_mode(QLAND)
        elif self.state.landed:
            self.require_own_mode(self.authority.taken_in)
            await arming.disarm(self, job, force=False)
            return
        else:
            await self._begin_landing(job)
        self.command(job).confirm()
        await self.landed_in(job, QLAND if vertical else AUTO, self.allowed(LANDING, timeout))

    async def _begin_landing(self, job: Job) -> None:
        """Jump to the mission's landing sequence. Its mission is looked at only after a refusal, to say why."""
        try:
            await self.command(job).switch_mode(AUTO, order=messages.start_landing())
        except Rejected as refusal:
            if await self._may_have_landing():
                raise
            sentence = "the vehicle's mission has no landing sequence (DO_LAND_START); `land_at` makes one"
            raise Busy(sentence) from refusal

    async def _may_have_landing(self) -> bool:
        """Whether its mission has a landing sequence; True as well if it does not tell."""
        try:
            return bool(landing_starts((await self.waypoints.download())[1]))
        except (Rejected, TimedOut, Busy):
            return True

    async def land_at(self, job: Job, lat: float, lon: float, alt: float = 0.0, *, vtol: bool = False) -> None:
        """Begin to land at a place; done when it flies the landing. The landing replaces its mission.

        Raises:
            NotArmed, Busy: it is not flying.
            Rejected, TimedOut: the mission was refused; the old one is back then, and the mode is unchanged.
        """
        self.require_armed()
        if self.state.landed:
            raise Busy("the vehicle is on the ground")
        here = self.position()
        place = GlobalTarget(lat, lon, alt)
        items = landing_pattern.pattern(place, here.place, vtol=vtol)
        await self.command(job).take(Rank.STOP, lambda: self.guard.require_mission(items, from_here=True))
        if self.mode == AUTO:  # a mission cannot change while it is flown
            await self.hold(job)
        mode = self.mode
        permit = self.command(job).permit(lambda: self.held_by(mode))
        await self.waypoints.upload({MISSION: items}, check=permit.check)
        self.guard.require_mission(items, from_here=True)  # again, because the upload has changed the mission
        await mission_flight.begin(self, job, lambda: self.held_by(mode) if self.mode != AUTO else None)

    async def land_or_return(self, job: Job) -> None:
        """Land if it can. Without a landing sequence, or if that is refused, return and circle at home."""
        since = self.state.mode_since
        try:
            await self.land(job)
        except (Busy, Rejected):
            await self.confirm_own_mode(job, since)
            await self.rtl(job)

    async def rtl(self, job: Job, timeout: float | None = None) -> None:
        """Return to launch; done when it circles there, or has landed if its parameters say so."""
        await self.command(job).take(Rank.STOP)
        if await self.is_done_at_home(job):
            return
        lands = self.state.parameters.get("RTL_AUTOLAND") in LANDING_RETURNS
        returning = (RTL, AUTO) if lands else (RTL,)
        await self.command(job).switch_mode(RTL, onward=returning[1:])
        self.command(job).confirm()
        await self.know_home()
        near = CIRCLING * await self._radius("RTL_RADIUS")
        distance = self.distance_home() or 0.0
        expected = CIRCLES + time_limits.leg_time(await self.limits(), distance, 0.0)

        landing = Touchdown(await self.limits())

        def at_home() -> bool | None:
            self.report_home(job)
            distance = self.distance_home()
            if self.state.armed and distance is not None and distance <= near:
                return True
            return self.has_landed(landing, *returning)

        names = {"HEARTBEAT", "GLOBAL_POSITION_INT"}
        await self.waiting.until(names, at_home, self.allowed(expected, timeout), "return home")

    # -- going and staying --------------------------------------------------------------------------------

    async def stop(self, job: Job) -> None:
        """Circle here in LOITER, or hover in QLOITER or GUIDED; the present movement ends.

        Raises:
            NotArmed: there is nothing to stop.
        """
        await self.end_waiting_arm(job)
        self.require_armed()
        await self.hold(job)
        held = self.mode in {*self.holding_modes, self.holding_mode}
        self.held_by(self.mode if held else self.holding_mode)

    async def brake(self, job: Job) -> None:
        """As `hold`."""
        await self.hold(job)

    async def hold(self, job: Job) -> None:
        """Circle in LOITER, or hover. Low over the ground it climbs straight ahead before it circles.

        Where it cannot climb ahead (the envelope, another vehicle, no position) it circles at once.
        """
        await self.command(job).take(Rank.STOP)
        if self._is_too_low_to_circle:
            since = self.state.mode_since
            with contextlib.suppress(Rejected, TimedOut, Stale, OutsideEnvelope, TooNear):
                await self._climb_ahead(job)
            await self.confirm_own_mode(job, since)
        await super().hold(job)

    @property
    def _is_too_low_to_circle(self) -> bool:
        is_up = bool(self.state.armed) and self.state.landed is False
        return is_up and self.circles and self.mode not in self.holding_modes and self.height < LOWEST_CIRCLE

    async def _climb_ahead(self, job: Job) -> None:
        """Go on in GUIDED in the direction of travel until it is high enough to circle.

        Raises:
            Stale: its direction of travel is not known.
            Rejected, TimedOut, OutsideEnvelope, TooNear: it does not climb, or must not go there.
        """
        away = messages.reposition(self._straight_on(), from_any_mode=True)
        await self.command(job).switch_mode(GUIDED, order=away)

        def has_climbed() -> bool | None:
            return True if self.height >= LOWEST_CIRCLE or self.state.landed else None

        await self.until(GUIDED, {"GLOBAL_POSITION_INT"}, has_climbed, self.allowed(CLIMB_AWAY, None), "climb")

    def _straight_on(self) -> GlobalTarget:
        """A place ahead, at the height of a go-around. Raises Stale."""
        here = self.position()
        north, east, _ = here.velocity
        speed = math.hypot(north, east)
        if speed < SLOW:
            raise Stale("the direction in which the vehicle flies is not known")
        ahead = STRAIGHT_ON / speed
        return GlobalTarget(*moved(*here.place, ahead * north, ahead * east), CLIMB_AWAY_TO)

    def hold_message(self) -> Any:
        """The one message that makes it hold, for the end of the module."""
        if self._is_too_low_to_circle:
            with contextlib.suppress(Stale):
                return messages.reposition(self._straight_on(), from_any_mode=True).to(self.address, 0)
        return super().hold_message()

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
        """Fly to a position and circle there; with `wait`, done when it circles there.

        It has arrived within 1.5 radii of its circles (WP_LOITER_RAD) and 10 m of altitude, or within `tolerance` if
        that is more. It always points in the direction of travel.
        """
        self.require_guided_flight()
        place = self._global(target)
        if isinstance(target, NedTarget) and place.alt < 0:
            raise Invalid(below_home(-place.alt))
        await self.command(job).take(Rank.MOVEMENT, self.inside(messages.reposition(place)))
        await self._reposition(job, place)
        if not wait:
            return
        radius = await self._radius()
        north, east, up = self.leg_to(place)
        expected = CIRCLES + time_limits.leg_time(await self.limits(), math.hypot(north, east), up)

        def arrived() -> bool | None:
            try:
                north, east, up = self.leg_to(place)
            except Stale:
                return None  # a gap in the telemetry
            self.report_leg(job, math.hypot(north, east))
            self.own_target.require()
            near = math.hypot(north, east) <= max(tolerance, CIRCLING * radius)
            return True if near and abs(up) <= max(tolerance, HEIGHT_TOLERANCE) else None

        names = {"GLOBAL_POSITION_INT"}
        await self.until(GUIDED, names, arrived, self.allowed(expected, timeout), "arrive")

    def _global(self, target: NedTarget | GlobalTarget) -> GlobalTarget:
        """The same place in degrees and m above home, the only form that ArduPlane takes."""
        if isinstance(target, GlobalTarget):
            return target
        north, east, up = self.leg_to(target)
        here = self.position()
        return GlobalTarget(*moved(*here.place, north, east), here.alt + up)

    async def _reposition(self, job: Job, place: GlobalTarget) -> None:
        await self.command(job).send(messages.reposition(place), self.flying)
        self.own_target.sent(place)
        await self.send_speeds(job, new_kind=False)
