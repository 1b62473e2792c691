"""/mission/waypoints, /fence, /rally, /start, /progress: what the autopilot itself flies, keeps and returns to."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Sequence
from typing import Any

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import BadRequest, Forbidden, Stale
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.mission import fence_items, mission_files
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_protocol import FENCE, MISSION, RALLY, Lists
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.core.shared_tasks import in_thread_if_long
from mavproxy_uavapi.core.vehicle import mission_flight
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.bodies import in_time
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.forms import file_of
from mavproxy_uavapi.http.requests import MissionFile, Read, StartMission
from mavproxy_uavapi.http.responses import Answer, success
from mavproxy_uavapi.http.route import ANY_FILE, JSON

FILE = ("text/plain", JSON, "multipart/form-data", *ANY_FILE)
SIZES = {MISSION: "mission of {} items", FENCE: "fence of {} items", RALLY: "list of {} rally points"}
LARGEST = 1024 * 1024  # bytes of a mission file


async def upload(call: Call) -> Answer:
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
    return await _upload(call, vehicle, body, lists)


async def upload_fence(call: Call) -> Answer:
    """Replace the fence that the autopilot keeps, by GeoJSON, KML or a .plan file, and read it back."""
    vehicle = call.vehicle
    body = await _body(call)
    fence = await asyncio.to_thread(formats.read, body, "the fence")
    return await _upload(call, vehicle, body, {FENCE: fence_items.items_of(fence)})


async def upload_rally(call: Call) -> Answer:
    """Replace the places that the autopilot may return to instead of home, and read them back."""
    vehicle = call.vehicle
    body = await _body(call)
    return await _upload(call, vehicle, body, {RALLY: await asyncio.to_thread(mission_files.rally_of, body)})


async def _upload(call: Call, vehicle: Vehicle, body: str, lists: Lists) -> Answer:
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
    result = f"{words[0].upper()}{words[1:]} uploaded"
    # A client that hangs up must not leave half a mission behind.
    return await call.fly(vehicle, verb, result, outlives_client=True, identity=identity)


def _note_fence(call: Call, vehicle: Vehicle, items: Sequence[MissionItem]) -> None:
    call.service.host.note_fence(vehicle.state.system, _fence_messages(vehicle, items))


def _fence_messages(vehicle: Vehicle, items: Sequence[MissionItem]) -> list[Any]:
    return [item.to(vehicle.address, seq, FENCE) for seq, item in enumerate(items)]


async def download(call: Call) -> Answer:
    """The vehicle's mission, freshly read from it: `home`, and `items` from number 1 on."""
    vehicle = call.vehicle
    home, items = await vehicle.waypoints.read()

    def response() -> Answer:
        reports = [item.report(number) for number, item in enumerate(items, 1)]
        return success(call.answer("Success", home=None if home is None else home.report(0), items=reports))

    return await in_thread_if_long(len(items), response)


async def fence(call: Call) -> Answer:
    """The areas of the autopilot's fence, freshly read from it; its cylinder is in the parameters FENCE_*."""
    vehicle = call.vehicle
    items, system = await vehicle.waypoints.read_list(FENCE), vehicle.state.system
    if not items:
        return call.answer("Success", fence=formats.EMPTY)
    messages, source = _fence_messages(vehicle, items), f"the fence of vehicle {system}"
    areas = formats.of_fence(messages, source, lambda: call.service.host.home_of(system))
    return call.answer("Success", fence=formats.geojson(areas))


async def rally(call: Call) -> Answer:
    """The places that the autopilot may return to instead of home, freshly read from it."""
    items = await call.vehicle.waypoints.read_list(RALLY)
    members = ("seq", "frame", "lat", "long", "alt")
    reports = [item.report(number) for number, item in enumerate(items, 1)]
    return call.answer("Success", points=[{name: report[name] for name in members} for report in reports])


async def clear(call: Call) -> Answer:
    """Remove the vehicle's mission."""
    return await _clear(call, MISSION, "Mission cleared")


async def clear_fence(call: Call) -> Answer:
    """Remove the fence that the autopilot keeps; its cylinder, in the parameters FENCE_*, stays."""
    return await _clear(call, FENCE, "Fence cleared")


async def clear_rally(call: Call) -> Answer:
    """Remove the rally points: the vehicle returns to home."""
    return await _clear(call, RALLY, "Rally points cleared")


async def _clear(call: Call, kind: int, result: str) -> Answer:
    vehicle = call.vehicle

    async def verb(_job: Job) -> None:
        await vehicle.waypoints.clear(kind)
        if kind == FENCE:
            _note_fence(call, vehicle, ())

    return await call.fly(vehicle, verb, result, outlives_client=True)


async def start(call: Call) -> Answer:
    """Fly the mission from its first item, in AUTO; needs an armed vehicle in GUIDED or AUTO."""
    vehicle, p = call.vehicle, call.params(StartMission)
    result = "Mission complete" if p.until_complete else "Mission started"
    return await call.fly(vehicle, lambda job: mission_flight.fly(vehicle, job, p.until_complete, p.timeout), result)


async def progress(call: Call) -> Answer:
    """The current item, the number of items, the item reached last, and the distance (m) to the current one."""
    vehicle = call.known_vehicle
    info = mission_flight.progress(vehicle)
    age = vehicle.state.newest("MISSION_CURRENT")
    assert age is not None
    seconds = max(vehicle.clock() - age.at, 0.0)
    limit = call.params(Read).max_age or call.service.settings.max_age
    if seconds > limit:
        raise Stale(f"vehicle {vehicle.state.system} last reported MISSION_CURRENT {seconds:.1f} s ago")
    return call.answer("Success", info=info, age_s=round(seconds, 3))


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
