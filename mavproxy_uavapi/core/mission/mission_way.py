"""The legs of a mission: a walk through its items as the autopilot of the vehicle's type takes them. Pure.

Between two places an autopilot flies straight. What nobody can predict (splines, scripts, unknown items) is refused;
the error says why. A jump may be taken or not, whatever its counter says, until places, heights and speeds repeat: so
the legs are right wherever a mission goes on, and however often it went round before.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.forecast import Pace, Path
from mavproxy_uavapi.core.airspace.space import rows
from mavproxy_uavapi.core.airspace.time_limits import quantity
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.geodesy import DEG_E7, moved, offset
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.table import OF_TYPE, REASONS, RETURN_PATH, UNKNOWN, Deed, deed_of, is_navigation

mavlink = mavutil.mavlink

CLIMBS = {mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF}
# Items that only a plane with hover motors takes; `DELAY` and others do not part a landing from the next takeoff.
HOVERING = {mavlink.MAV_CMD_NAV_VTOL_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE}
LANDINGS = (Deed.LAND, Deed.GLIDE, Deed.RETURN_AND_LAND)
AMSL = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT, mavlink.MAV_FRAME_MISSION)
TERRAIN = (mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT)
CORNERS = 12  # of the polygon around a circle
MOST_STEPS = 40_000  # of a walk; jumps whose heights never repeat end there
AT_CENTRE = 1.0  # m; nearer to the middle of a circle nobody knows where on it a copter begins
ON_CIRCLE = 3.0  # m beside a circle at which a copter is on it
LIFT_OFF = 1.0  # m that a copter climbs at least
FIXED_WING_TAKEOFF, FIXED_WING_LANDING = 2, 4  # bits of Q_OPTIONS
LEAST_PITCH = 8.0  # degrees, of a plane's takeoff; SITL's plane climbs at 18 whatever the item says
SHARE_OF_PITCH, STEEPEST = 0.75, 25.0  # of its pitch the least slope that a plane climbs at, and degrees the most
ROLL = 60.0  # m that it rolls at most
LOWEST_RETURN = 0.3  # m above home, of a copter's RTL
LEAST_SLOPE = 0.5  # of RTL_CONE_SLOPE; less counts as none
SWING = 1.0  # s that a copter takes to turn off a circle, besides the braking
ACCELERATION = 2.5  # m/s/s, of a copter; WPNAV_ACCEL's own value
CIRCLE_RATE = math.radians(20.0)  # rad/s
LOOP = 10.0  # m: what a rover drives round in to come back to where it is
DRAWN = "a rover that does not stop at the waypoint before drives towards its place, and past the next one"
ANY_TIME = math.inf  # s; nobody knows how long an item takes
# Quantities that decide where a mission leads, each with its names up to 4.6 and since 4.7.
RALLY_TOTAL = "RALLY_TOTAL"
OF_ALL: list[tuple[str, ...]] = [("MIS_RESTART",), (RALLY_TOTAL,)]
WANTED: dict[str, list[tuple[str, ...]]] = {
    "copter": [
        *OF_ALL,
        ("CIRCLE_RADIUS", "CIRCLE_RADIUS_M"),
        ("RTL_ALT", "RTL_ALT_M"),
        ("RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M"),
        ("RTL_CONE_SLOPE",),
        ("RTL_SPEED", "RTL_SPEED_MS"),
    ],
    "plane": [
        *OF_ALL,
        ("RTL_ALTITUDE", "ALT_HOLD_RTL"),
        ("RTL_RADIUS",),
        ("RTL_AUTOLAND",),
        ("WP_LOITER_RAD",),
        ("Q_ENABLE",),
        ("Q_OPTIONS",),
    ],
    "rover": OF_ALL,
}


class PathPoint(NamedTuple):
    """A place on a way: latitude and longitude in degrees, and m above home."""

    lat: float
    lon: float
    up: float


class Leg(NamedTuple):
    """A straight part of a mission's way.

    Attributes:
        begin, end: its ends.
        seq: number of the item that it is flown for; one more than there are for what follows the mission.
        fastest, slowest: the speeds (m/s) that it may be flown at.
        margin: m beside it that the vehicle may be, because it leaves a circle.
        waits: s that the vehicle stays at its end; infinite where nobody knows.
        lands: whether it leads to the ground, so that no floor counts.
        is_last: whether it is the vertical part of a landing, which is not held against an envelope.
    """

    begin: PathPoint
    end: PathPoint
    seq: int
    fastest: Pace
    slowest: Pace
    margin: float = 0.0
    waits: float = 0.0
    lands: bool = False
    is_last: bool = False


@dataclass(frozen=True)
class Setting:
    """What a mission is flown with.

    Attributes:
        kind: `copter`, `plane` or `rover`.
        start: where it begins; None where that is not known yet, as before an upload.
        home: latitude and longitude; None where it is not known.
        home_amsl: m; None where it is not known.
        radius: m, of a plane's circles whose item has no radius; 0 for a vehicle that stands still there.
        heights_matter: whether the walk fails if a height is not known.
        heading: degrees, of a plane on the ground, which climbs ahead; None where it is not known.
        fastest, slowest: the speeds that it may begin with.
        parameters: those of the vehicle.
    """

    kind: str
    start: PathPoint | None
    home: tuple[float, float] | None = None
    home_amsl: float | None = None
    radius: float = 0.0
    heights_matter: bool = True
    heading: float | None = None
    fastest: Pace = Pace(10.0, 2.5, 1.5)
    slowest: Pace = Pace(10.0, 2.5, 1.5)
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class MissionRoute:
    """The legs of a mission.

    Attributes:
        legs: in the order of flight, each from the end of the one before; with `loops` in any order.
        loops: whether a jump leads back, or the mission may begin at several items.
    """

    legs: tuple[Leg, ...]
    loops: bool = False

    @cached_property
    def path(self) -> Path:
        """The legs as arrays: degrees and m above home. There is one at least."""
        begins, ends, _, fastest, slowest, _, waits, *_ = zip(*self.legs, strict=True)
        waiting = np.array(waits, dtype=float)
        return Path(rows(begins), rows(ends), rows(fastest), rows(slowest), waiting)


class _At(NamedTuple):
    """Where the walk is: the place (NaN where it is not known), speeds, and what an item before has left behind."""

    here: PathPoint
    fastest: Pace
    slowest: Pace
    margin: float = 0.0
    circle: float = 0.0  # m, the radius of a copter's last circle
    waits_for: bool = False  # whether a condition stands before the next speed
    circles: PathPoint | None = None  # the middle of the circle that a copter goes on with in a delay
    passes: bool = False  # whether a rover has come here without stopping, already turned to the next item's place


NOWHERE = PathPoint(math.nan, math.nan, math.nan)


def route(items: Sequence[MissionItem], setting: Setting, starts: Iterable[int] = (1,)) -> MissionRoute:
    """The legs of a mission that begins at one of the items `starts` (numbers from 1).

    Raises:
        OutsideEnvelope: nobody can say where an item leads, even one that is not flown.
    """
    for seq, item in enumerate(items, 1):
        if deed_of(setting.kind, item) is None:
            raise refusal(seq, item, REASONS.get(item.command, UNKNOWN))
    return _Walk(items, setting).all(list(starts))


def refusal(seq: int, item: MissionItem, why: str) -> OutsideEnvelope:
    """The error for an item that nobody can predict."""
    sentence = (
        f"mission item {seq} ({item.name}, command {item.command}): nobody can say whether it stays in the envelope"
    )
    return OutsideEnvelope(f"{sentence}: {why}", {"what": "unpredictable", "item": seq, "command": item.command})


def landing_places(
    items: Sequence[MissionItem], kind: str, home: tuple[float, float] | None
) -> dict[int, tuple[float, float] | None]:
    """By number, where the items land that land a vehicle of that kind; None for one that lands where it is."""
    lands = {command: deed for command, deed in OF_TYPE.get(kind, {}).items() if deed in LANDINGS}
    return {
        seq: home if lands[item.command] is Deed.RETURN_AND_LAND else _lat_lon(item)
        for seq, item in enumerate(items, 1)
        if item.command in lands
    }


def landing_starts(items: Sequence[MissionItem]) -> list[int]:
    """The items at which the autopilot may begin to land: DO_LAND_START."""
    return [seq for seq, item in enumerate(items, 1) if item.command == mavlink.MAV_CMD_DO_LAND_START]


def return_starts(items: Sequence[MissionItem]) -> list[int]:
    """The items at which a copter may begin in AUTO_RTL: on its return path, or at DO_LAND_START."""
    paths = [seq for seq, item in enumerate(items, 1) if item.command == RETURN_PATH]
    on_path = range(min(paths), len(items) + 1) if paths else ()
    return sorted({*on_path, *landing_starts(items)})


class _Walk:
    """One walk through a mission; see `route`."""

    def __init__(self, items: Sequence[MissionItem], setting: Setting) -> None:
        self._items, self._setting = items, setting
        self._legs: dict[Leg, None] = {}  # in order, each once
        self._branches: list[tuple[int, _At]] = []
        self._loops = False
        self._tags = {
            int(i.params[0]): n for n, i in reversed([*enumerate(items, 1)]) if i.command == mavlink.MAV_CMD_JUMP_TAG
        }

    def all(self, starts: list[int]) -> MissionRoute:
        setting = self._setting
        at = _At(setting.start or NOWHERE, setting.fastest, setting.slowest)
        self._branches = [(start, at) for start in reversed(starts)]
        self._loops = len(starts) > 1
        seen: set[tuple[int, _At]] = set()
        while self._branches:
            self._follow(*self._branches.pop(), seen)
        legs = tuple(self._legs) if self._loops else tuple(_joined(self._legs))
        return MissionRoute(legs, self._loops)

    def _follow(self, seq: int, at: _At, seen: set[tuple[int, _At]]) -> None:
        has_flown = False  # since the last jump
        while seq <= len(self._items):
            step = seq, _rounded(at)
            if step in seen:
                self._loops = True
                if not has_flown:  # an autopilot ends a mission that only jumps
                    self._end(at)
                return
            seen.add(step)
            if len(seen) > MOST_STEPS:
                raise refusal(seq, self._items[seq - 1], "the jumps of the mission lead too many ways")
            item = self._items[seq - 1]
            deed = self._deed(item)
            if deed in (Deed.JUMP, Deed.JUMP_TO_TAG):
                target = self._target(seq, item, deed)
                if target is None:
                    break
                if item.params[1] != -1 and target != seq + 1:
                    self._loops = True
                    self._branches.append((seq + 1, at))
                seq, has_flown = target, False
                continue
            has_flown = has_flown or is_navigation(item.command)
            after = self._do(seq, item, deed, at)
            if after is None:
                return
            seq, at = seq + 1, after
        self._end(at)

    def _target(self, seq: int, item: MissionItem, deed: Deed) -> int | None:
        """Where a jump leads; None where it ends the mission."""
        target, times = int(item.params[0]), int(item.params[1])
        if deed is Deed.JUMP_TO_TAG:
            target = self._tags.get(target, 0)
        if not 0 < target <= len(self._items):
            return None
        return target if times else seq + 1

    def _deed(self, item: MissionItem) -> Deed:
        deed = deed_of(self._setting.kind, item)
        assert deed is not None
        hovers = self._setting.parameters.get("Q_ENABLE", 0.0)
        if self._setting.kind == "plane" and item.command in HOVERING and not hovers:
            return Deed.SKIP
        if deed is Deed.GLIDE and (hovers == 2 or self._hovers_instead(FIXED_WING_LANDING)):
            return Deed.LAND
        return deed

    def _hovers_instead(self, option: int) -> bool:
        """Whether a plane with hover motors takes off or lands upright; a bit of Q_OPTIONS lets it do so by wing."""
        parameters = self._setting.parameters
        return parameters.get("Q_ENABLE", 0.0) > 0 and not int(parameters.get("Q_OPTIONS", 0.0)) & option

    # -- items --------------------------------------------------------------------------------------------

    def _do(self, seq: int, item: MissionItem, deed: Deed, at: _At) -> _At | None:
        """Where an item leaves the vehicle; None where the mission ends with it."""
        if deed is Deed.SKIP and at.passes and _lat_lon(item) is not None:
            raise refusal(seq, item, DRAWN)
        if deed in (Deed.SKIP, Deed.NOTHING):
            is_condition = item.command in (mavlink.MAV_CMD_CONDITION_DELAY, mavlink.MAV_CMD_CONDITION_DISTANCE)
            return at._replace(waits_for=at.waits_for or is_condition)
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

    def _move(self, seq: int, item: MissionItem, deed: Deed, at: _At) -> _At | None:
        if deed is Deed.WAIT:
            return self._fly(seq, at, at.here, waits=item.params[0] if item.params[0] > 0 else ANY_TIME)
        if deed is Deed.CLIMB:
            return self._climb(seq, item, at)
        if deed is Deed.CIRCLE and self._setting.kind != "plane":
            return self._circle(seq, item, at)
        return self._go(seq, item, deed, at)

    def _go(self, seq: int, item: MissionItem, deed: Deed, at: _At) -> _At | None:
        """To its place; a plane circles there, unless it only passes."""
        is_plane = self._setting.kind == "plane"
        place = self._place(seq, item, at, keeps_zero=not is_plane or deed is not Deed.GO)
        before = at.here
        if deed is Deed.GO:
            at = self._fly(seq, at, place, waits=0.0 if is_plane else max(item.params[0], 0.0))
            if self._setting.kind == "rover":
                return at._replace(passes=int(item.params[0]) <= 0, margin=LOOP if _is_near(before, place) else 0.0)
            beyond = _beyond(before, place, min(item.params[2], 255.0)) if is_plane and item.params[2] > 0 else None
            return at if beyond is None else self._fly(seq, at, beyond)
        if deed is Deed.CHANGE_HEIGHT:
            at = self._fly(seq, at, place)
            height = self._height(seq, item)
            return self._fly(seq, at, place._replace(up=height), waits=ANY_TIME)
        radius = _radius_of_plane(item, self._setting.radius) if is_plane else 0.0
        lasts = ANY_TIME if is_plane or deed is Deed.STAY_FOR_EVER else max(item.params[0], 0.0)
        at = self._fly(seq, at, place, waits=lasts)
        if radius:
            self._round(seq, at, place, radius)
            if item.command == mavlink.MAV_CMD_NAV_LOITER_TO_ALT and not math.isnan(before.up):
                column = at._replace(here=place._replace(up=before.up), margin=radius)
                self._fly(seq, column, place)
            at = at._replace(margin=radius)
        return None if deed is Deed.STAY_FOR_EVER else at

    def _circle(self, seq: int, item: MissionItem, at: _At) -> _At:
        """A copter flies to the nearest point of the circle, and as far along it as the item says."""
        centre = self._place(seq, item, at, keeps_zero=True)
        radius = _stored_radius(item.params[2]) or at.circle or self._own_circle()
        at = at._replace(circle=radius)
        if math.isnan(at.here.lat):
            self._round(seq, at, centre, radius)
            return at._replace(here=centre, margin=radius, circles=centre)
        north, east = offset(centre.lat, centre.lon, at.here.lat, at.here.lon)
        distance = math.hypot(north, east)
        turns = item.params[0] if 0 < item.params[0] < 1 else float(int(item.params[0]))
        if distance < AT_CENTRE:  # it leaves to where it points, which nobody knows
            at = self._fly(seq, at._replace(margin=max(at.margin, radius)), centre, waits=ANY_TIME)
            self._round(seq, at, centre, radius)
            return at._replace(margin=radius, circles=centre)
        along = math.atan2(east, north)
        edge = centre._replace(**_on_circle(centre, radius, along))
        if abs(distance - radius) > ON_CIRCLE:
            at = self._fly(seq, at, edge)
        self._round(seq, at, centre, radius)
        turned = 2 * math.pi * turns * (-1 if item.params[2] < 0 else 1)
        off = centre._replace(**_on_circle(centre, radius, along + turned))
        at = self._fly(seq, at._replace(here=off), off, waits=ANY_TIME)
        speed = min(at.fastest.level, CIRCLE_RATE * radius)
        return at._replace(circles=centre, margin=speed**2 / (2 * ACCELERATION) + speed * SWING)

    def _climb(self, seq: int, item: MissionItem, at: _At) -> _At:
        up, here = self._height(seq, item), at.here
        if not math.isnan(here.up):
            is_relative = self._setting.kind == "plane" and item.command == mavlink.MAV_CMD_NAV_VTOL_TAKEOFF
            least = here.up + (item.z if is_relative else 0.0)
            up = max(up, least, here.up + LIFT_OFF if here.up < LIFT_OFF else up)
        by_wing = item.command == mavlink.MAV_CMD_NAV_TAKEOFF and not self._hovers_instead(FIXED_WING_TAKEOFF)
        if self._setting.kind == "plane" and by_wing:
            return self._climb_ahead(seq, item, at, up)
        return self._fly(seq, at, here._replace(up=up))

    def _climb_ahead(self, seq: int, item: MissionItem, at: _At, up: float) -> _At:
        """A plane climbs along its heading, and turns to its next place anywhere between two points."""
        here, heading = at.here, self._setting.heading
        if math.isnan(here.up) or heading is None or up <= here.up:
            return self._fly(seq, at, here._replace(up=up))
        slopes = STEEPEST, min(max(item.params[0], LEAST_PITCH) * SHARE_OF_PITCH, STEEPEST)
        near, far = ((up - here.up) / math.tan(math.radians(slope)) for slope in slopes)
        far += ROLL
        end, middle = (
            here._replace(up=up, **_on_circle(here, metres, math.radians(heading)))
            for metres in (far, (near + far) / 2)
        )
        return self._fly(seq, at, end)._replace(here=middle, margin=(far - near) / 2)

    def _land(self, seq: int, item: MissionItem, deed: Deed, at: _At) -> _At | None:
        lat_lon = _lat_lon(item)
        place = at.here if lat_lon is None else PathPoint(*lat_lon, at.here.up)
        if deed is Deed.GLIDE:
            place = place._replace(up=self._height(seq, item))
            at = self._fly(seq, at, place, lands=True)
            return self._after_landing(seq, at)
        at = self._fly(seq, at, place)
        if deed is Deed.LAND:
            at = self._fly(seq, at, place._replace(up=min(0.0, place.up)), lands=True, is_last=True)
            return self._after_landing(seq, at)
        most = item.params[0]
        low = place._replace(up=place.up - most if most > 0 else min(0.0, place.up))
        at = self._fly(seq, at, low, lands=True, waits=ANY_TIME)
        return self._fly(seq, at, place, lands=True)

    def _return(self, seq: int, at: _At) -> _At | None:
        """Return to launch, by the parameters of the type."""
        setting, parameters = self._setting, self._setting.parameters
        if parameters.get(RALLY_TOTAL, 0.0) > 0:
            sentence = "nobody can say to which of its rally points the vehicle returns (RALLY_TOTAL)"
            raise OutsideEnvelope(f"the mission returns at item {seq}: {sentence}")
        if setting.home is None:
            if setting.start is None:
                return at._replace(here=NOWHERE)
            raise OutsideEnvelope(f"the mission returns at item {seq}, and home is not known")
        if setting.kind == "rover":
            return self._fly(seq, at, PathPoint(*setting.home, 0.0))
        if setting.kind == "plane":
            self._return_of_plane(seq, at)
            return None
        if math.isnan(at.here.up):
            return None
        up = return_height(parameters, at.here, setting.home)
        pace = quantity(parameters, "RTL_SPEED", "RTL_SPEED_MS", 0.0)
        if pace > 0:
            at = at._replace(fastest=at.fastest._replace(level=pace), slowest=at.slowest._replace(level=pace))
        above = PathPoint(*setting.home, up)
        at = self._fly(seq, self._fly(seq, at, at.here._replace(up=up)), above, waits=ANY_TIME)
        at = self._fly(seq, at, above._replace(up=0.0), lands=True, is_last=True)
        return self._after_landing(seq, at)

    def _return_of_plane(self, seq: int, at: _At) -> None:
        parameters = self._setting.parameters
        home = PathPoint(*(self._setting.home or (math.nan, math.nan)), at.here.up)
        height = parameters.get("RTL_ALTITUDE", parameters.get("ALT_HOLD_RTL", 10_000.0) / 100)
        above = home if height < 0 else home._replace(up=height)
        radius = abs(parameters.get("RTL_RADIUS", 0.0)) or self._setting.radius
        lands = parameters.get("RTL_AUTOLAND", 0.0) > 0
        if lands:
            self._branches += [(start, at) for start in landing_starts(self._items)]
        at = self._fly(seq, at, above, waits=ANY_TIME)
        self._round(seq, at, above, radius)
        if lands:
            at = at._replace(margin=radius)
            self._branches += [(start, at) for start in landing_starts(self._items)]

    def _after_landing(self, seq: int, at: _At) -> _At | None:
        """Where it is if the mission goes on with a takeoff (MIS_OPTIONS); else it is over."""
        for item in self._items[seq:]:
            if item.command in CLIMBS:
                return at
            if is_navigation(item.command) and item.command != mavlink.MAV_CMD_NAV_DELAY:
                return None
        return None

    def _end(self, at: _At) -> None:
        """The mission is over: a plane returns, another vehicle stays."""
        if self._setting.kind == "plane" and not math.isnan(at.here.lat):
            self._return(len(self._items) + 1, at)

    def _changed_speed(self, item: MissionItem, at: _At) -> _At:
        kind, speed = int(item.params[0]), item.params[1]
        of_copter = {0: "level", 1: "level", 2: "climb", 3: "descent"}
        name = of_copter.get(kind) if self._setting.kind == "copter" else "level" if kind in (0, 1) else None
        if name is None or speed < 0 or (speed == 0 and self._setting.kind != "rover"):
            return at
        fastest, slowest = at.fastest._replace(**{name: speed}), at.slowest._replace(**{name: speed})
        if at.waits_for or self._setting.kind == "plane":  # it may come late, or be refused
            fastest = Pace(*map(max, fastest, at.fastest))
            slowest = Pace(*map(min, slowest, at.slowest))
        return at._replace(fastest=fastest, slowest=slowest)

    # -- places -------------------------------------------------------------------------------------------

    def _place(self, seq: int, item: MissionItem, at: _At, *, keeps_zero: bool) -> PathPoint:
        """Where an item leads: without a place, and with `keeps_zero` without a height, it is as it is."""
        lat_lon = _lat_lon(item)
        lat, lon = at.here[:2] if lat_lon is None else lat_lon
        is_plane = self._setting.kind == "plane"
        keeps = int(item.z * 100) == 0 and (lat_lon is None if is_plane and not keeps_zero else keeps_zero)
        if is_plane and keeps_zero and item.frame in AMSL:
            keeps = False
        height = self._height(seq, item)
        return PathPoint(lat, lon, at.here.up if keeps else height)

    def _height(self, seq: int, item: MissionItem) -> float:
        """Metres above home."""
        setting = self._setting
        if setting.kind == "rover":
            return 0.0
        if item.frame in TERRAIN and setting.heights_matter:
            raise refusal(seq, item, "its height is above the terrain, not above home")
        if item.frame in TERRAIN:
            return 0.0
        if item.frame in AMSL and setting.home_amsl is None and setting.heights_matter:
            raise refusal(seq, item, "its height is AMSL, and that of home is not known")
        return item.z - (setting.home_amsl or 0.0 if item.frame in AMSL else 0.0)

    def _own_circle(self) -> float:
        """CIRCLE_RADIUS of a copter, m."""
        return quantity(self._setting.parameters, "CIRCLE_RADIUS", "CIRCLE_RADIUS_M", 10.0) or 10.0

    def _fly(
        self,
        seq: int,
        at: _At,
        to: PathPoint,
        *,
        waits: float = 0.0,
        lands: bool = False,
        is_last: bool = False,
    ) -> _At:
        """A leg to a place; with an unknown beginning only its end counts."""
        begin = to if any(map(math.isnan, at.here)) else at.here
        if not any(map(math.isnan, to)):
            self._legs[Leg(begin, to, seq, at.fastest, at.slowest, at.margin, waits, lands, is_last)] = None
        return at._replace(here=to, margin=0.0)

    def _round(self, seq: int, at: _At, centre: PathPoint, radius: float) -> None:
        """The legs of a polygon around a circle."""
        if any(map(math.isnan, centre)) or not radius:
            return
        corners = polygon(centre, radius)
        for begin, end in zip(corners, corners[1:], strict=False):
            self._legs[Leg(begin, end, seq, at.fastest, at.slowest)] = None


def _joined(legs: Iterable[Leg]) -> Iterator[Leg]:
    """The legs, with those between them that lead onto circles and off them."""
    before: Leg | None = None
    for leg in legs:
        if before is not None and before.end != leg.begin:
            yield leg._replace(begin=before.end, end=leg.begin, waits=0.0, is_last=False)
        yield leg
        before = leg


def polygon(centre: PathPoint, radius: float) -> list[PathPoint]:
    """The corners of a polygon around a circle, the first one again at the end."""
    wide = radius / math.cos(math.pi / CORNERS)
    angles = [2 * math.pi * number / CORNERS for number in range(CORNERS + 1)]
    return [centre._replace(**_on_circle(centre, wide, angle)) for angle in angles]


def return_height(parameters: Mapping[str, float], here: PathPoint, home: tuple[float, float]) -> float:
    """The height (m above home) at which a copter returns from `here`: `ModeRTL::compute_return_target`."""
    climb = max(quantity(parameters, "RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M", 0.0), 0.0)
    least = max(LOWEST_RETURN, here.up + climb)
    up = max(quantity(parameters, "RTL_ALT", "RTL_ALT_M", 15.0), least)
    slope = parameters.get("RTL_CONE_SLOPE", 3.0)
    if slope >= LEAST_SLOPE:
        up = min(up, max(slope * math.hypot(*offset(here.lat, here.lon, *home)), least))
    return max(up, here.up)


def _lat_lon(item: MissionItem) -> tuple[float, float] | None:
    """The place of an item; None where it has none: ArduPilot takes 0, 0 as the present position."""
    return None if item.x == 0 and item.y == 0 else (item.x / DEG_E7, item.y / DEG_E7)


def _stored_radius(radius: float) -> float:
    """A radius (m) as ArduPilot stores it in a LOITER_TURNS: a byte, of metres or of tens of them."""
    wide = abs(radius)
    return float(int(wide)) if wide <= 255 else 10.0 * min(255, int(wide / 10))


def _radius_of_plane(item: MissionItem, own: float) -> float:
    if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME:
        return own
    if item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
        return _stored_radius(item.params[2]) or own
    named = item.params[1 if item.command == mavlink.MAV_CMD_NAV_LOITER_TO_ALT else 2]
    return float(int(abs(named))) or own


def _on_circle(centre: PathPoint, radius: float, angle: float) -> dict[str, float]:
    lat, lon = moved(centre.lat, centre.lon, radius * math.cos(angle), radius * math.sin(angle))
    return {"lat": lat, "lon": lon}


def _beyond(before: PathPoint, place: PathPoint, metres: float) -> PathPoint | None:
    """The place so far behind `place`, on the way from `before`."""
    north, east = offset(before.lat, before.lon, place.lat, place.lon)
    distance = math.hypot(north, east)
    if not distance > 0:
        return None
    scale = metres / distance
    return place._replace(
        **dict(zip(("lat", "lon"), moved(place.lat, place.lon, north * scale, east * scale), strict=True))
    )


def _is_near(a: PathPoint, b: PathPoint) -> bool:
    return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon)) < ON_CIRCLE


def _rounded(at: _At) -> _At:
    """The same to 0.1 m, for a comparison; NaN equals NaN."""
    numbers = (round(at.here.lat, 6), round(at.here.lon, 6), round(at.here.up, 1))
    here = PathPoint(*(math.inf if math.isnan(number) else number for number in numbers))
    return at._replace(here=here)
