"""The legs that an autopilot flies for one mission item, by its type. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.cruise import over_ground
from mavproxy_uavapi.core.airspace.forecast import Pace
from mavproxy_uavapi.core.airspace.time_limits import limits
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.item_places import (
    ON_CIRCLE,
    beyond,
    is_near,
    on_circle,
    place_of,
    radius_of_plane,
    stored_radius,
)
from mavproxy_uavapi.core.mission.leg_drawing import SLOWEST, At, LegDrawing
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import NOWHERE, Leg, PathPoint, Setting, refusal
from mavproxy_uavapi.core.mission.plane_turns import (
    STEEPEST_LANDING,
    comes_to_rest_beyond,
    turning_radius,
)
from mavproxy_uavapi.core.mission.returns import return_height, return_height_of_plane, return_pace
from mavproxy_uavapi.core.mission.table import (
    CONDITIONS,
    OF_TYPE,
    TAKEOFFS,
    Deed,
    habit_of,
    is_navigation,
    return_starts,
)

mavlink = mavutil.mavlink

AT_CENTRE = 1.0  # m; nearer to the middle of a circle nobody knows where on it a copter begins
LIFT_OFF = 1.0  # m that a copter climbs at least
FIXED_WING_TAKEOFF, FIXED_WING_LANDING = 2, 4  # bits of Q_OPTIONS
LEAST_PITCH = 8.0  # degrees, of a plane's takeoff; SITL's plane climbs at 18 whatever the item says
SHARE_OF_PITCH, STEEPEST = 0.75, 25.0  # of its pitch the least slope that a plane climbs at, and degrees the most
ROLL = 60.0  # m that it rolls at most
GLIDES_FASTER = 1.2  # times, of a landing plane that first climbs to its slope: SITL's flew 28.8 m/s for 25.5
LANDS_AT_HOME = 1  # Q_RTL_MODE of a plane with hover motors, which brakes, sinks and lands once it is near
Q_TRANS_DECEL = 2.0  # m/s/s, its own value
CLIMB_BEFORE_TURN = 16  # bit of FLIGHT_OPTIONS, of a plane's RTL
SWING = 1.2  # s that a copter takes to turn off a circle, besides the braking
SWERVE = 5.0  # m beside its next leg, of a copter that does not stop at the place of a LOITER_TO_ALT
CIRCLE_RATE = 20.0  # degrees/s at which a copter circles until its pilot uses CIRCLE; then at its own CIRCLE_RATE
MOST_BESIDE = 255.0  # m, of a waypoint's distances that AP_Mission stores
# m: what a rover drives round in to come back to where it is, and what a copter that a tag leads back to where it is
# flies beyond its next place.
LOOP = 12.0
DRAWN = "a rover that does not stop at the waypoint before drives towards its place, and past the next one"
SINKS = (
    "behind a waypoint without a delay ArduCopter sinks on its way there to the item's own height, and stays at it; "
    "give the waypoint a delay (param1), or this item its height"
)
NO_RADIUS = "without a radius a copter circles as wide as it did last, or not at all; give it one (param3)"
UPRIGHT = "off a circle a plane does not line up for an upright landing; give it a waypoint before"
SAME_HEIGHT = 0.5  # m
WIDEST = 5000.0  # m around where it may be, of a circle without a place in a loop: with each round it is anywhere
ANY_TIME = math.inf  # s; nobody knows how long an item takes


class ItemLegs(LegDrawing):
    """Collects the legs of items.

    Attributes:
        branches: where the walk goes on besides: item numbers, and where the vehicle is then.
    """

    def __init__(self, items: Sequence[MissionItem], setting: Setting) -> None:
        super().__init__(setting)
        self.branches: list[tuple[int, At]] = []
        self._items = items

    def begin(self) -> At:
        """Where the vehicle is before its first item; a plane in the air circles, and begins in any direction."""
        setting = self._setting
        at = At(setting.start or NOWHERE, setting.fastest, setting.slowest)
        circles = setting.kind == "plane" and setting.start is not None and setting.start.up > LIFT_OFF
        return at._replace(course=math.nan) if circles else at

    def hovers_instead(self, option: int) -> bool:
        """Whether a plane with hover motors takes off or lands upright; a bit of Q_OPTIONS lets it do so by wing."""
        parameters = self._setting.parameters
        return parameters.get("Q_ENABLE", 0.0) > 0 and not int(parameters.get("Q_OPTIONS", 0.0)) & option

    # -- items --------------------------------------------------------------------------------------------

    def do(self, seq: int, item: MissionItem, deed: Deed, at: At) -> At | None:
        """Where an item leaves the vehicle; None where the mission ends with it."""
        if at.on_circle and is_navigation(item.command):
            if deed is Deed.LAND:
                raise refusal(seq, item, UPRIGHT)
            leads_there = deed not in (Deed.SKIP, Deed.RETURN_AND_STAY)
            at = self._leave_circle(at, place_of(item) if leads_there else None)
        if at.passes and place_of(item) is not None:
            self._require_undrawn(seq, item, deed, at)
        if deed in (Deed.SKIP, Deed.NOTHING):
            return at._replace(waits_for=at.waits_for or item.command in CONDITIONS)
        if deed is Deed.SPEED:
            return self._changed_speed(item, at)
        circles, at = at.circles, at._replace(waits_for=False, circles=None, passes=False)
        if deed is Deed.WAIT and circles is not None:  # it goes on circling, and leaves it anywhere
            self._round(seq, at, circles, at.circle)
            return at._replace(here=circles, margin=at.circle)
        if deed in (Deed.RETURN, Deed.RETURN_AND_LAND, Deed.RETURN_AND_STAY):
            return self._return(seq, at)
        if deed in (Deed.LAND, Deed.PLACE, Deed.GLIDE):
            return self._land(seq, item, deed, at)
        return self._move(seq, item, deed, at)

    @staticmethod
    def _leave_circle(at: At, place: tuple[float, float] | None) -> At:
        """A plane leaves its circle in the direction of the next item's place; without one, or inside, anywhere."""
        lines_up = place is not None and math.hypot(*offset(*at.here[:2], *place)) > at.margin
        return at._replace(on_circle=False, course=None if lines_up else math.nan)

    def _require_undrawn(self, seq: int, item: MissionItem, deed: Deed, at: At) -> None:
        """Raise where the autopilot, which does not stop before this item, already flies to what it will not do."""
        if self._setting.kind == "rover" and deed is Deed.SKIP:
            raise refusal(seq, item, DRAWN)
        up = self._place(seq, item, at, keeps_zero=True).up if deed is Deed.PLACE else at.here.up
        if self._setting.kind == "copter" and abs(up - at.here.up) > SAME_HEIGHT:
            raise refusal(seq, item, SINKS)

    def _move(self, seq: int, item: MissionItem, deed: Deed, at: At) -> At | None:
        if deed is Deed.WAIT:
            return self._fly(seq, at, at.here, waits=item.params[0] if item.params[0] > 0 else ANY_TIME)
        if deed is Deed.CLIMB:
            return self._climb(seq, item, at)
        if deed is Deed.CIRCLE and self._setting.kind != "plane":
            return self._circle(seq, item, at)
        return self._go(seq, item, deed, at)

    def _go(self, seq: int, item: MissionItem, deed: Deed, at: At) -> At | None:
        """To its place, and perhaps stay there."""
        is_plane = self._setting.kind == "plane"
        place = self._place(seq, item, at, keeps_zero=not is_plane or deed is not Deed.GO)
        if is_plane:
            return self._pass(seq, item, at, place) if deed is Deed.GO else self._stay(seq, item, deed, at, place)
        before = at.here
        at = self._fly(seq, at, place, waits=ANY_TIME if deed is Deed.STAY_FOR_EVER else max(item.params[0], 0.0))
        if deed is Deed.GO:
            level = self._setting.kind == "rover" or abs(before.up - place.up) < SAME_HEIGHT
            returns = level and is_near(before, place)
            return at._replace(passes=int(item.params[0]) <= 0, margin=LOOP if returns else 0.0)
        if deed is Deed.CHANGE_HEIGHT:
            at = self._fly(seq, at, place._replace(up=self._height(seq, item)), waits=ANY_TIME)
            return at._replace(margin=max(at.margin, SWERVE))
        return None if deed is Deed.STAY_FOR_EVER else at

    def _pass(self, seq: int, item: MissionItem, at: At, place: PathPoint) -> At:
        """A plane's waypoint, from which its next leg begins: it may turn before it, or fly on behind it first."""
        accepted, passed_by = (min(max(metres, 0.0), MOST_BESIDE) for metres in item.params[1:3])
        drift = at.margin if place_of(item) is None else 0.0  # around where it is then
        before, at = at.here, self._fly(seq, at, place)
        further = beyond(before, place, passed_by) if passed_by else None
        if further is not None:
            self._fly(seq, at, further)
            return at._replace(margin=passed_by, course=math.nan)
        return at._replace(margin=accepted + drift)

    def _stay(self, seq: int, item: MissionItem, deed: Deed, at: At, place: PathPoint) -> At | None:
        """A plane circles around a place; from inside the circle it comes to it anywhere."""
        radius, before = radius_of_plane(item, self._setting.radius), at.here
        drift = at.margin if place_of(item) is None else 0.0  # around where it is then
        if not math.hypot(*offset(*before[:2], *place[:2])) > radius:
            at = at._replace(margin=max(at.margin, radius))
            onto_it = turning_radius(at.fastest.level, self._setting.parameters)  # it turns at the circle's edge
            drift += onto_it
        if drift > WIDEST:
            raise refusal(seq, item, "round after round it circles where it is, wherever that is; give it a place")
        at = self._fly(seq, at, place, waits=ANY_TIME)
        if radius:
            if item.command == mavlink.MAV_CMD_NAV_LOITER_TO_ALT and not any(map(math.isnan, (*place, before.up))):
                top, beside = place._replace(up=before.up), radius + drift
                self.legs[Leg(top, place, seq, at.fastest, at.slowest, beside, circles=True)] = None
            seconds = item.params[0] if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME else 0.0
            if deed is Deed.CIRCLE:
                seconds = item.params[0] * 2 * math.pi * radius / max(at.slowest.level, SLOWEST)
            self._round(seq, at, place, radius, drift=drift, seconds=seconds)
            at = at._replace(margin=radius + drift, on_circle=True)
        return None if deed is Deed.STAY_FOR_EVER else at

    def _circle(self, seq: int, item: MissionItem, at: At) -> At:
        """A copter flies to the nearest point of the circle, and as far along it as the item says."""
        centre = self._place(seq, item, at, keeps_zero=True)
        radius = stored_radius(item.params[2]) or at.circle
        if not radius:
            raise refusal(seq, item, NO_RADIUS)
        at = at._replace(circle=radius)
        turns = item.params[0] if 0 < item.params[0] < 1 else float(int(item.params[0]))
        acceleration = limits(self._setting.parameters, {}).acceleration
        fastest, slowest = self._speeds_on_circle(at, radius, acceleration)
        seconds = turns * 2 * math.pi * radius / slowest
        circling = at._replace(fastest=at.fastest._replace(level=fastest))
        if math.isnan(at.here.lat):
            self._round(seq, circling, centre, radius, seconds=seconds)
            return at._replace(here=centre, margin=radius, circles=centre)
        north, east = offset(centre.lat, centre.lon, at.here.lat, at.here.lon)
        distance = math.hypot(north, east)
        if distance < AT_CENTRE:  # it leaves to where it points, which nobody knows
            at = self._fly(seq, at._replace(margin=max(at.margin, radius)), centre, waits=ANY_TIME)
            self._round(seq, circling, centre, radius, seconds=seconds)
            return at._replace(margin=radius, circles=centre)
        along = math.atan2(east, north)
        edge = centre._replace(**on_circle(centre, radius, along))
        if abs(distance - radius) > ON_CIRCLE:
            at = self._fly(seq, at, edge)
        self._round(seq, circling, centre, radius, seconds=seconds)
        turned = 2 * math.pi * turns * (-1 if item.params[2] < 0 else 1)
        off = centre._replace(**on_circle(centre, radius, along + turned))
        at = self._fly(seq, at._replace(here=off), off, waits=ANY_TIME)
        return at._replace(circles=centre, margin=fastest**2 / (2 * acceleration) + fastest * SWING)

    def _speeds_on_circle(self, at: At, radius: float, acceleration: float) -> tuple[float, float]:
        """The fastest and the slowest (m/s) that a copter circles: `AC_Circle::calc_velocities`."""
        most = math.sqrt(acceleration * radius / 2)
        rate = math.radians(min(CIRCLE_RATE, abs(self._setting.parameters.get("CIRCLE_RATE", CIRCLE_RATE))))
        return min(at.fastest.level, most), max(min(at.slowest.level, most, rate * radius), SLOWEST)

    def _climb(self, seq: int, item: MissionItem, at: At) -> At:
        up, here = self._height(seq, item), at.here
        if not math.isnan(here.up):
            is_relative = self._setting.kind == "plane" and item.command == mavlink.MAV_CMD_NAV_VTOL_TAKEOFF
            least = here.up + (item.z if is_relative else 0.0)
            up = max(up, least, here.up + LIFT_OFF if here.up < LIFT_OFF else up)
        by_wing = item.command == mavlink.MAV_CMD_NAV_TAKEOFF and not self.hovers_instead(FIXED_WING_TAKEOFF)
        if self._setting.kind == "plane" and by_wing:
            return self._climb_ahead(seq, item, at, up)
        return self._fly(seq, at, here._replace(up=up))

    def _climb_ahead(self, seq: int, item: MissionItem, at: At, up: float) -> At:
        """A plane climbs along its heading, and turns to its next place anywhere between two points."""
        here, heading = at.here, self._setting.heading
        if math.isnan(here.up) or heading is None or up <= here.up:
            return self._fly(seq, at, here._replace(up=up))
        slopes = STEEPEST, min(max(item.params[0], LEAST_PITCH) * SHARE_OF_PITCH, STEEPEST)
        near, far = ((up - here.up) / math.tan(math.radians(slope)) for slope in slopes)
        far += ROLL
        end, middle = (
            here._replace(up=up, **on_circle(here, metres, math.radians(heading)))
            for metres in (far, (near + far) / 2)
        )
        return self._fly(seq, at, end)._replace(here=middle, margin=(far - near) / 2)

    def _land(self, seq: int, item: MissionItem, deed: Deed, at: At) -> At | None:
        lat_lon = place_of(item)
        place = at.here if lat_lon is None else PathPoint(*lat_lon, at.here.up)
        self._require_usual(seq, deed, "lands")
        if deed is Deed.GLIDE:
            return self._glide(seq, at, place._replace(up=self._height(seq, item)))
        at = self._fly(seq, at, place)
        if deed is Deed.LAND:
            slow = self._sinking(at, place.up)
            ground = self._fly(seq, slow, place._replace(up=min(0.0, place.up)), lands=True, is_last=True)
            return self._after_landing(seq, ground._replace(fastest=at.fastest, slowest=at.slowest))
        most = item.params[0]
        low = place._replace(up=place.up - most if most > 0 else min(0.0, place.up))
        placed = self._fly(seq, self._sinking(at, 0.0), low, lands=True, waits=ANY_TIME)
        return self._fly(seq, placed._replace(slowest=at.slowest), place, lands=True)

    def _glide(self, seq: int, at: At, place: PathPoint) -> At | None:
        """A plane's landing. It comes to rest on either side of its place; down a steep slope far behind it."""
        way = math.hypot(*offset(*at.here[:2], *place[:2]))
        slope = math.degrees(math.atan2(at.here.up - place.up, math.sqrt(max(way**2 - at.margin**2, 0.0))))
        if slope > STEEPEST_LANDING and self._setting.heights_matter:
            why = f"its slope of {slope:.0f} degrees is too steep to say where it touches down"
            raise OutsideEnvelope(f"the mission lands at item {seq}: {why} ({STEEPEST_LANDING:g} at most)")
        faster = at.fastest._replace(level=GLIDES_FASTER * at.fastest.level)
        before, at = at.here, self._fly(seq, at._replace(fastest=faster), place, lands=True)
        rest = beyond(before, place, comes_to_rest_beyond(slope))
        return self._after_landing(seq, at if rest is None else self._fly(seq, at, rest, lands=True))

    def _require_usual(self, seq: int, deed: Deed, does: str) -> None:
        """Raise where a parameter has the vehicle do an item in a way of its own."""
        setting = self._setting
        why = habit_of(setting.kind, deed, setting.parameters, heights_matter=setting.heights_matter)
        if why is not None:
            raise OutsideEnvelope(f"the mission {does} at item {seq}, and nobody can say on which way: {why}")

    def _return(self, seq: int, at: At) -> At | None:
        """Return to launch, by the parameters of the type."""
        setting, parameters = self._setting, self._setting.parameters
        if setting.has_rally:
            sentence = "nobody can say to which of its rally points the vehicle returns"
            raise OutsideEnvelope(f"the mission returns at item {seq}: {sentence}")
        if setting.home is None:
            if setting.start is None:
                return at._replace(here=NOWHERE)
            raise OutsideEnvelope(f"the mission returns at item {seq}, and home is not known")
        self._require_usual(seq, OF_TYPE[setting.kind][mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH], "returns")
        if setting.kind == "plane":
            self._return_of_plane(seq, at)
            return None
        before, at = at, self._at_speed_of_return(at)
        if setting.kind == "rover":  # and drives on as fast
            return self._fly(seq, at, PathPoint(*setting.home, 0.0))
        if math.isnan(at.here.up):
            return None
        up = return_height(parameters, at.here, setting.home)
        above = PathPoint(*setting.home, up)
        at = self._fly(seq, self._fly(seq, at, at.here._replace(up=up)), above, waits=ANY_TIME)
        at = self._fly(seq, self._sinking(at, up), above._replace(up=0.0), lands=True, is_last=True)
        return self._after_landing(seq, at._replace(fastest=before.fastest, slowest=before.slowest))

    def _at_speed_of_return(self, at: At) -> At:
        """The speeds of RTL, whatever the mission has changed: `wp_and_spline_init`, and AR_WPNav's `init`."""
        setting = self._setting
        own = (return_pace(setting.kind, setting.parameters, pace) for pace in (setting.fastest, setting.slowest))
        fastest, slowest = own
        return at._replace(fastest=fastest, slowest=slowest)

    def _return_of_plane(self, seq: int, at: At) -> None:
        parameters = self._setting.parameters
        home = PathPoint(*(self._setting.home or (math.nan, math.nan)), at.here.up)
        above = home._replace(up=return_height_of_plane(parameters, at.here.up))
        radius = abs(parameters.get("RTL_RADIUS", 0.0)) or self._setting.radius
        lands = parameters.get("RTL_AUTOLAND", 0.0) > 0
        climbs = parameters.get("RTL_CLIMB_MIN", 0.0)
        if int(parameters.get("FLIGHT_OPTIONS", 0.0)) & CLIMB_BEFORE_TURN:
            climbs = above.up - at.here.up
        if climbs > 0:  # it climbs ahead before it turns
            ahead = climbs / math.tan(math.radians(LEAST_PITCH * SHARE_OF_PITCH))
            turn = 2 * turning_radius(at.fastest.level, parameters)
            at = at._replace(margin=at.margin + ahead + turn, course=None)
        if lands:
            self.branches += [(start, at) for start in return_starts(self._items)]
        at = self._fly(seq, at, above, waits=ANY_TIME)
        self._round(seq, at, above, radius)
        if int(parameters.get("Q_RTL_MODE", 0.0)) == LANDS_AT_HOME:
            beside = max(radius, at.fastest.level**2 / (2 * Q_TRANS_DECEL))
            self._fly(seq, at._replace(margin=beside), home._replace(up=0.0), lands=True)
        if lands:
            at = at._replace(margin=radius, course=math.nan)
            self.branches += [(start, at) for start in return_starts(self._items)]

    def _after_landing(self, seq: int, at: At) -> At | None:
        """Where it is if the mission goes on with a takeoff (MIS_OPTIONS); else it is over."""
        for item in self._items[seq:]:
            if item.command in TAKEOFFS:
                return at
            if is_navigation(item.command) and item.command != mavlink.MAV_CMD_NAV_DELAY:
                return None
        return None

    def end(self, at: At) -> None:
        """The mission is over: a plane returns, another vehicle stays."""
        if self._setting.kind == "plane" and not math.isnan(at.here.lat):
            at = self._leave_circle(at, None) if at.on_circle else at
            self._return(len(self._items) + 1, at)

    def _changed_speed(self, item: MissionItem, at: At) -> At:
        kind, speed = int(item.params[0]), item.params[1]
        of_copter = {0: "level", 1: "level", 2: "climb", 3: "descent"}
        name = of_copter.get(kind) if self._setting.kind == "copter" else "level" if kind in (0, 1) else None
        if name is None or speed < 0 or (speed == 0 and self._setting.kind != "rover"):
            return at
        fastest, slowest = (pace._replace(**{name: speed}) for pace in (at.fastest, at.slowest))
        fastest = over_ground(self._setting.kind, fastest)
        if at.waits_for or self._setting.kind == "plane":  # it may come late, or be refused
            fastest = Pace(*map(max, fastest, at.fastest))
            slowest = Pace(*map(min, slowest, at.slowest))
        return at._replace(fastest=fastest, slowest=slowest)
