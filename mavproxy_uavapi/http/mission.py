"""/mission/waypoints, /mission/start, /mission/progress: the mission that the autopilot itself flies; its fence."""

from __future__ import annotations

import asyncio
import hashlib

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import BadRequest, Busy, Stale
from mavproxy_uavapi.core.mission import mission_files
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission
from mavproxy_uavapi.core.vehicle import mission_flight
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.bodies import in_time
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.forms import file_of
from mavproxy_uavapi.http.requests import MissionFile, Read, StartMission
from mavproxy_uavapi.http.responses import Answer

LARGEST = 1024 * 1024  # bytes of a mission file


async def upload(call: Call) -> Answer:
    """Replace the vehicle's mission and read it back; on failure the old mission stays, or the error says why not."""
    vehicle = call.vehicle
    body = await _body(call)
    items = await asyncio.to_thread(mission_files.read, body)
    identity = MissionFile(digest=hashlib.sha256(body.encode()).hexdigest(), items=len(items))

    async def verb(job: Job) -> None:
        _require_no_flown_mission(vehicle)

        def report_progress(done: int, of: int) -> None:
            job.progress = {"item": done, "items": of}

        await vehicle.waypoints.upload(items, report_progress, check=lambda: _require_no_flown_mission(vehicle))

    # A client that hangs up must not leave half a mission behind.
    result = f"Mission of {len(items)} items uploaded"
    return await call.fly(vehicle, verb, result, outlives_client=True, identity=identity)


async def download(call: Call) -> Answer:
    """The vehicle's mission, freshly read from it: `home`, and `items` from number 1 on."""
    vehicle = call.vehicle
    home, items = await vehicle.waypoints.read()
    members = {
        "home": None if home is None else home.report(0),
        "items": [i.report(n) for n, i in enumerate(items, 1)],
    }
    return call.answer("Success", **members)


async def fence(call: Call) -> Answer:
    """The areas of the autopilot's fence, freshly read from it; its cylinder is in the parameters FENCE_*."""
    vehicle = call.vehicle
    items, system = await vehicle.waypoints.read_fence(), vehicle.state.system
    if not items:
        return call.answer("Success", fence=formats.EMPTY)
    areas = formats.of_fence(items, f"the fence of vehicle {system}", lambda: call.service.host.home_of(system))
    return call.answer("Success", fence=formats.geojson(areas))


async def clear(call: Call) -> Answer:
    """Remove the vehicle's mission."""
    vehicle = call.vehicle

    async def verb(_job: Job) -> None:
        _require_no_flown_mission(vehicle)
        await vehicle.waypoints.clear(check=lambda: _require_no_flown_mission(vehicle))

    return await call.fly(vehicle, verb, "Mission cleared", outlives_client=True)


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


def _require_no_flown_mission(vehicle: Vehicle) -> None:
    """Raise Busy while the vehicle flies the mission that would be changed."""
    if vehicle.state.armed and (flies_mission(vehicle.mode) or flies_mission(vehicle.next_mode)):
        raise Busy("the vehicle flies its mission; /command/guided or /command/brake first")


async def _body(call: Call) -> str:
    """The mission's text: the body itself, or the file of a multipart form.

    Raises:
        BadRequest: the body is empty or not UTF-8 text.
    """
    request = call.request
    if request.content_type == "multipart/form-data":
        _, data = await file_of(request, LARGEST)
    else:
        data = await in_time(request.read())
    if not data.strip():
        raise BadRequest("the body is the mission: a QGC WPL 110 file, a .plan file, or JSON items")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadRequest(f"the mission is not UTF-8 text: {error}") from error
