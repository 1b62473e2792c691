"""Mission files -> items as they are written: QGC WPL 110, QGroundControl's .plan and .mission, our own JSON. Pure.

Whether the items can be flown is not checked here; what is missing is never 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.mission import wpl
from mavproxy_uavapi.core.strict_json import is_finite_number, json_of, shown
from mavproxy_uavapi.core.text import nearest

mavlink = mavutil.mavlink

FRAMES = {
    "amsl": mavlink.MAV_FRAME_GLOBAL,
    "relative": mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    "terrain": mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    "mission": mavlink.MAV_FRAME_MISSION,
}
MOST_ITEMS = 5000  # more than any ArduPilot vehicle stores
PARAMS = tuple(f"param{number}" for number in range(1, 8))
PLACE = ("lat", "long", "alt")
SPELLINGS = {
    "lon": "long", "lng": "long", "longitude": "long", "latitude": "lat", "altitude": "alt",
    "autoContinue": "autocontinue",
}  # fmt: skip
ITEM_MEMBERS = ("seq", "command", "frame", *PARAMS[:4], *PLACE, *PARAMS[4:], "autocontinue")
# Of the whole: ours, those of the answer to GET, and QGroundControl's.
MEMBERS = (
    "items", "home", "device", "id", "result", "version", "groundStation", "geoFence", "rallyPoints",
    "plannedHomePosition", "MAV_AUTOPILOT", "complexItems",
)  # fmt: skip
# Without latitude and longitude ArduPilot takes the place where the vehicle is; it is never told so by half a place.
HERE = {
    mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF, mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_LOITER_UNLIM, mavlink.MAV_CMD_NAV_LOITER_TURNS,
    mavlink.MAV_CMD_NAV_LOITER_TIME, mavlink.MAV_CMD_NAV_LOITER_TO_ALT, mavlink.MAV_CMD_DO_LAND_START,
}  # fmt: skip
WITHOUT_HEIGHT = {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_DO_LAND_START}
FENCE = range(mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, mavlink.MAV_CMD_NAV_RALLY_POINT)
QGC_KEYS = {"params", "coordinate", "doJumpId"}
COMPLEX = "ComplexItem"
ALTITUDES_DIFFER = 0.01  # m


class WrittenItem(NamedTuple):
    """An item as it is written: MAV_CMD, MAV_FRAME, param1 to param7, and whether the mission goes on by itself."""

    command: int
    frame: int
    params: tuple[float, ...]
    autocontinue: bool = True


class WrittenMission(NamedTuple):
    """The items of a file, and its fence, rally points and home as they are written (None where it has none)."""

    items: list[WrittenItem]
    fence: Any = None
    rally: Any = None
    home: Any = None


def has_location(command: int) -> bool:
    """Whether param5 to param7 of a MAV_CMD are latitude, longitude and altitude."""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return bool(entry is not None and entry.has_location)


def command_name(command: int) -> str:
    """MAV_CMD's name without its prefix."""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return entry.name.removeprefix("MAV_CMD_") if entry else str(command)


def require_possible(count: int) -> None:
    """Raise Invalid unless a mission can have so many items."""
    if not 0 < count <= MOST_ITEMS:
        raise Invalid(f"a mission has 1 to {MOST_ITEMS} items besides home, not {count}", "items")


def read(text: str) -> WrittenMission:
    """The mission in a file's text, in any of the formats.

    Raises:
        BadRequest: it has none of them.
        Invalid: an item is not one; the error names its number, and its command.
    """
    text = text.lstrip("\ufeff \t\n")
    if text.startswith(wpl.HEAD):
        return _from_wpl(text)
    if text[:1] not in ("{", "["):
        raise BadRequest(
            f"a mission is a {wpl.WPL_110} file, a .plan file, or JSON; this begins with {shown(text[:20])}"
        )
    mission = json_of(text, "the mission")
    if isinstance(mission, list):
        return WrittenMission(_from_items(mission))
    if "fileType" not in mission and "mission" not in mission:
        _require_known(mission, MEMBERS, "the mission has")
    items: Any = mission.get("items")
    home = mission.get("plannedHomePosition", mission.get("home"))
    if "mission" in mission:
        inner = mission["mission"] if isinstance(mission["mission"], dict) else {}
        items, home = inner.get("items"), inner.get("plannedHomePosition")
        _require_version(mission, (1,), "the .plan file")
        _require_version(inner, (1, 2), "the .plan file's mission")
    elif mission.get("complexItems"):
        raise BadRequest(
            "the .mission file has complexItems, which only QGroundControl can convert: save it as .plan"
        )
    if not isinstance(items, list):
        raise BadRequest('a mission in JSON is {"items": [...]}, or a .plan file with its items in "mission"')
    return WrittenMission(_from_items(items), mission.get("geoFence"), mission.get("rallyPoints"), home)


def rally_points(body: Any) -> list[WrittenItem]:
    """The points of `{"points": [{"lat", "long", "alt", "frame"}, ...]}`, as items.

    Raises:
        BadRequest: it is none.
        Invalid: a point is not one; the error names its number.
    """
    points = body.get("points") if isinstance(body, dict) else None
    if not isinstance(points, list):
        forms = "a .plan file with some, a QGC WPL 110 file or a list of MAVProxy"
        raise BadRequest(f'rally points are {{"points": [{{"lat", "long", "alt"}}, ...]}}, {forms}')
    _require_known(body, ("points", *MEMBERS[2:5]), "the body has")
    command = {"command": mavlink.MAV_CMD_NAV_RALLY_POINT}
    items = [{**point, **command} if isinstance(point, dict) else point for point in points]
    return [_from_json(item, number) for number, item in enumerate(items, 1)]


# -- QGC WPL --------------------------------------------------------------------------------------------------


def _from_wpl(text: str) -> WrittenMission:
    """Home has number 0; a file that is numbered from 1 has none."""
    rows = wpl.rows(text)
    first = rows[0].number if rows else 1
    if first not in (0, 1):
        raise Invalid(f"line {rows[0].line}: the first row has the number {first}, not 0 (home) or 1", "items", "1")
    for expected, row in enumerate(rows, first):
        if row.number != expected:
            sentence = (
                f"line {row.line}: the row has the number {row.number}, not {expected}; rows are numbered in order"
            )
            raise Invalid(sentence, "items", str(expected))
    _require_mission([(row.number, row.command) for row in rows])
    home = None if first else rows.pop(0)
    if home is not None and not home.is_home:
        what = f"row 0 of a {wpl.WPL_110} file is home, a NAV_WAYPOINT (16); this is a {command_name(home.command)}"
        raise BadRequest(f"line {home.line}: {what}: put home before it, or number the rows from 1")
    items = [item_of(row) for row in rows]
    return WrittenMission(items, home=None if home is None else list(home.columns[8:11]))


def item_of(row: wpl.WplRow) -> WrittenItem:
    """The item that a row is."""
    return WrittenItem(row.command, int(row.columns[2]), row.columns[4:11], bool(row.columns[11]))


# -- JSON -----------------------------------------------------------------------------------------------------


def _from_items(items: list[Any]) -> list[WrittenItem]:
    flat = list(_flattened(items))
    require_possible(len(flat))
    written = [_from_json(item, number) for number, item in enumerate(flat, 1)]
    _require_mission([(number, one.command) for number, one in enumerate(written, 1)])
    ids = {one["doJumpId"]: number for number, one in enumerate(flat, 1) if isinstance(one.get("doJumpId"), int)}
    return [_jumping(item, number, ids) for number, item in enumerate(written, 1)]


def _flattened(items: list[Any]) -> Iterator[Any]:
    """The simple items, including those of a .plan file's surveys and corridors."""
    for number, item in enumerate(items, 1):
        if not isinstance(item, dict) or item.get("type") != COMPLEX:
            yield item
            continue
        transects = item.get("TransectStyleComplexItem")
        inner = transects.get("Items") if isinstance(transects, dict) else None
        if not isinstance(inner, list):
            kind = shown(item.get("complexItemType", "complex item"))
            what = f"item {number} of the .plan file is a {kind}, which only QGroundControl can convert to items"
            raise BadRequest(f"{what}: remove it, or upload the plan from there")
        yield from _flattened(inner)


def _from_json(item: Any, number: int) -> WrittenItem:
    if not isinstance(item, dict):
        raise Invalid("an item is a JSON object", "items", str(number))
    where = f"item {number}"
    try:
        if "command" not in item:
            raise Invalid(f"{where} has no command")
        command = _command(item["command"], where)
        where = f"{where} ({command_name(command)})"
        is_qgc = bool(QGC_KEYS & item.keys())
        params = _qgc_params(item, command, where) if is_qgc else _our_params(item, command, where)
        autocontinue = item.get("autoContinue", item.get("autocontinue", True))
        if not isinstance(autocontinue, bool) and autocontinue not in (0, 1):
            raise Invalid(f"{where}: its autocontinue is {shown(autocontinue)}, not true or false")
        return WrittenItem(command, _frame(item.get("frame", "relative"), where), params, bool(autocontinue))
    except Invalid as error:
        raise Invalid(str(error), "items", str(number)) from error


def _qgc_params(item: Mapping[str, Any], command: int, where: str) -> tuple[float, ...]:
    """param1 to param7; before .plan the last three were `coordinate`, and the others members of their own."""
    for name in (*PLACE, *SPELLINGS):
        if item.get(name) is not None and name != "autoContinue":
            raise Invalid(f"{where} has {name} besides params or coordinate, which hold its place")
    params, place = item.get("params"), item.get("coordinate")
    if params is None:
        params = [item.get(name) for name in PARAMS[:4]]
    if not isinstance(params, list) or not isinstance(place, list | None):
        raise Invalid(f"{where}: params and coordinate are lists")
    if place is not None and params[4:] != place:
        params = [*params, *place]
    if len(params) != len(PARAMS):
        raise Invalid(f"{where}: params has {len(params)} numbers, with its coordinate; there are 7")
    if has_location(command) and item.get("frame") == FRAMES["relative"]:
        written, flown = item.get("Altitude"), params[6]  # QGroundControl flies the first one, others the second
        if is_finite_number(written) and is_finite_number(flown) and abs(written - flown) > ALTITUDES_DIFFER:
            raise Invalid(f"{where}: its Altitude is {written:g}, and in its params it is {flown:g}")
    optional = 4 if has_location(command) else 7  # null: QGroundControl leaves it to the autopilot
    return tuple(
        0.0 if value is None and index < optional else _number(value, (*PARAMS[:4], *PLACE)[index], where)
        for index, value in enumerate(params)
    )


def _our_params(item: Mapping[str, Any], command: int, where: str) -> tuple[float, ...]:
    for name, spelled in SPELLINGS.items():
        if name in item and spelled in item:
            raise Invalid(f"{where} has {name} and {spelled}, which are the same")
    item = {SPELLINGS.get(name, name): value for name, value in item.items()}
    _require_known(item, (*ITEM_MEMBERS, "type"), f"{where} has")
    values = [_number(item.get(name, 0), name, where) for name in PARAMS[:4]]
    if not has_location(command):
        for name in PLACE:
            if name in item:
                raise Invalid(f"{where} has {name}, and is no place: param5 to param7 are its last parameters")
        return (*values, *(_number(item.get(name, 0), name, where) for name in PARAMS[4:]))
    names = dict(zip(PLACE, PARAMS[4:], strict=True))
    for name, param in names.items():
        if name in item and param in item:
            raise Invalid(f"{where} has {name} and {param}, which are the same")
    place = {name: item[key] for name in PLACE for key in (name, names[name]) if key in item}
    if command in HERE and not {"lat", "long"} & place.keys():
        place |= {"lat": 0, "long": 0}
    if command in WITHOUT_HEIGHT:
        place.setdefault("alt", 0)
    missing = [name for name in PLACE if name not in place]
    if missing:
        raise Invalid(f"{where} has no {' and no '.join(missing)}")
    return (*values, *(_number(place[name], name, where) for name in PLACE))


def _jumping(item: WrittenItem, number: int, ids: Mapping[float, int]) -> WrittenItem:
    """The item; if it is a jump of QGroundControl, to the number that its target has here."""
    if item.command != mavlink.MAV_CMD_DO_JUMP or not ids:
        return item
    target = ids.get(item.params[0])  # a float that equals a whole number finds it
    if target is None:
        raise Invalid(
            f"item {number} (DO_JUMP) jumps to {item.params[0]:g}, and no item has that doJumpId",
            "items",
            str(number),
        )
    return item._replace(params=(float(target), *item.params[1:]))


def _require_mission(commands: Iterable[tuple[int, int]]) -> None:
    """Raise Invalid if the list is that of a fence or of rally points: they are no items of a mission."""
    for number, command in commands:
        path = "rally" if command == mavlink.MAV_CMD_NAV_RALLY_POINT else "fence" if command in FENCE else ""
        if path:
            what = f"item {number} ({command_name(command)}) belongs to no mission"
            raise Invalid(f"{what}: POST /mission/{path} takes it", "items", str(number))


def _require_version(members: Mapping[str, Any], known: Sequence[int], what: str) -> None:
    version = members.get("version", known[-1])
    if version not in known:
        raise Invalid(f"{what} has version {shown(version)}; known is {' and '.join(map(str, known))}", "version")


def _require_known(members: Mapping[str, Any], known: Sequence[str], what: str) -> None:
    for name in members:
        if name not in known:
            raise Invalid(f"{what} an unknown {shown(name)}; {nearest(name, known)}")


def _command(command: Any, where: str) -> int:
    """A MAV_CMD by its number or its name, with or without the prefix."""
    if not isinstance(command, str):
        return _whole(command, "command", where)
    name = command.upper().removeprefix("MAV_CMD_")
    number: Any = getattr(mavlink, f"MAV_CMD_{name}", None)
    if number not in mavlink.enums["MAV_CMD"]:
        raise Invalid(f"{where}: there is no command {shown(command)}; NAV_WAYPOINT is one")
    return int(number)


def _frame(frame: Any, where: str) -> int:
    if not isinstance(frame, str):
        return _whole(frame, "frame", where)
    if frame.lower() not in FRAMES:
        raise Invalid(f"{where}: there is no frame {shown(frame)}; {nearest(frame, FRAMES)}")
    return int(FRAMES[frame.lower()])


def _whole(value: Any, name: str, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**31:
        raise Invalid(f"{where}: its {name} is {shown(value)}, not a whole number")
    return value


def _number(value: Any, name: str, where: str) -> float:
    if not is_finite_number(value):
        raise Invalid(f"{where}: its {name} is {shown(value)}, not a number")
    return float(value)
