"""/mission/waypoints, /fence, /rally, /start, /progress: what the autopilot itself flies, keeps and returns to."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Sequence
from typing import Annotated, Any, cast

from aiohttp import web
from pydantic import Field
from typing_extensions import NotRequired, TypedDict

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import BadRequest, Forbidden, Stale
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.mission import fence_items, mission_files
from mavproxy_uavapi.core.mission.list_transfers import FENCE, MISSION, RALLY, Lists
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.core.shared_tasks import in_thread_if_long
from mavproxy_uavapi.core.vehicle import mission_flight
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import GeoJSON, Info, Latitude, Longitude, Success, means
from mavproxy_uavapi.http.contract.requests import MissionFile, Read, StartMission
from mavproxy_uavapi.http.contract.responses import Done, success
from mavproxy_uavapi.http.contract.route import ANY_FILE, FILE_FORM, JSON, OBJECT, TEXT
from mavproxy_uavapi.http.handlers.rehearsals import require_rehearsed_mission
from mavproxy_uavapi.http.wire.bodies import in_time
from mavproxy_uavapi.http.wire.forms import file_of

FORMS = {"multipart/form-data": FILE_FORM, **ANY_FILE}
WPL = """\
QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.165230\t584\t1
1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1
2\t0\t3\t16\t0\t0\t0\t0\t-35.363000\t149.165300\t12\t1
3\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""
TAKEOFF = {"command": "NAV_TAKEOFF", "alt": 10}
CIRCLE = {
    "type": "Feature",
    "properties": {"kind": "exclusion", "radius": 25},
    "geometry": {"type": "Point", "coordinates": [149.1665, -35.3625]},
}
FENCE_AREAS = {"type": "FeatureCollection", "features": [CIRCLE]}
POINT = {"lat": -35.3625, "long": 149.1665, "alt": 30}
MISSION_FILE = {"text/plain": {**TEXT, "example": WPL}, JSON: {**OBJECT, "example": {"items": [TAKEOFF]}}, **FORMS}
FENCE_FILE = {
    JSON: {**OBJECT, "example": FENCE_AREAS},
    "text/plain": TEXT,
    **FORMS,
}
RALLY_FILE = {JSON: {**OBJECT, "example": {"points": [POINT]}}, "text/plain": TEXT, **FORMS}
SIZES = {MISSION: "mission of {} items", FENCE: "fence of {} items", RALLY: "list of {} rally points"}
LARGEST = 1024 * 1024  # bytes of a mission file


class ItemReport(TypedDict):
    """An item of a mission; what it has in place of a place is in param5, param6 and param7."""

    seq: Annotated[int, means("its number, from 1", 1)]
    command: Annotated[str | int, means("MAV_CMD without its prefix, or its number", "NAV_TAKEOFF")]
    frame: Annotated[str | int, means("relative, terrain or amsl, or the number of a MAV_FRAME", "relative")]
    param1: float | None
    param2: float | None
    param3: float | None
    param4: float | None
    lat: NotRequired[Latitude]
    long: NotRequired[Longitude]
    alt: NotRequired[Annotated[float, means("m, by its frame", 10.0)]]
    param5: NotRequired[float | None]
    param6: NotRequired[float | None]
    param7: NotRequired[float | None]
    autocontinue: bool


class StoredMission(Success):
    """The vehicle's mission."""

    home: Annotated[ItemReport | None, Field(description="item 0, as the autopilot has it")]
    items: list[ItemReport]


class FenceAnswer(Success):
    """The areas of the autopilot's fence."""

    fence: GeoJSON


class RallyPoint(TypedDict):
    """A place that the autopilot may return to."""

    seq: Annotated[int, means("its number, from 1", 1)]
    frame: Annotated[str | int, means("relative, terrain or amsl, or the number of a MAV_FRAME", "relative")]
    lat: Latitude
    long: Longitude
    alt: Annotated[float, means("m, by its frame", 30.0)]


class RallyAnswer(Success):
    """The places that the autopilot may return to."""

    points: list[RallyPoint]


class Progress(TypedDict):
    """How far a mission has come."""

    current: Annotated[int, means("number of the item that is flown; 0 before any", 2)]
    total: Annotated[int | None, means("items besides home", 3)]
    last_reached: Annotated[int | None, means("number of the item that was reached last", 1)]
    state: Annotated[str, means("MISSION_STATE, such as active or complete", "active")]
    mode: Annotated[str, means("of the vehicle", "AUTO")]
    distance_m: Annotated[int | None, means("m to the current item, in AUTO", 14)]


async def upload(call: Call) -> Done:
    """Replace the vehicle's mission, with a .plan file also its fence and rally points; read them back.

    On failure the old ones stay, or the error says why not.
    """
    vehicle = call.vehicle
    body = await _body(call)
    parts = await asyncio.to_thread(mission_files.parts_of, body)
    lists: dict[int, Sequence[MissionItem]] = {}
    if parts.fence is not None:
        if call.caller.role < Role.ADMIN:
            raise Forbidden("the .plan file has a fence, and a fence needs the role admin; remove it there")
        lists[FENCE] = fence_items.items_of(parts.fence)
    if parts.rally:
        lists[RALLY] = mission_files.rally_items(parts.rally)
    lists[MISSION] = parts.items
    return await _upload(call, vehicle, body, lists, () if parts.fence is None else parts.fence.remarks)


async def upload_fence(call: Call) -> Done:
    """Replace the fence that the autopilot keeps, by GeoJSON, KML, a .plan or a fence file, and read it back."""
    vehicle = call.vehicle
    body = await _body(call)
    fence = await asyncio.to_thread(formats.read, body, "the fence")
    return await _upload(call, vehicle, body, {FENCE: fence_items.items_of(fence)}, fence.remarks)


async def upload_rally(call: Call) -> Done:
    """Replace the places that the autopilot may return to instead of home, and read them back."""
    vehicle = call.vehicle
    body = await _body(call)
    return await _upload(call, vehicle, body, {RALLY: await asyncio.to_thread(mission_files.rally_of, body)})


async def _upload(call: Call, vehicle: Vehicle, body: str, lists: Lists, remarks: Sequence[str] = ()) -> Done:
    """Upload the lists; the answer ends with `remarks`: what of the file is not in force."""
    sizes = {kind: len(items) for kind, items in lists.items()}
    identity = MissionFile(digest=hashlib.sha256(body.encode()).hexdigest(), items=sum(sizes.values()))

    async def verb(job: Job) -> None:
        def report_progress(done: int, of: int) -> None:
            job.progress = {"item": done, "items": of}

        def changed(kind: int, items: Sequence[MissionItem]) -> None:
            if kind == FENCE:
                _note_fence(call, vehicle, items)

        await vehicle.waypoints.upload(lists, report_progress, changed=changed)

    words = ", ".join(SIZES[kind].format(sizes[kind]) for kind in SIZES if kind in sizes)
    result = "; ".join([f"{words[0].upper()}{words[1:]} uploaded", *remarks])
    # A client that hangs up must not leave half a mission behind.
    return await call.fly(vehicle, verb, result, outlives_client=True, identity=identity)


def _note_fence(call: Call, vehicle: Vehicle, items: Sequence[MissionItem]) -> None:
    call.service.host.note_fence(vehicle.state.system, _fence_messages(vehicle, items))


def _fence_messages(vehicle: Vehicle, items: Sequence[MissionItem]) -> list[Any]:
    return [item.to(vehicle.address, seq, FENCE) for seq, item in enumerate(items)]


async def download(call: Call) -> StoredMission | web.Response:
    """The vehicle's mission, freshly read from it: `home`, and `items` from number 1 on."""
    vehicle = call.vehicle
    home, items = await vehicle.waypoints.read()

    def response() -> web.Response:
        body: StoredMission = {
            **call.answer("success"),
            "home": None if home is None else cast(ItemReport, home.report(0)),
            "items": [cast(ItemReport, item.report(number)) for number, item in enumerate(items, 1)],
        }
        return success(body)

    return await in_thread_if_long(len(items), response)


async def fence(call: Call) -> FenceAnswer:
    """The areas of the autopilot's fence, freshly read from it; its cylinder is in the parameters FENCE_*."""
    vehicle = call.vehicle
    items, system = await vehicle.waypoints.read_list(FENCE), vehicle.state.system
    if not items:
        return {**call.answer("success"), "fence": formats.EMPTY}
    messages, source = _fence_messages(vehicle, items), f"the fence of vehicle {system}"
    areas = formats.of_fence(messages, source, lambda: call.service.host.home_of(system))
    return {**call.answer("success"), "fence": formats.geojson(areas)}


async def rally(call: Call) -> RallyAnswer:
    """The places that the autopilot may return to instead of home, freshly read from it."""
    items = await call.vehicle.waypoints.read_list(RALLY)
    members = RallyPoint.__annotations__
    reports = [item.report(number) for number, item in enumerate(items, 1)]
    points = [cast(RallyPoint, {name: report[name] for name in members}) for report in reports]
    return {**call.answer("success"), "points": points}


async def clear(call: Call) -> Done:
    """Remove the vehicle's mission."""
    return await _clear(call, MISSION, "Mission cleared")


async def clear_fence(call: Call) -> Done:
    """Remove the fence that the autopilot keeps; its cylinder, in the parameters FENCE_*, stays."""
    return await _clear(call, FENCE, "Fence cleared")


async def clear_rally(call: Call) -> Done:
    """Remove the rally points: the vehicle returns to home."""
    return await _clear(call, RALLY, "Rally points cleared")


async def _clear(call: Call, kind: int, result: str) -> Done:
    vehicle = call.vehicle

    async def verb(_job: Job) -> None:
        await vehicle.waypoints.clear(kind)
        if kind == FENCE:
            _note_fence(call, vehicle, ())

    return await call.fly(vehicle, verb, result, outlives_client=True)


async def start(call: Call) -> Done:
    """Fly the mission from its first item, in AUTO; needs an armed vehicle in GUIDED or AUTO."""
    vehicle, p = call.vehicle, call.params(StartMission)
    result = "Mission complete" if p.until_complete else "Mission started"
    require_unchanged = await require_rehearsed_mission(call, vehicle)

    async def verb(job: Job) -> None:
        require_unchanged()
        await mission_flight.fly(vehicle, job, p.until_complete, p.timeout)

    return await call.fly(vehicle, verb, result)


async def progress(call: Call) -> Info[Progress]:
    """The current item, the number of items, the item reached last, and the distance (m) to the current one."""
    vehicle = call.known_vehicle
    info = cast(Progress, mission_flight.progress(vehicle))
    age = vehicle.state.newest("MISSION_CURRENT")
    assert age is not None
    seconds = max(vehicle.clock() - age.at, 0.0)
    limit = call.params(Read).max_age or call.service.settings.max_age
    if seconds > limit:
        raise Stale(f"vehicle {vehicle.state.system} last reported MISSION_CURRENT {seconds:.1f} s ago")
    return {**call.answer("success"), "info": info, "age_s": round(seconds, 3)}


async def _body(call: Call) -> str:
    """The text of a file: the body itself, or the file of a multipart form.

    Raises:
        BadRequest: the body is empty or not text.
    """
    request = call.request
    if request.content_type == "multipart/form-data":
        _, data = await file_of(request, LARGEST)
    else:
        data = await in_time(request.read())
    if not data.strip():
        raise BadRequest(f"the body is empty; {call.path} takes a file")
    return text_of(data, "the body")
