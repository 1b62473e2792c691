"""The table of all paths."""

from __future__ import annotations

import functools
import weakref

from aiohttp import web

from mavproxy_uavapi.http import (
    audit,
    authority,
    command,
    docs_page,
    envelope,
    jobs,
    logs,
    message,
    mission,
    movement,
    page,
    parameters,
    peripherical,
    photo,
    requests,
    scripts,
    settings,
    static_files,
    stream,
    telemetry,
    tiles,
    vehicles,
)
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.fleet import fleet_routes
from mavproxy_uavapi.http.openapi import document
from mavproxy_uavapi.http.responses import dumps
from mavproxy_uavapi.http.route import ADMIN, EITHER, FLY, POST, WATCH, Route


async def specification(call: Call) -> web.StreamResponse:
    """The description of this API, OpenAPI 3.1, including the routes of other loaded modules."""
    body = _specification(tuple(map(weakref.ref, call.service.host.extensions.values())))
    return static_files.answer(call.request, body, "application/json", {"Cache-Control": "no-cache"})


@functools.lru_cache(maxsize=1)  # it takes a tenth of a second, and any stranger may ask
def _specification(extensions: tuple[weakref.ref[Route], ...]) -> bytes:
    """The cache keeps no module that is unloaded, by its routes."""
    routes = [route for extension in extensions if (route := extension()) is not None]
    return dumps(document([*ROUTES, *routes])).encode()


COMMAND = [
    Route("/command/arm", command.arm, requests.Blocking, FLY, EITHER, job=True),
    Route("/command/disarm", command.disarm, requests.Disarm, FLY, EITHER, job=True, stops=True),
    Route("/command/takeoff", command.takeoff, requests.Takeoff, FLY, EITHER, job=True, verb="takeoff"),
    Route("/command/land", command.land, requests.Blocking, FLY, EITHER, job=True, verb="land", stops=True),
    Route("/command/land_at", command.land_at, requests.LandAt, FLY, EITHER, job=True, verb="land_at", stops=True),
    Route("/command/rtl", command.rtl, requests.Blocking, FLY, EITHER, job=True, verb="rtl", stops=True),
    Route(
        "/command/brake", command.brake, requests.Empty, FLY, EITHER, job=True, verb="brake", stops=True, holds=True
    ),
    Route("/command/guided", command.guided, requests.Empty, FLY, EITHER, job=True),
    Route("/command/set_mode", command.set_mode, requests.ModeName, FLY, EITHER, job=True),
    Route("/command/set_reverse", command.set_reverse, requests.Reverse, FLY, EITHER, job=True, verb="set_reverse"),
    Route("/command/set_air_speed", command.set_air_speed, requests.NewSpeed, FLY, EITHER, job=True),
    Route("/command/set_ground_speed", command.set_ground_speed, requests.NewSpeed, FLY, EITHER, job=True),
    Route("/command/set_climb_speed", command.set_climb_speed, requests.NewSpeed, FLY, EITHER, job=True),
    Route("/command/set_descent_speed", command.set_descent_speed, requests.NewSpeed, FLY, EITHER, job=True),
    Route("/command/set_sim_speedup", command.set_sim_speedup, requests.SimFactor, ADMIN, EITHER, job=True),
    Route("/command/reboot", command.reboot, requests.Empty, ADMIN, EITHER, job=True),
    Route("/command/set_home", command.set_home, requests.Empty, FLY, EITHER, job=True),
]

MOVEMENT = [
    Route("/movement/go_to_gps", movement.go_to_gps, requests.GpsTarget, FLY, POST, job=True, verb="go_to"),
    Route("/movement/go_to_gps_wait", movement.go_to_gps_wait, requests.GpsTarget, FLY, POST, job=True, verb="go_to"),
    Route("/movement/go_to_ned", movement.go_to_ned, requests.NedPlace, FLY, POST, job=True, verb="go_to"),
    Route("/movement/go_to_ned_wait", movement.go_to_ned_wait, requests.NedPlace, FLY, POST, job=True, verb="go_to"),
    Route("/movement/drive", movement.drive, requests.NedPlace, FLY, POST, job=True, verb="go_to"),
    Route("/movement/drive_wait", movement.drive_wait, requests.NedPlace, FLY, POST, job=True, verb="go_to"),
    Route("/movement/drive_body", movement.drive_body, requests.BodyOffset, FLY, POST, job=True, verb="go_to"),
    Route(
        "/movement/drive_body_wait", movement.drive_body_wait, requests.BodyOffset, FLY, POST, job=True, verb="go_to"
    ),
    Route(
        "/movement/travel_at_ned", movement.travel_at_ned, requests.NedVelocity, FLY, POST, job=True, verb="travel"
    ),
    Route(
        "/movement/travel_at_body", movement.travel_at_body, requests.BodyVelocity, FLY, POST, job=True, verb="travel"
    ),
    Route("/movement/set_heading", movement.set_heading, requests.Heading, FLY, EITHER, job=True, verb="set_heading"),
    Route(
        "/movement/set_yaw_rate", movement.set_yaw_rate, requests.YawRate, FLY, EITHER, job=True, verb="set_yaw_rate"
    ),
    Route(
        "/movement/stop", movement.stop, requests.Empty, FLY, EITHER, job=True, verb="stop", stops=True, holds=True
    ),
    Route("/movement/resume", movement.resume, requests.Empty, FLY, EITHER, job=True, verb="resume"),
]

TELEMETRY = [
    Route("/telemetry/general", telemetry.general, requests.Read, WATCH, message="VFR_HUD"),
    Route("/telemetry/gps", telemetry.gps, requests.Read, WATCH, message="GLOBAL_POSITION_INT"),
    Route("/telemetry/gps_raw", telemetry.gps_raw, requests.Read, WATCH, message="GPS_RAW_INT"),
    Route("/telemetry/ned", telemetry.ned, requests.Read, WATCH, message="LOCAL_POSITION_NED"),
    Route("/telemetry/compass", telemetry.compass, requests.Read, WATCH),
    Route("/telemetry/sys_status", telemetry.sys_status, requests.Read, WATCH, message="SYS_STATUS"),
    Route("/telemetry/sensor_status", telemetry.sensor_status, requests.Read, WATCH, message="SYS_STATUS"),
    Route("/telemetry/battery_info", telemetry.battery_info, requests.Read, WATCH, message="SYS_STATUS"),
    Route("/telemetry/error_info", telemetry.error_info, requests.Read, WATCH, message="SYS_STATUS"),
    Route("/telemetry/home_info", telemetry.home_info, requests.Read, WATCH),
    Route("/telemetry/attitude", telemetry.attitude, requests.Read, WATCH, message="ATTITUDE"),
    Route("/telemetry/status", telemetry.status, requests.Read, WATCH),
    Route("/telemetry/message/{name}", telemetry.message, requests.Read, WATCH),
    Route("/telemetry/stream", stream.stream, requests.StreamFilter, WATCH),
]

JOBS = [
    Route("/jobs", jobs.list_jobs, requests.Empty, WATCH),
    Route("/jobs/{id}", jobs.show_job, requests.Empty, WATCH),
    Route("/jobs/{id}", jobs.abort_job, requests.Empty, FLY, ("DELETE",), stops=True),
]

AUDIT = [Route("/audit", audit.show, audit.AuditFilter, WATCH)]

MISSION = [
    Route("/mission/upload-script", scripts.upload_script, requests.Empty, ADMIN, POST, raw=scripts.FILE),
    Route("/mission/list-scripts", scripts.list_scripts, requests.Empty, ADMIN),
    Route("/mission/execute-script", scripts.execute_script, requests.ExecuteScript, ADMIN, POST),
    Route("/mission/running-scripts", scripts.running_scripts, requests.Empty, ADMIN),
    Route("/mission/stop-script", scripts.stop_script, requests.ScriptName, ADMIN, POST),
    Route("/mission/clear-scripts", scripts.clear_scripts, requests.Empty, ADMIN, ("DELETE",)),
    Route("/mission/clear", scripts.clear_scripts, requests.Empty, ADMIN, ("DELETE",)),
    Route("/mission/scripts/{name}", scripts.show_script, requests.Empty, ADMIN),
    Route("/mission/scripts/{name}/log", scripts.script_log, requests.ScriptLog, ADMIN),
    Route("/mission/waypoints", mission.upload, requests.Empty, FLY, POST, raw=mission.FILE, job=True),
    Route("/mission/waypoints", mission.download, requests.Empty, FLY),
    Route("/mission/waypoints", mission.clear, requests.Empty, FLY, ("DELETE",), job=True),
    Route("/mission/fence", mission.upload_fence, requests.Empty, ADMIN, POST, raw=mission.FILE, job=True),
    Route("/mission/fence", mission.fence, requests.Empty, FLY),
    Route("/mission/fence", mission.clear_fence, requests.Empty, ADMIN, ("DELETE",), job=True),
    Route("/mission/rally", mission.upload_rally, requests.Empty, FLY, POST, raw=mission.FILE, job=True),
    Route("/mission/rally", mission.rally, requests.Empty, FLY),
    Route("/mission/rally", mission.clear_rally, requests.Empty, FLY, ("DELETE",), job=True),
    Route("/mission/start", mission.start, requests.StartMission, FLY, POST, job=True),
    Route("/mission/progress", mission.progress, requests.Read, WATCH),
]

PERIPHERICAL = [
    Route("/peripherical/take_photo", photo.take_photo, requests.Photo, FLY),
    Route("/peripherical/servo_output", peripherical.servo_output, requests.Servo, FLY, POST, job=True),
]

FLEET = fleet_routes([*COMMAND, *MOVEMENT])

PARAMETERS = [
    Route("/parameters", parameters.list_parameters, parameters.ParameterFilter, WATCH),
    Route("/parameters.param", parameters.parameter_file, parameters.ParameterFilter, WATCH),
    Route("/parameters", parameters.load_parameters, parameters.Restore, ADMIN, POST, raw=parameters.FILE),
    Route("/parameters/{name}", parameters.show_parameter, requests.Empty, FLY),
    Route("/parameters/{name}", parameters.set_parameter, parameters.NewValue, ADMIN, ("PUT",)),
]

LOGS = [
    Route("/logs", logs.list_logs, logs.LogRequest, WATCH),
    Route("/logs/{id}", logs.read_log, requests.Empty, WATCH),
    Route("/logs/{id}/download", logs.download_log, logs.LogRequest, FLY, POST, job=True),
]

ENVELOPE = [
    Route("/envelope", envelope.show, requests.Empty, WATCH),
    Route("/envelope", envelope.put, requests.PutEnvelope, ADMIN, ("PUT",), raw=envelope.FILE),
    Route("/envelope", envelope.remove, requests.Empty, ADMIN, ("DELETE",)),
]

SETTINGS = [
    Route("/settings", settings.show, requests.Empty, WATCH),
    Route("/settings/{name}", settings.put, settings.NewSetting, ADMIN, ("PUT",)),
]

MESSAGE = [Route("/message", message.send_message, message.RawMessage, ADMIN, POST, job=True)]

AUTHORITY = [
    Route("/authority", authority.show, requests.Empty, WATCH),
    Route("/authority/take", authority.take, authority.Take, FLY, POST),
    Route("/authority/release", authority.release, authority.Release, FLY, POST),
]

VEHICLES = [
    Route("/vehicles", vehicles.list_vehicles, requests.Empty, WATCH),
    Route("/vehicles/{sysid}", vehicles.show_vehicle, requests.Empty, WATCH),
]

DOCS = [
    Route("/openapi.json", specification, requests.Empty, WATCH),
    Route("/docs", docs_page.page, requests.Empty, WATCH),
    Route("/docs/{file}", docs_page.asset, requests.Empty, WATCH),
]

PAGE = [  # no part of the API, and not described
    Route("/", page.index, requests.Empty, WATCH),
    Route("/page/{file}", page.asset, requests.Empty, WATCH),
    Route("/tiles", tiles.show, requests.Empty, WATCH),
    Route("/tiles/{z}/{x}/{y}", tiles.tile, requests.Empty, WATCH),
]

ROUTES = [
    *COMMAND,
    *MOVEMENT,
    *TELEMETRY,
    *JOBS,
    *AUDIT,
    *MISSION,
    *PERIPHERICAL,
    *PARAMETERS,
    *LOGS,
    *ENVELOPE,
    *SETTINGS,
    *MESSAGE,
    *AUTHORITY,
    *VEHICLES,
    *FLEET,
    *DOCS,
]
