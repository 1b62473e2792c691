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
from mavproxy_uavapi.http.contract.requests import Request
from mavproxy_uavapi.http.contract.route import (
    ADMIN,
    BINARY,
    EITHER,
    EVENTS,
    FLY,
    JPEG,
    JSON,
    OF_A_COMMAND,
    OF_A_VEHICLE,
    POST,
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
    message,
    mission,
    movement,
    page,
    parameters,
    peripherical,
    photo,
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


def verb(
    path: str,
    action: Action,
    model: type[Request],
    done: str,
    verb: str = "",
    *,
    methods: tuple[str, ...] = EITHER,
    needs: Role = FLY,
    **more: Any,
) -> Route:
    """A route whose action runs as a job; `verb` is the vehicle's method, if not every type of vehicle has it."""
    return Route(path, action, model, needs, methods, job=True, done=done, verb=verb, **more)


posted = functools.partial(verb, methods=POST)


def group(errors: tuple[type[UavApiError], ...], *routes: Route, of_vehicle: bool = True) -> list[Route]:
    """Routes whose actions raise these errors."""
    return [replace(route, errors=errors, of_vehicle=of_vehicle) for route in routes]


COMMAND = [
    verb("/command/arm", command.arm, requests.Blocking, "Armed vehicle"),
    verb("/command/disarm", command.disarm, requests.Disarm, "Disarmed vehicle", stops=True),
    verb(
        "/command/takeoff", command.takeoff, requests.Takeoff, "Takeoff successful! Vehicle at 10 meters", "takeoff"
    ),
    verb("/command/land", command.land, requests.Blocking, "Landed at home successfully", "land", stops=True),
    verb(
        "/command/land_at",
        command.land_at,
        requests.LandAt,
        "Landing mission started for coord (-35.3629, 149.1652)",
        "land_at",
        stops=True,
    ),
    verb("/command/rtl", command.rtl, requests.Blocking, "Landed at home successfully", "rtl", stops=True),
    verb(
        "/command/brake",
        command.brake,
        requests.Empty,
        "Copter braking. Use /command/guided to enable movement commands again",
        "brake",
        stops=True,
        holds=True,
    ),
    verb("/command/guided", command.guided, requests.Empty, "Copter in GUIDED mode"),
    verb("/command/set_mode", command.set_mode, requests.ModeName, "Mode LOITER"),
    verb("/command/set_reverse", command.set_reverse, requests.Reverse, "Driving backwards", "set_reverse"),
    verb("/command/set_air_speed", command.set_air_speed, requests.NewSpeed, "Air speed set to 5m/s"),
    verb("/command/set_ground_speed", command.set_ground_speed, requests.NewSpeed, "Ground speed set to 5m/s"),
    verb("/command/set_climb_speed", command.set_climb_speed, requests.NewSpeed, "Climb speed set to 5m/s"),
    verb("/command/set_descent_speed", command.set_descent_speed, requests.NewSpeed, "Descent speed set to 5m/s"),
    verb(
        "/command/set_sim_speedup",
        command.set_sim_speedup,
        requests.SimFactor,
        "Simulation speedup set to 5x",
        needs=ADMIN,
    ),
    verb("/command/reboot", command.reboot, requests.Empty, "The autopilot has booted", needs=ADMIN),
    verb("/command/set_home", command.set_home, requests.Empty, "Home location set successfully!"),
]

MOVEMENT = [
    posted(
        "/movement/go_to_gps",
        movement.go_to_gps,
        requests.GpsTarget,
        "Going to coord (-35.3629, 149.1652, 20)",
        "go_to",
    ),
    posted(
        "/movement/go_to_gps_wait",
        movement.go_to_gps_wait,
        requests.GpsTarget,
        "Arrived at coord (-35.3629, 149.1652, 20)",
        "go_to",
    ),
    posted("/movement/go_to_ned", movement.go_to_ned, requests.NedPlace, "Going to NED coord (20, 10, -12)", "go_to"),
    posted(
        "/movement/go_to_ned_wait",
        movement.go_to_ned_wait,
        requests.NedPlace,
        "Arrived at NED coord (20, 10, -12)",
        "go_to",
    ),
    posted("/movement/drive", movement.drive, requests.NedPlace, "Copter is driving", "go_to"),
    posted(
        "/movement/drive_wait", movement.drive_wait, requests.NedPlace, "Copter arrived at (20, 10, -12)", "go_to"
    ),
    posted("/movement/drive_body", movement.drive_body, requests.BodyOffset, "Copter is driving", "go_to"),
    posted(
        "/movement/drive_body_wait",
        movement.drive_body_wait,
        requests.BodyOffset,
        "Copter arrived at (5, 0, 0)",
        "go_to",
    ),
    posted(
        "/movement/travel_at_ned",
        movement.travel_at_ned,
        requests.NedVelocity,
        "Travelling at NED velocity (1, 0, 0)",
        "travel",
    ),
    posted(
        "/movement/travel_at_body",
        movement.travel_at_body,
        requests.BodyVelocity,
        "Travelling at body velocity (1, 0, 0)",
        "travel",
    ),
    verb("/movement/set_heading", movement.set_heading, requests.Heading, "Heading set to 90 degrees", "set_heading"),
    verb(
        "/movement/set_yaw_rate", movement.set_yaw_rate, requests.YawRate, "Yaw rate set to 10 deg/s", "set_yaw_rate"
    ),
    verb("/movement/stop", movement.stop, requests.Empty, "Copter has stopped", "stop", stops=True, holds=True),
    verb("/movement/resume", movement.resume, requests.Empty, "Copter has resumed", "resume"),
]

TELEMETRY = group(
    (*OF_A_VEHICLE, errors.Stale, errors.NotFound),
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
    Route("/telemetry/message/{name}", telemetry.message, requests.Read, WATCH, names={"name": "ATTITUDE"}),
    Route("/telemetry/stream", stream.stream, requests.StreamFilter, WATCH, content={EVENTS: TEXT}),
)

JOBS = group(
    (errors.NotFound, errors.Busy),
    Route("/jobs", jobs.list_jobs, requests.Empty, WATCH),
    Route("/jobs/{id}", jobs.show_job, requests.Empty, WATCH, names={"id": "7"}),
    Route("/jobs/{id}", jobs.abort_job, requests.Empty, FLY, ("DELETE",), stops=True, names={"id": "7"}),
)

AUDIT = group((errors.NotFound,), Route("/audit", audit.show, audit.AuditFilter, WATCH))

FLIGHT = {"id": "20260504-132007-survey-3"}
FLIGHTS = group(
    (errors.NotFound, errors.Busy, errors.ToolFailed, errors.TimedOut),
    Route("/flights", flights.list_flights, requests.Empty, WATCH),
    Route("/flights", flights.begin_flight, flights.NewFlight, FLY, POST),
    Route(
        "/flights/{id}.mcap", flights.read_flight, requests.Empty, WATCH, names=FLIGHT, content={flights.MCAP: BINARY}
    ),
    Route(
        "/flights/{id}.zip",
        flights.export_flight,
        flights.ExportOptions,
        WATCH,
        names=FLIGHT,
        content={flights.ZIP: BINARY},
    ),
    Route(
        "/flights/{id}/overview",
        flights.overview_flight,
        requests.Empty,
        WATCH,
        names=FLIGHT,
        content={JSON: {"schema": {"type": "object"}}},
    ),
    Route(
        "/flights/{id}/events",
        flights.play_flight,
        flights.Span,
        WATCH,
        names=FLIGHT,
        content={JSON: {"schema": {"type": "object"}}},
    ),
    Route("/flights/{id}/compare", flights.compare_flight, flights.Other, WATCH, names=FLIGHT),
    Route("/flights/{id}/end", flights.end_flight, requests.Empty, FLY, POST, names=FLIGHT),
    Route("/flights/{id}", flights.show_flight, requests.Empty, WATCH, names=FLIGHT),
    Route("/flights/{id}", flights.remove_flight, requests.Empty, ADMIN, ("DELETE",), names=FLIGHT),
    of_vehicle=False,
)

SCRIPTS = group(
    (errors.BadRequest, errors.NotFound, errors.ToolFailed, errors.ToolMissing),
    Route("/mission/upload-script", scripts.upload_script, requests.Empty, ADMIN, POST, raw=scripts.FILE),
    Route("/mission/list-scripts", scripts.list_scripts, requests.Empty, ADMIN),
    Route("/mission/running-scripts", scripts.running_scripts, requests.Empty, ADMIN),
    Route("/mission/stop-script", scripts.stop_script, requests.ScriptName, ADMIN, POST),
    Route("/mission/clear-scripts", scripts.clear_scripts, requests.Empty, ADMIN, ("DELETE",)),
    Route("/mission/clear", scripts.clear_scripts, requests.Empty, ADMIN, ("DELETE",)),
    Route("/mission/scripts/{name}", scripts.show_script, requests.Empty, ADMIN, names={"name": "square.py"}),
    Route(
        "/mission/scripts/{name}/log",
        scripts.script_log,
        requests.ScriptLog,
        ADMIN,
        names={"name": "square.py"},
        content={"text/plain": TEXT, EVENTS: TEXT},
    ),
    of_vehicle=False,
) + group(
    (errors.BadRequest, errors.NotFound, errors.ToolFailed, errors.ToolMissing, errors.NotRehearsed),
    Route("/mission/execute-script", scripts.execute_script, requests.ExecuteScript, ADMIN, POST),
)

REHEARSALS = group(
    (*OF_A_COMMAND, errors.BadRequest, errors.NotFound, errors.ToolFailed, errors.ToolMissing, errors.Forbidden),
    Route("/rehearsals", rehearsals.rehearse, requests.Rehearse, FLY, POST),
    Route("/rehearsals", rehearsals.show, requests.ShowRehearsals, FLY),
    Route("/rehearsals", rehearsals.end, requests.Empty, FLY, ("DELETE",)),
)

MISSION = [
    *group(
        (*OF_A_COMMAND, errors.BadRequest, errors.Aborted, errors.OutsideEnvelope),
        posted(
            "/mission/waypoints",
            mission.upload,
            requests.Empty,
            "Mission of 3 items uploaded",
            raw=mission.MISSION_FILE,
        ),
        Route("/mission/waypoints", mission.download, requests.Empty, FLY),
        verb("/mission/waypoints", mission.clear, requests.Empty, "Mission cleared", methods=("DELETE",)),
        posted(
            "/mission/fence",
            mission.upload_fence,
            requests.Empty,
            "Fence of 1 items uploaded",
            needs=ADMIN,
            raw=mission.FENCE_FILE,
        ),
        Route("/mission/fence", mission.fence, requests.Empty, FLY),
        verb(
            "/mission/fence", mission.clear_fence, requests.Empty, "Fence cleared", methods=("DELETE",), needs=ADMIN
        ),
        posted(
            "/mission/rally",
            mission.upload_rally,
            requests.Empty,
            "List of 1 rally points uploaded",
            raw=mission.RALLY_FILE,
        ),
        Route("/mission/rally", mission.rally, requests.Empty, FLY),
        verb("/mission/rally", mission.clear_rally, requests.Empty, "Rally points cleared", methods=("DELETE",)),
    ),
    posted("/mission/start", mission.start, requests.StartMission, "Mission started"),
    *group((errors.NoVehicle, errors.Stale), Route("/mission/progress", mission.progress, requests.Read, WATCH)),
]

PERIPHERICAL = group(
    (*OF_A_COMMAND, errors.BadRequest, errors.ToolFailed, errors.ToolMissing),
    Route("/peripherical/take_photo", photo.take_photo, requests.Photo, FLY, content=JPEG),
    posted("/peripherical/servo_output", peripherical.servo_output, requests.Servo, "Servo 9 set to 1500 PWM"),
)

FLEET = fleet_routes([*COMMAND, *MOVEMENT])

PARAMETERS = group(
    (*OF_A_VEHICLE, errors.NotFound, errors.TimedOut, errors.OutsideEnvelope),
    Route("/parameters", parameters.list_parameters, parameters.ParameterFilter, WATCH),
    Route(
        "/parameters.param",
        parameters.parameter_file,
        parameters.ParameterFilter,
        WATCH,
        content={"text/plain": TEXT},
    ),
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
    Route("/parameters/{name}", parameters.show_parameter, requests.Empty, FLY, names={"name": "WPNAV_SPEED"}),
    Route(
        "/parameters/{name}",
        parameters.set_parameter,
        parameters.NewValue,
        ADMIN,
        ("PUT",),
        names={"name": "WPNAV_SPEED"},
        done="WPNAV_SPEED is 500",
    ),
)

LOGS = group(
    (*OF_A_COMMAND, errors.NotFound, errors.Stale, errors.Aborted, errors.ToolFailed),
    Route("/logs", logs.list_logs, logs.LogRequest, WATCH),
    Route(
        "/logs/{id}",
        logs.read_log,
        requests.Empty,
        WATCH,
        names={"id": "3"},
        content={"application/octet-stream": BINARY},
    ),
    posted("/logs/{id}/download", logs.download_log, logs.LogRequest, "Log 3 downloaded", names={"id": "3"}),
)

ENVELOPE = group(
    (errors.NotFound, errors.BadRequest),
    Route("/envelope", envelope.show, requests.Empty, WATCH),
    Route("/envelope", envelope.put, requests.PutEnvelope, ADMIN, ("PUT",), raw=envelope.FILE),
    Route("/envelope", envelope.remove, requests.Empty, ADMIN, ("DELETE",)),
) + group(
    (*OF_A_COMMAND, errors.OutsideEnvelope, errors.TooNear, errors.Stale),
    Route("/envelope/check", envelope.check, requests.GpsPlace, FLY, verb="go_to", done="Allowed"),
)

SETTINGS = group(
    (errors.NotFound, errors.TimedOut),
    Route("/settings", settings.show, requests.Empty, WATCH),
    Route("/settings/{name}", settings.put, settings.NewSetting, ADMIN, ("PUT",), names={"name": "max_age"}),
    of_vehicle=False,
)

MESSAGE = [
    posted("/message", message.send_message, message.RawMessage, "STATUSTEXT sent", needs=ADMIN),
]

AUTHORITY = group(
    (errors.NoVehicle, errors.Busy),
    Route("/authority", authority.show, requests.Empty, WATCH),
    Route("/authority/take", authority.take, authority.Take, FLY, POST, done="anna holds vehicle 1"),
    Route("/authority/release", authority.release, authority.Release, FLY, POST, done="Vehicle 1 is released"),
)

VEHICLES = group(
    (errors.NotFound,),
    Route("/vehicles", vehicles.list_vehicles, requests.Empty, WATCH),
    Route("/vehicles/{sysid}", vehicles.show_vehicle, requests.Empty, WATCH, names={"sysid": "1"}),
    of_vehicle=False,
)

DOCS = group(
    (errors.NotFound,),
    Route("/version", version, requests.Empty, WATCH),
    Route("/openapi.json", specification, requests.Empty, WATCH, content={JSON: {"schema": {"type": "object"}}}),
    Route("/docs", docs_page.page, requests.Empty, WATCH, content={"text/html": TEXT}),
    Route(
        "/docs/{file}",
        docs_page.asset,
        requests.Empty,
        WATCH,
        names={"file": "swagger-ui.css"},
        content={"text/css": TEXT, "text/javascript": TEXT, "image/png": BINARY},
    ),
    of_vehicle=False,
)

PAGE = [
    Route("/", page.index, requests.Empty, WATCH),
    Route("/page/{file}", page.asset, requests.Empty, WATCH),
    Route("/page/{room}/{file}", page.asset, requests.Empty, WATCH),
    Route("/tiles", tiles.show, requests.Empty, WATCH),
    Route("/tiles/{z}/{x}/{y}", tiles.tile, requests.Empty, WATCH),
]

ROUTES = [
    *COMMAND,
    *MOVEMENT,
    *TELEMETRY,
    *JOBS,
    *AUDIT,
    *FLIGHTS,
    *SCRIPTS,
    *REHEARSALS,
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
