"""The table of all paths."""

from __future__ import annotations

import functools
import json
import weakref
from dataclasses import replace
from typing import Annotated, Any

from aiohttp import web
from typing_extensions import TypedDict

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract import requests
from mavproxy_uavapi.http.contract.answers import means
from mavproxy_uavapi.http.contract.requests import Empty, Request
from mavproxy_uavapi.http.contract.route import (
    ADMIN,
    BINARY,
    DELETE,
    EITHER,
    EVENTS,
    FLY,
    JPEG,
    JSON,
    OBJECT,
    OF_A_COMMAND,
    OF_A_VEHICLE,
    POST,
    PUT,
    TEXT,
    WATCH,
    Action,
    Route,
)
from mavproxy_uavapi.http.handlers import (
    audit,
    authority,
    command,
    docs_page,
    envelope,
    flights,
    jobs,
    logs,
    manual,
    message,
    mission,
    movement,
    page,
    parameters,
    peripherical,
    rehearsals,
    scripts,
    settings,
    static_files,
    stream,
    telemetry,
    tiles,
    vehicles,
)
from mavproxy_uavapi.http.handlers.fleet import fleet_routes
from mavproxy_uavapi.http.openapi import document


async def specification(call: Call) -> web.StreamResponse:
    """The description of this API, OpenAPI 3.1, including the routes of other loaded modules."""
    body = _specification(tuple(map(weakref.ref, call.service.host.extensions.values())))
    return static_files.answer(call.request, body, "application/json", {"Cache-Control": "no-cache"})


@functools.lru_cache(maxsize=1)  # it takes a tenth of a second, and any stranger may ask
def _specification(extensions: tuple[weakref.ref[Route], ...]) -> bytes:
    """The cache keeps no module that is unloaded, by its routes."""
    routes = [route for extension in extensions if (route := extension()) is not None]
    return json.dumps(document([*ROUTES, *routes]), separators=(",", ":"), allow_nan=False).encode()


class VersionView(TypedDict):
    """What answers here."""

    name: Annotated[str, means("of the product", "mavproxy-uavapi")]
    version: Annotated[str, means("of the product", __version__)]


async def version(_call: Call) -> VersionView:
    """What answers here.

    Within a major version members and paths are added; none is taken away, and none changes its meaning or its unit.
    """
    return {"name": "mavproxy-uavapi", "version": __version__}


def command_path(action: Action) -> str:
    """The path of a handler by the names of its file and function: /command/arm."""
    return f"/{action.__module__.rpartition('.')[2]}/{action.__name__}"


def verb(
    action: Action,
    model: type[Request],
    done: str,
    verb: str = "",
    *,
    path: str = "",
    methods: tuple[str, ...] = EITHER,
    needs: Role = FLY,
    **more: Any,
) -> Route:
    """A route whose action runs as a job; `verb` is the vehicle's method, if not every type of vehicle has it."""
    path = path or command_path(action)
    return Route(path, action, model, needs, methods, job=True, done=done, verb=verb, **more)


posted = functools.partial(verb, methods=POST)
deleted = functools.partial(verb, methods=DELETE)


def watched(path: str, action: Action, model: type[Request] = Empty, **more: Any) -> Route:
    """A route that commands nothing, for all who may watch."""
    return Route(path, action, model, WATCH, **more)


def reported(action: Action, message: str = "") -> Route:
    """A route of telemetry; `message` is the MAVLink message that it shows, if it shows one and nothing else."""
    return watched(command_path(action), action, requests.Read, message=message)


def group(errors: tuple[type[UavApiError], ...], *routes: Route, of_vehicle: bool = True) -> list[Route]:
    """Routes whose actions raise these errors."""
    return [replace(route, errors=errors, of_vehicle=of_vehicle) for route in routes]


BRAKES = "Copter braking. Use /command/guided to enable movement commands again"
COMMAND = [
    verb(command.arm, requests.Blocking, "Armed vehicle"),
    verb(command.disarm, requests.Disarm, "Disarmed vehicle", stops=True),
    verb(command.takeoff, requests.Takeoff, "Takeoff successful! Vehicle at 10 meters", "takeoff"),
    verb(command.land, requests.Blocking, "Landed at home successfully", "land", stops=True),
    verb(
        command.land_at,
        requests.LandAt,
        "Landing mission started for coord (-35.3629, 149.1652)",
        "land_at",
        stops=True,
    ),
    verb(command.rtl, requests.Blocking, "Landed at home successfully", "rtl", stops=True),
    verb(command.brake, Empty, BRAKES, "brake", stops=True, holds=True),
    verb(command.guided, Empty, "Copter in GUIDED mode"),
    verb(command.set_mode, requests.ModeName, "Mode LOITER"),
    verb(command.set_reverse, requests.Reverse, "Driving backwards", "set_reverse"),
    verb(command.set_air_speed, requests.NewSpeed, "Air speed set to 5m/s"),
    verb(command.set_ground_speed, requests.NewSpeed, "Ground speed set to 5m/s"),
    verb(command.set_climb_speed, requests.NewSpeed, "Climb speed set to 5m/s"),
    verb(command.set_descent_speed, requests.NewSpeed, "Descent speed set to 5m/s"),
    verb(command.set_sim_speedup, requests.SimFactor, "Simulation speedup set to 5x", needs=ADMIN),
    verb(command.reboot, Empty, "The autopilot has booted", needs=ADMIN),
    verb(command.set_home, Empty, "Home location set successfully!"),
]

MOVEMENT = [
    posted(movement.go_to_gps, requests.GpsTarget, "Going to coord (-35.3629, 149.1652, 20)", "go_to"),
    posted(movement.go_to_gps_wait, requests.GpsTarget, "Arrived at coord (-35.3629, 149.1652, 20)", "go_to"),
    posted(movement.go_to_ned, requests.NedPlace, "Going to NED coord (20, 10, -12)", "go_to"),
    posted(movement.go_to_ned_wait, requests.NedPlace, "Arrived at NED coord (20, 10, -12)", "go_to"),
    posted(movement.drive, requests.NedPlace, "Copter is driving", "go_to"),
    posted(movement.drive_wait, requests.NedPlace, "Copter arrived at (20, 10, -12)", "go_to"),
    posted(movement.drive_body, requests.BodyOffset, "Copter is driving", "go_to"),
    posted(movement.drive_body_wait, requests.BodyOffset, "Copter arrived at (5, 0, 0)", "go_to"),
    posted(movement.travel_at_ned, requests.NedVelocity, "Travelling at NED velocity (1, 0, 0)", "travel"),
    posted(movement.travel_at_body, requests.BodyVelocity, "Travelling at body velocity (1, 0, 0)", "travel"),
    verb(movement.set_heading, requests.Heading, "Heading set to 90 degrees", "set_heading"),
    verb(movement.set_yaw_rate, requests.YawRate, "Yaw rate set to 10 deg/s", "set_yaw_rate"),
    verb(movement.stop, Empty, "Copter has stopped", "stop", stops=True, holds=True),
    verb(movement.resume, Empty, "Copter has resumed", "resume"),
]

TELEMETRY = group(
    (*OF_A_VEHICLE, errors.Stale, errors.NotFound),
    reported(telemetry.general, "VFR_HUD"),
    reported(telemetry.gps, "GLOBAL_POSITION_INT"),
    reported(telemetry.gps_raw, "GPS_RAW_INT"),
    reported(telemetry.ned, "LOCAL_POSITION_NED"),
    reported(telemetry.compass),
    reported(telemetry.sys_status, "SYS_STATUS"),
    reported(telemetry.sensor_status, "SYS_STATUS"),
    reported(telemetry.battery_info, "SYS_STATUS"),
    reported(telemetry.error_info, "SYS_STATUS"),
    reported(telemetry.home_info),
    reported(telemetry.attitude, "ATTITUDE"),
    reported(telemetry.status),
    watched("/telemetry/messages", telemetry.messages),
    watched("/telemetry/message/{name}", telemetry.message, requests.Read, names={"name": "ATTITUDE"}),
    watched("/telemetry/stream", stream.stream, requests.StreamFilter, content={EVENTS: TEXT}),
)

JOB = {"id": "7"}
JOBS = group(
    (errors.NotFound, errors.Busy),
    watched("/jobs", jobs.list_jobs),
    watched("/jobs/{id}", jobs.show_job, names=JOB),
    Route("/jobs/{id}", jobs.abort_job, Empty, FLY, DELETE, stops=True, names=JOB),
)

AUDIT = group((errors.NotFound,), watched("/audit", audit.show, audit.AuditFilter))

FLIGHT = {"id": "20260504-132007-survey-3"}
FLIGHTS = group(
    (errors.NotFound, errors.Busy, errors.ToolFailed, errors.TimedOut),
    watched("/flights", flights.list_flights),
    Route("/flights", flights.begin_flight, flights.NewFlight, FLY, POST),
    watched("/flights/{id}.mcap", flights.read_flight, names=FLIGHT, content={flights.FILE: BINARY}),
    watched(
        "/flights/{id}.zip",
        flights.export_flight,
        flights.ExportOptions,
        names=FLIGHT,
        content={flights.FILE: BINARY},
    ),
    watched("/flights/{id}/overview", flights.overview_flight, names=FLIGHT, content={JSON: OBJECT}),
    watched("/flights/{id}/events", flights.play_flight, flights.Span, names=FLIGHT, content={JSON: OBJECT}),
    watched("/flights/{id}/compare", flights.compare_flight, flights.Other, names=FLIGHT),
    Route("/flights/{id}/end", flights.end_flight, Empty, FLY, POST, names=FLIGHT),
    watched("/flights/{id}", flights.show_flight, names=FLIGHT),
    Route("/flights/{id}", flights.remove_flight, Empty, ADMIN, DELETE, names=FLIGHT),
    of_vehicle=False,
)

SCRIPT = {"name": "square.py"}
LOG = {"text/plain": TEXT, EVENTS: TEXT}
SCRIPTS = group(
    (errors.BadRequest, errors.NotFound, errors.ToolFailed, errors.ToolMissing),
    Route("/mission/upload-script", scripts.upload_script, Empty, ADMIN, POST, raw=scripts.FILE),
    Route("/mission/list-scripts", scripts.list_scripts, Empty, ADMIN),
    Route("/mission/running-scripts", scripts.running_scripts, Empty, ADMIN),
    Route("/mission/stop-script", scripts.stop_script, requests.ScriptName, ADMIN, POST),
    Route("/mission/clear-scripts", scripts.clear_scripts, Empty, ADMIN, DELETE),
    Route("/mission/clear", scripts.clear_scripts, Empty, ADMIN, DELETE),
    Route("/mission/scripts/{name}", scripts.show_script, Empty, ADMIN, names=SCRIPT),
    Route("/mission/scripts/{name}/log", scripts.script_log, requests.ScriptLog, ADMIN, names=SCRIPT, content=LOG),
    of_vehicle=False,
) + group(
    (errors.BadRequest, errors.NotFound, errors.ToolFailed, errors.ToolMissing, errors.NotRehearsed),
    Route("/mission/execute-script", scripts.execute_script, requests.ExecuteScript, ADMIN, POST),
)

REHEARSALS = group(
    (*OF_A_COMMAND, errors.BadRequest, errors.NotFound, errors.ToolFailed, errors.ToolMissing, errors.Forbidden),
    Route("/rehearsals", rehearsals.rehearse, requests.Rehearse, FLY, POST),
    Route("/rehearsals", rehearsals.show, requests.ShowRehearsals, FLY),
    Route("/rehearsals", rehearsals.end, Empty, FLY, DELETE),
)

WAYPOINTS, FENCE, RALLY = "/mission/waypoints", "/mission/fence", "/mission/rally"
MISSION = [
    *group(
        (*OF_A_COMMAND, errors.BadRequest, errors.Aborted, errors.OutsideEnvelope),
        posted(mission.upload, Empty, "Mission of 3 items uploaded", path=WAYPOINTS, raw=mission.MISSION_FILE),
        Route(WAYPOINTS, mission.download, Empty, FLY),
        deleted(mission.clear, Empty, "Mission cleared", path=WAYPOINTS),
        posted(
            mission.upload_fence, Empty, "Fence of 1 items uploaded", path=FENCE, needs=ADMIN, raw=mission.FENCE_FILE
        ),
        Route(FENCE, mission.fence, Empty, FLY),
        deleted(mission.clear_fence, Empty, "Fence cleared", path=FENCE, needs=ADMIN),
        posted(mission.upload_rally, Empty, "List of 1 rally points uploaded", path=RALLY, raw=mission.RALLY_FILE),
        Route(RALLY, mission.rally, Empty, FLY),
        deleted(mission.clear_rally, Empty, "Rally points cleared", path=RALLY),
    ),
    posted(mission.start, requests.StartMission, "Mission started"),
    *group((errors.NoVehicle, errors.Stale), watched("/mission/progress", mission.progress, requests.Read)),
]

PERIPHERICAL = group(
    (*OF_A_COMMAND, errors.BadRequest, errors.ToolFailed, errors.ToolMissing),
    Route("/peripherical/take_photo", peripherical.take_photo, requests.Photo, FLY, content=JPEG),
    posted(peripherical.servo_output, requests.Servo, "Servo 9 set to 1500 PWM"),
)

FLEET = fleet_routes([*COMMAND, *MOVEMENT])

PARAMETER = {"name": "WPNAV_SPEED"}
PARAMETERS = group(
    (*OF_A_VEHICLE, errors.NotFound, errors.TimedOut, errors.OutsideEnvelope),
    watched("/parameters", parameters.list_parameters, parameters.DescribedParameters),
    watched("/parameters.param", parameters.parameter_file, parameters.ParameterFilter, content={"text/plain": TEXT}),
    Route(
        "/parameters",
        parameters.load_parameters,
        parameters.Restore,
        ADMIN,
        POST,
        raw=parameters.FILE,
        partly=True,
        done="1 of 1 parameters are set",
    ),
    Route("/parameters/{name}", parameters.show_parameter, Empty, FLY, names=PARAMETER),
    Route(
        "/parameters/{name}",
        parameters.set_parameter,
        parameters.NewValue,
        ADMIN,
        PUT,
        names=PARAMETER,
        done="WPNAV_SPEED is 500",
    ),
)

OF_A_LOG = {"id": "3"}
LOGS = group(
    (*OF_A_COMMAND, errors.NotFound, errors.Stale, errors.Aborted, errors.ToolFailed),
    watched("/logs", logs.list_logs, logs.LogRequest),
    watched("/logs/{id}", logs.read_log, names=OF_A_LOG, content={"application/octet-stream": BINARY}),
    posted(logs.download_log, logs.LogRequest, "Log 3 downloaded", path="/logs/{id}/download", names=OF_A_LOG),
)

ENVELOPE = group(
    (errors.NotFound, errors.BadRequest),
    watched("/envelope", envelope.show),
    Route("/envelope", envelope.put, requests.PutEnvelope, ADMIN, PUT, raw=envelope.FILE),
    Route("/envelope", envelope.remove, Empty, ADMIN, DELETE),
) + group(
    (*OF_A_COMMAND, errors.OutsideEnvelope, errors.TooNear, errors.Stale),
    Route("/envelope/check", envelope.check, requests.GpsPlace, FLY, verb="go_to", done="Allowed"),
)

SETTINGS = group(
    (errors.NotFound, errors.TimedOut),
    watched("/settings", settings.show),
    Route("/settings/{name}", settings.put, settings.NewSetting, ADMIN, PUT, names={"name": "max_age"}),
    of_vehicle=False,
)

MESSAGE = [posted(message.send_message, message.RawMessage, "STATUSTEXT sent", path="/message", needs=ADMIN)]

AUTHORITY = group(
    (errors.NoVehicle, errors.Busy),
    watched("/authority", authority.show),
    Route("/authority/take", authority.take, authority.Take, FLY, POST, done="anna holds vehicle 1"),
    Route("/authority/release", authority.release, authority.Release, FLY, POST, done="Vehicle 1 is released"),
)

VEHICLES = group(
    (errors.NotFound,),
    watched("/vehicles", vehicles.list_vehicles),
    watched("/vehicles/{sysid}", vehicles.show_vehicle, names={"sysid": "1"}),
    of_vehicle=False,
)

ASSETS = {"text/css": TEXT, "text/javascript": TEXT, "image/png": BINARY}
DOCS = group(
    (errors.NotFound,),
    watched("/version", version),
    watched("/openapi.json", specification, content={JSON: OBJECT}),
    watched("/docs", docs_page.page, content={"text/html": TEXT}),
    watched("/docs/{file}", docs_page.asset, names={"file": "swagger-ui.css"}, content=ASSETS),
    of_vehicle=False,
)

PAGE = [
    watched("/", page.index),
    watched("/page/{file}", page.asset),
    watched("/page/{room}/{file}", page.asset),
    watched("/manual", manual.page),
    watched("/manual/{file}", manual.asset, manual.ReadByTheSite),
    watched("/manual/{room}/{file}", manual.asset, manual.ReadByTheSite),
    watched("/manual/{room}/{inner}/{file}", manual.asset, manual.ReadByTheSite),
    watched("/tiles", tiles.show),
    watched("/tiles/{z}/{x}/{y}", tiles.tile),
    Route("/tiles/{z}/{x}/{y}", tiles.keep, Empty, ADMIN, PUT, raw=tiles.PICTURES, audited=False, of_vehicle=False),
]

ROUTES = [
    *(*COMMAND, *MOVEMENT, *TELEMETRY, *JOBS, *AUDIT, *FLIGHTS, *SCRIPTS, *REHEARSALS, *MISSION, *PERIPHERICAL),
    *(*PARAMETERS, *LOGS, *ENVELOPE, *SETTINGS, *MESSAGE, *AUTHORITY, *VEHICLES, *FLEET, *DOCS),
]
