"""Mission items as a vehicle gets them: of files, which `mission_formats` reads, and of messages.

Item 0 of an ArduPilot mission is home. It is no item here: a list begins with item 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import formats as envelope_formats
from mavproxy_uavapi.core.airspace.model import Envelope
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.geodesy import DEG_E7
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.mission import mission_formats, rally_files
from mavproxy_uavapi.core.mission.mission_formats import (
    FRAMES,
    WrittenItem,
    command_name,
    has_location,
    require_possible,
)
from mavproxy_uavapi.core.strict_json import is_finite_number, json_of, shown

mavlink = mavutil.mavlink

SAME_FRAMES = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
LOWEST, HIGHEST = -1000.0, 10_000.0  # m, in whichever frame
ALTITUDE_TOLERANCE = 0.02  # m; ArduPilot stores whole centimetres
PLACE_TOLERANCE = 10  # 1e-7 degrees, about 0.1 m; an answer in floats is no better
WHOLE_METRES = 1.0  # m; what ArduPilot stores of the height of a rally point
RALLY_POINT = mavlink.MAV_CMD_NAV_RALLY_POINT
# The items of a fence whose param1 counts corners, or is a radius (m).
FENCE_AREAS = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One mission item.

    Attributes:
        command: MAV_CMD.
        frame: MAV_FRAME.
        params: param1 to param4.
        x, y: 1e-7 degrees where the command has a location, else param5 and param6 as they are.
        z: m in its frame where the command has a location, else param7.
        autocontinue: whether the mission goes on by itself.
    """

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: bool = True

    @property
    def name(self) -> str:
        """MAV_CMD's name without its prefix."""
        return command_name(self.command)

    @property
    def has_location(self) -> bool:
        """Whether x, y and z are a place."""
        return has_location(self.command)

    def to(self, address: Address, seq: int, kind: int = mavlink.MAV_MISSION_TYPE_MISSION) -> Any:
        """MISSION_ITEM_INT number `seq` to `address`, of a list of that MAV_MISSION_TYPE."""
        head = (*address, seq, self.frame, self.command, 0, int(self.autocontinue))
        return mavlink.MAVLink_mission_item_int_message(*head, *self.params, self.x, self.y, self.z, kind)

    def report(self, seq: int) -> dict[str, Any]:
        """The item as clients see it, and may post it again."""
        report: dict[str, Any] = {"seq": seq, "command": self.name, "frame": _frame_name(self.frame)}
        report |= {f"param{number}": value for number, value in enumerate(self.params, 1)}
        if self.has_location:
            report |= {"lat": self.x / DEG_E7, "long": self.y / DEG_E7, "alt": self.z}
        else:
            report |= {"param5": self.x, "param6": self.y, "param7": self.z}
        return {**report, "autocontinue": self.autocontinue}


HOME = MissionItem(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), 0, 0, 0.0)


@dataclass(frozen=True)
class MissionParts:
    """What a mission file holds.

    Attributes:
        items: in their order, from item 1 on.
        fence: a .plan file's fence, of versions 1 and 2; None where it draws none.
        rally: a .plan file's rally points: latitude and longitude in degrees, and m above home.
        home: where it was planned to begin: latitude and longitude in degrees, m AMSL; None where it names no place.
    """

    items: tuple[MissionItem, ...]
    fence: Envelope | None = None
    rally: tuple[tuple[float, float, float], ...] = ()
    home: tuple[float, float, float] | None = None


def parts_of(text: str) -> MissionParts:
    """What a mission file holds, in any of the formats of `mission_formats`.

    Raises:
        BadRequest: it has none of them.
        Invalid: an item cannot be flown; the fence or a rally point makes no sense.
    """
    written = mission_formats.read(text)
    fence = None if written.fence is None else envelope_formats.fence_of_plan(written.fence, "the .plan file's fence")
    return MissionParts(tuple(checked(written.items)), fence, _rally(written.rally), _home(written.home))


def _home(home: Any) -> tuple[float, float, float] | None:
    """QGroundControl's is a list, or an item; ours an item. No vehicle takes it, so that nothing of it is refused."""
    if isinstance(home, dict):
        home = home.get("coordinate", [home.get(name) for name in mission_formats.PLACE])
    if not isinstance(home, list) or len(home) != 3 or not all(map(is_finite_number, home)):
        return None
    lat, lon, alt = map(float, home)
    return None if _misplaced(lat, lon, alt) or lat == lon == 0 else (lat, lon, alt)


def _rally(rally: Any) -> tuple[tuple[float, float, float], ...]:
    points = rally.get("points", []) if isinstance(rally, dict) else [] if rally is None else None
    if not isinstance(points, list):
        raise Invalid("rallyPoints has no list of points", "rallyPoints")
    places = []
    for number, point in enumerate(points, 1):
        if not isinstance(point, list) or len(point) != 3 or not all(map(is_finite_number, point)):
            raise Invalid(f"rally point {number}: {shown(point)} is not [lat, long, alt]", "rallyPoints")
        problem = _misplaced(*point)
        if problem:
            raise Invalid(f"rally point {number}: {problem}", "rallyPoints")
        places.append((float(point[0]), float(point[1]), float(point[2])))
    return tuple(places)


def rally_items(places: Sequence[tuple[float, float, float]]) -> list[MissionItem]:
    """The items of rally points: latitude and longitude in degrees, and m above home."""
    frame, params = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, (0.0, 0.0, 0.0, 0.0)
    return [
        MissionItem(RALLY_POINT, frame, params, round(lat * DEG_E7), round(lon * DEG_E7), alt)
        for lat, lon, alt in places
    ]


def rally_of(text: str) -> list[MissionItem]:
    """The items of the rally points in a .plan file, in our own JSON, or in MAVProxy's or Mission Planner's rows.

    Raises:
        BadRequest: it is none of these.
        Invalid: a point makes no sense, or there is none.
    """
    text = text.lstrip("\ufeff \t\r\n")
    is_rows = rally_files.is_rows(text)
    body = json_of(text, "the list of rally points") if text.startswith("{") else None
    if isinstance(body, dict) and "rallyPoints" in body:
        items = rally_items(_rally(body["rallyPoints"]))
    else:
        written = rally_files.read(text) if is_rows else mission_formats.rally_points(body)
        items = checked(written) if written else []
    if not items:
        raise Invalid("there is no rally point in it; DELETE removes those that the vehicle has", "points")
    return items


def from_message(message: Any) -> MissionItem:
    """The item of a MISSION_ITEM_INT or MISSION_ITEM."""
    as_int = message.get_type() == "MISSION_ITEM_INT"
    scale = DEG_E7 if has_location(message.command) and not as_int else 1.0
    x, y = (_whole(value * scale) for value in (message.x, message.y))
    params = _shared(message.param1, message.param2, message.param3, message.param4)
    return MissionItem(message.command, message.frame, params, x, y, message.z, bool(message.autocontinue))


@lru_cache(maxsize=256)
def _shared(*params: float) -> tuple[float, float, float, float]:
    """The same tuple for equal parameters: those of thousands of items are mostly alike, and half of their memory."""
    first, second, third, fourth = params
    return first, second, third, fourth


def difference(sent: Sequence[MissionItem], read_back: Sequence[MissionItem]) -> str | None:
    """How the mission that was read back differs from the one that was sent, in words; None where it does not.

    Only command, place and altitude are compared, and the corners and radii of a fence: an autopilot keeps only those
    parameters that it needs, and whole metres of a rally point.
    """
    if len(sent) != len(read_back):
        return f"it has {len(read_back)} items, not {len(sent)}"
    for seq, (expected, actual) in enumerate(zip(sent, read_back, strict=True), 1):
        if expected.command != actual.command:
            return f"item {seq} is {actual.name}, not {expected.name}"
        if expected.has_location and not _same_place(expected, actual):
            return f"item {seq} ({expected.name}) is at another place"
        if expected.command in FENCE_AREAS and abs(expected.params[0] - actual.params[0]) > ALTITUDE_TOLERANCE:
            return f"item {seq} ({expected.name}) has {actual.params[0]:g} corners or m, not {expected.params[0]:g}"
    return None


def _same_place(a: MissionItem, b: MissionItem) -> bool:
    return (
        SAME_FRAMES.get(a.frame, a.frame) == SAME_FRAMES.get(b.frame, b.frame)
        and abs(a.x - b.x) <= PLACE_TOLERANCE
        and abs(a.y - b.y) <= PLACE_TOLERANCE
        and abs(a.z - b.z) <= (WHOLE_METRES if a.command == RALLY_POINT else ALTITUDE_TOLERANCE)
    )


def checked(items: Sequence[WrittenItem]) -> list[MissionItem]:
    """The items as the vehicle gets them, if their values can be flown.

    Raises:
        Invalid: with one entry for each problem; each names the item's number and command.
    """
    require_possible(len(items))
    numbered = [(seq, item, _problem(item)) for seq, item in enumerate(items, 1)]
    problems = [
        {
            "loc": ["items", seq],
            "msg": f"item {seq} ({command_name(item.command)}): {problem}",
            "type": "value_error",
        }
        for seq, item, problem in numbered
        if problem
    ]
    if problems:
        raise Invalid(problems)
    return [_as_flown(item) for item in items]


def _as_flown(item: WrittenItem) -> MissionItem:
    x, y, z = item.params[4:]
    scale = DEG_E7 if has_location(item.command) else 1.0
    first = (item.params[0], item.params[1], item.params[2], item.params[3])
    return MissionItem(item.command, item.frame, first, round(x * scale), round(y * scale), z, item.autocontinue)


def _problem(item: WrittenItem) -> str | None:
    """What is wrong with an item; None where nothing is."""
    if not all(math.isfinite(number) and abs(number) < 1e30 for number in item.params):
        return "a number is not finite, or is too large"
    if not 0 <= item.command <= 65535:
        return f"there is no command {item.command}"
    if item.frame not in (*FRAMES.values(), *SAME_FRAMES):
        return f"frame {item.frame} is not a mission frame"
    x, y, z = item.params[4:]
    if not has_location(item.command):
        return None if max(abs(x), abs(y)) < 2**31 - 1 else "param5 or param6 is too large"
    return _misplaced(x, y, z)


def _misplaced(lat: float, lon: float, alt: float) -> str | None:
    if not abs(lat) <= 90:
        return f"latitude {lat:g} is not between -90 and 90 degrees"
    if not abs(lon) <= 180:
        return f"longitude {lon:g} is not between -180 and 180 degrees"
    return None if LOWEST <= alt <= HIGHEST else f"altitude {alt:g} m is not between {LOWEST:g} and {HIGHEST:g}"


def _whole(value: float) -> int:
    return value if isinstance(value, int) else round(value)


def _frame_name(frame: int) -> str | int:
    plain = SAME_FRAMES.get(frame, frame)
    return next((name for name, number in FRAMES.items() if number == plain), frame)
