"""Mission files -> mission items: QGC WPL 110, QGroundControl's .plan, and our own JSON. pymavlink parses.

Item 0 of an ArduPilot mission is home. It is no item here: a list begins with item 1.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pymavlink import mavutil, mavwp

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.link.link import Address

mavlink = mavutil.mavlink

FRAMES = {
    "amsl": mavlink.MAV_FRAME_GLOBAL,
    "relative": mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    "terrain": mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    "mission": mavlink.MAV_FRAME_MISSION,
}
SAME_FRAMES = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
WPL_110 = "QGC WPL 110"
LOWEST, HIGHEST = -1000.0, 10_000.0  # m, in whichever frame
MOST_ITEMS = 5000  # more than any ArduPilot vehicle stores
ALTITUDE_TOLERANCE = 0.02  # m; ArduPilot stores whole centimetres
PLACE_TOLERANCE = 10  # 1e-7 degrees, about 0.1 m; an answer in floats is no better
DEGREES = 1e7


@dataclass(frozen=True)
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
        entry = mavlink.enums["MAV_CMD"].get(self.command)
        return entry.name.removeprefix("MAV_CMD_") if entry else str(self.command)

    @property
    def has_location(self) -> bool:
        """Whether x, y and z are a place."""
        return has_location(self.command)

    def to(self, address: Address, seq: int) -> Any:
        """MISSION_ITEM_INT number `seq` to `address`."""
        head = (*address, seq, self.frame, self.command, 0, int(self.autocontinue))
        return mavlink.MAVLink_mission_item_int_message(*head, *self.params, self.x, self.y, self.z)

    def report(self, seq: int) -> dict[str, Any]:
        """The item as clients see it, and may post it again."""
        report: dict[str, Any] = {"seq": seq, "command": self.name, "frame": _frame_name(self.frame)}
        report |= {f"param{number}": value for number, value in enumerate(self.params, 1)}
        if self.has_location:
            report |= {"lat": self.x / DEGREES, "long": self.y / DEGREES, "alt": self.z}
        else:
            report |= {"param5": self.x, "param6": self.y, "param7": self.z}
        return {**report, "autocontinue": self.autocontinue}


HOME = MissionItem(mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), 0, 0, 0.0)


def has_location(command: int) -> bool:
    """Whether param5 to param7 of a MAV_CMD are latitude, longitude and altitude."""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return bool(entry is not None and entry.has_location)


def read(text: str) -> list[MissionItem]:
    """The items of a mission in any of the three formats.

    Raises:
        BadRequest: it is none of them.
        Invalid: an item cannot be flown.
    """
    if text.lstrip("\ufeff").startswith("QGC WPL"):
        return checked(_from_wpl(text.lstrip("\ufeff")))
    try:
        mission = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadRequest(f"a mission is a QGC WPL 110 file, a .plan file, or JSON: {error}") from error
    if isinstance(mission, dict) and isinstance(mission.get("mission"), dict):
        _require_mission_alone(mission)
        mission = _flattened(mission["mission"].get("items"))
        return checked(_loaded(mission, _from_plan_item))
    if isinstance(mission, dict):
        mission = mission.get("items")
    if not isinstance(mission, list):
        raise BadRequest('JSON of a mission is {"items": [...]}, or a .plan file')
    return checked(_loaded(mission, _from_json_item))


def from_message(message: Any) -> MissionItem:
    """The item of a MISSION_ITEM_INT or MISSION_ITEM."""
    as_int = message.get_type() == "MISSION_ITEM_INT"
    scale = DEGREES if has_location(message.command) and not as_int else 1.0
    x, y = (_whole(value * scale) for value in (message.x, message.y))
    params = (message.param1, message.param2, message.param3, message.param4)
    return MissionItem(message.command, message.frame, params, x, y, message.z, bool(message.autocontinue))


def difference(sent: Sequence[MissionItem], read_back: Sequence[MissionItem]) -> str | None:
    """How the mission that was read back differs from the one that was sent, in words; None where it does not.

    Only command, place and altitude are compared: an autopilot keeps only those parameters that it needs.
    """
    if len(sent) != len(read_back):
        return f"it has {len(read_back)} items, not {len(sent)}"
    for seq, (expected, actual) in enumerate(zip(sent, read_back, strict=True), 1):
        if expected.command != actual.command:
            return f"item {seq} is {actual.name}, not {expected.name}"
        if expected.has_location and not _same_place(expected, actual):
            return f"item {seq} ({expected.name}) is at another place"
    return None


def _same_place(a: MissionItem, b: MissionItem) -> bool:
    return (
        SAME_FRAMES.get(a.frame, a.frame) == SAME_FRAMES.get(b.frame, b.frame)
        and abs(a.x - b.x) <= PLACE_TOLERANCE
        and abs(a.y - b.y) <= PLACE_TOLERANCE
        and abs(a.z - b.z) <= ALTITUDE_TOLERANCE
    )


def checked(messages: Sequence[Any]) -> list[MissionItem]:
    """The items of MISSION_ITEMs, if their values can be flown.

    Raises:
        Invalid: with one entry for each problem.
    """
    if not 0 < len(messages) <= MOST_ITEMS:
        raise Invalid(f"a mission has 1 to {MOST_ITEMS} items besides home, not {len(messages)}", "items")
    numbered = [(seq, _problem(message)) for seq, message in enumerate(messages, 1)]
    problems = [
        {"loc": ["items", seq], "msg": problem, "type": "value_error"} for seq, problem in numbered if problem
    ]
    if problems:
        raise Invalid(problems)
    return [from_message(message) for message in messages]


def _problem(message: Any) -> str | None:
    """What is wrong with a MISSION_ITEM; None where nothing is."""
    numbers = [getattr(message, f"param{number}") for number in range(1, 5)] + [message.x, message.y, message.z]
    if not all(math.isfinite(number) and abs(number) < 1e30 for number in numbers):
        return "a number is not finite, or is too large"
    if not 0 <= message.command <= 65535:
        return f"there is no command {message.command}"
    if message.frame not in (*FRAMES.values(), *SAME_FRAMES):
        return f"frame {message.frame} is not a mission frame"
    if not has_location(message.command):
        return None if max(abs(message.x), abs(message.y)) < 2**31 else "param5 or param6 is too large"
    return _misplaced(message.x, message.y, message.z)


def _misplaced(lat: float, lon: float, alt: float) -> str | None:
    if not abs(lat) <= 90:
        return f"latitude {lat:g} is not between -90 and 90 degrees"
    if not abs(lon) <= 180:
        return f"longitude {lon:g} is not between -180 and 180 degrees"
    return None if LOWEST <= alt <= HIGHEST else f"altitude {alt:g} m is not between {LOWEST:g} and {HIGHEST:g}"


def _from_wpl(text: str) -> list[Any]:
    loader = mavwp.MAVWPLoader()
    header, _, rows = text.partition("\n")
    if header.strip() != WPL_110:
        raise BadRequest(f"this is not a {WPL_110} file: it begins with {header.strip()!r}")
    try:
        # load() calls this, too, but leaves its file open when a row is wrong.
        loader._read_waypoints_v110(io.StringIO(rows))
    except (mavwp.MAVWPError, ValueError) as error:
        raise BadRequest(f"this is not a {WPL_110} file: {error}") from error
    if loader.count() and loader.item(0).command != mavlink.MAV_CMD_NAV_WAYPOINT:
        raise BadRequest("the first row of a QGC WPL file is home, a waypoint (16); this one is another command")
    return list(loader.wpoints[1:])


def _loaded(items: Iterable[Any], convert: Any) -> list[Any]:
    """MISSION_ITEMs of JSON items."""
    loader = mavwp.MAVWPLoader()
    for seq, item in enumerate(items, 1):
        try:
            if not isinstance(item, dict):
                raise ValueError("an item is a JSON object")
            command, frame, autocontinue, numbers = convert(item)
            loader.add(mavlink.MAVLink_mission_item_message(0, 0, seq, frame, command, 0, autocontinue, *numbers))
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            raise Invalid(f"{type(error).__name__}: {error}", "items", str(seq)) from error
    return list(loader.wpoints)


def _require_mission_alone(plan: Mapping[str, Any]) -> None:
    """Refuse a .plan file with a fence or rally points: who wrote it counts on them.

    Raises:
        BadRequest: it names what the file has besides the mission.
    """
    fence, rally = plan.get("geoFence"), plan.get("rallyPoints")
    lists_of = [
        (fence, "polygons", "fence polygon"),
        (fence, "circles", "fence circle"),
        (rally, "points", "rally point"),
    ]
    lists = [(part.get(key), name) for part, key, name in lists_of if isinstance(part, dict)]
    counts = [(len(items), name) for items, name in lists if isinstance(items, list)]
    extra = ", ".join(f"{count} {name}{'s' if count > 1 else ''}" for count, name in counts if count)
    if extra:
        raise BadRequest(
            f"the .plan file also has {extra}, which a mission cannot hold: remove them there, PUT /envelope takes "
            "the fence, and MAVProxy's `fence load` and `rally load` upload files of their own"
        )


def _flattened(items: Any) -> list[Any]:
    """The simple items of a .plan file, including those of its surveys and corridors.

    Raises:
        BadRequest: there are no items, or items that only QGroundControl can convert.
    """
    if not isinstance(items, list):
        raise BadRequest("the .plan file has no mission items")
    simple: list[Any] = []
    for item in items:
        if not isinstance(item, dict) or item.get("type") != "ComplexItem":
            simple.append(item)
            continue
        transects = item.get("TransectStyleComplexItem")
        if not isinstance(transects, dict) or not isinstance(transects.get("Items"), list):
            raise BadRequest(f"the .plan file has a {item.get('complexItemType')}, which this API cannot fly")
        simple += _flattened(transects["Items"])
    return simple


def _from_plan_item(item: Mapping[str, Any]) -> tuple[int, int, int, list[float]]:
    numbers = [0.0 if number is None else _float(number) for number in item["params"]]
    if len(numbers) != 7:
        raise ValueError("params has 7 numbers")
    return _int(item["command"]), _int(item["frame"]), int(bool(item.get("autoContinue", True))), numbers


def _from_json_item(item: Mapping[str, Any]) -> tuple[int, int, int, list[float]]:
    place = [item.get(place, item.get(f"param{number}", 0)) for number, place in enumerate(("lat", "long", "alt"), 5)]
    numbers = [_float(item.get(f"param{number}", 0)) for number in range(1, 5)] + [_float(number) for number in place]
    frame = item.get("frame", "relative")
    if isinstance(frame, str):
        frame = FRAMES[frame.lower()]
    return _command(item["command"]), _int(frame), int(bool(item.get("autocontinue", True))), numbers


def _command(command: Any) -> int:
    """A MAV_CMD by its number or its name, with or without the prefix."""
    if not isinstance(command, str):
        return _int(command)
    number = getattr(mavlink, f"MAV_CMD_{command.upper().removeprefix('MAV_CMD_')}", None)
    if number is None:
        raise ValueError(f"there is no command {command!r}")
    return int(number)


def _int(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{value!r} is not a whole number")
    return value


def _float(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{value!r} is not a number")
    return float(value)


def _whole(value: float) -> int:
    return value if isinstance(value, int) else round(value)


def _frame_name(frame: int) -> str | int:
    plain = SAME_FRAMES.get(frame, frame)
    return next((name for name, number in FRAMES.items() if number == plain), frame)
