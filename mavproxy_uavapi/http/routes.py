"""The table of all paths."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.http import (
    command,
    docs_page,
    envelope,
    jobs,
    message,
    mission,
    movement,
    page,
    parameters,
    peripherical,
    photo,
    requests,
    scripts,
    stream,
    telemetry,
    vehicles,
)
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.fleet import fleet_routes
from mavproxy_uavapi.http.openapi import document
from mavproxy_uavapi.http.route import EITHER, POST, Route


async def specification(call: Call) -> dict[str, Any]:
    """The description of this API, OpenAPI 3.1, including the routes of other loaded modules."""
    return document([*ROUTES, *call.service.host.extensions.values()])


COMMAND = [
    Route("/command/arm", command.arm, requests.Blocking, EITHER, job=True),
    Route("/command/disarm", command.disarm, requests.Disarm, EITHER, job=True, stops=True),
    Route("/command/takeoff", command.takeoff, requests.Takeoff, EITHER, job=True, verb="takeoff"),
    Route("/command/land", command.land, requests.Blocking, EITHER, job=True, verb="land", stops=True),
    Route("/command/land_at", command.land_at, requests.LandAt, EITHER, job=True, verb="land_at", stops=True),
    Route("/command/rtl", command.rtl, requests.Blocking, EITHER, job=True, verb="rtl", stops=True),
    Route("/command/brake", command.brake, requests.Empty, EITHER, job=True, verb="brake", stops=True),
    Route("/command/guided", command.guided, requests.Empty, EITHER, job=True),
    Route("/command/set_mode", command.set_mode, requests.ModeName, EITHER, job=True),
    Route("/command/set_reverse", command.set_reverse, requests.Reverse, EITHER, job=True, verb="set_reverse"),
    Route("/command/set_air_speed", command.set_air_speed, requests.NewSpeed, EITHER, job=True),
    Route("/command/set_ground_speed", command.set_ground_speed, requests.NewSpeed, EITHER, job=True),
    Route("/command/set_climb_speed", command.set_climb_speed, requests.NewSpeed, EITHER, job=True),
    Route("/command/set_descent_speed", command.set_descent_speed, requests.NewSpeed, EITHER, job=True),
    Route("/command/set_sim_speedup", command.set_sim_speedup, requests.SimFactor, EITHER, job=True),
    Route("/command/reboot", command.reboot, requests.Empty, EITHER, job=True),
    Route("/command/set_home", command.set_home, requests.Empty, EITHER, job=True),
]

MOVEMENT = [
    Route("/movement/go_to_gps", movement.go_to_gps, requests.GpsTarget, POST, job=True, verb="go_to"),
    Route("/movement/go_to_gps_wait", movement.go_to_gps_wait, requests.GpsTarget, POST, job=True, verb="go_to"),
    Route("/movement/go_to_ned", movement.go_to_ned, requests.NedPlace, POST, job=True, verb="go_to"),
    Route("/movement/go_to_ned_wait", movement.go_to_ned_wait, requests.NedPlace, POST, job=True, verb="go_to"),
    Route("/movement/drive", movement.drive, requests.NedPlace, POST, job=True, verb="go_to"),
    Route("/movement/drive_wait", movement.drive_wait, requests.NedPlace, POST, job=True, verb="go_to"),
    Route("/movement/drive_body", movement.drive_body, requests.BodyOffset, POST, job=True, verb="go_to"),
    Route("/movement/drive_body_wait", movement.drive_body_wait, requests.BodyOffset, POST, job=True, verb="go_to"),
    Route("/movement/travel_at_ned", movement.travel_at_ned, requests.NedVelocity, POST, job=True, verb="travel"),
    Route("/movement/travel_at_body", movement.travel_at_body, requests.BodyVelocity, POST, job=True, verb="travel"),
    Route("/movement/set_heading", movement.set_heading, requests.Heading, EITHER, job=True, verb="set_heading"),
    Route("/movement/set_yaw_rate", movement.set_yaw_rate, requests.YawRate, EITHER, job=True, verb="set_yaw_rate"),
    Route("/movement/stop", movement.stop, requests.Empty, EITHER, job=True, verb="stop", stops=True),
    Route("/movement/resume", movement.resume, requests.Empty, EITHER, job=True, verb="resume"),
]

TELEMETRY = [
    Route("/telemetry/general", telemetry.general, requests.Read),
    Route("/telemetry/gps", telemetry.gps, requests.Read),
    Route("/telemetry/gps_raw", telemetry.gps_raw, requests.Read),
    Route("/telemetry/ned", telemetry.ned, requests.Read),
    Route("/telemetry/compass", telemetry.compass, requests.Read),
    Route("/telemetry/sys_status", telemetry.sys_status, requests.Read),
    Route("/telemetry/sensor_status", telemetry.sensor_status, requests.Read),
    Route("/telemetry/battery_info", telemetry.battery_info, requests.Read),
    Route("/telemetry/error_info", telemetry.error_info, requests.Read),
    Route("/telemetry/home_info", telemetry.home_info, requests.Read),
    Route("/telemetry/attitude", telemetry.attitude, requests.Read),
    Route("/telemetry/status", telemetry.status, requests.Read),
    Route("/telemetry/message/{name}", telemetry.message, requests.Read),
    Route("/telemetry/stream", stream.stream, requests.StreamFilter),
]

JOBS = [
    Route("/jobs", jobs.list_jobs, requests.Empty),
    Route("/jobs/{id}", jobs.show_job, requests.Empty),
    Route("/jobs/{id}", jobs.abort_job, requests.Empty, ("DELETE",), stops=True),
]

MISSION = [
    Route("/mission/upload-script", scripts.upload_script, requests.Empty, POST, raw=True),
    Route("/mission/list-scripts", scripts.list_scripts, requests.Empty),
    Route("/mission/execute-script", scripts.execute_script, requests.ExecuteScript, POST),
    Route("/mission/running-scripts", scripts.running_scripts, requests.Empty),
    Route("/mission/stop-script", scripts.stop_script, requests.ScriptName, POST),
    Route("/mission/clear-scripts", scripts.clear_scripts, requests.Empty, ("DELETE",)),
    Route("/mission/clear", scripts.clear_scripts, requests.Empty, ("DELETE",)),
    Route("/mission/scripts/{name}", scripts.show_script, requests.Empty),
    Route("/mission/scripts/{name}/log", scripts.script_log, requests.ScriptLog),
    Route("/mission/waypoints", mission.upload, requests.Empty, POST, raw=True, job=True),
    Route("/mission/waypoints", mission.download, requests.Empty),
    Route("/mission/waypoints", mission.clear, requests.Empty, ("DELETE",), job=True),
    Route("/mission/start", mission.start, requests.StartMission, POST, job=True),
    Route("/mission/progress", mission.progress, requests.Read),
]

PERIPHERICAL = [
    Route("/peripherical/take_photo", photo.take_photo, requests.Photo),
    Route("/peripherical/servo_output", peripherical.servo_output, requests.Servo, POST, job=True),
]

FLEET = fleet_routes([*COMMAND, *MOVEMENT])

PARAMETERS = [
    Route("/parameters", parameters.list_parameters, parameters.ParameterFilter),
    Route("/parameters.param", parameters.parameter_file, parameters.ParameterFilter),
    Route("/parameters", parameters.load_parameters, requests.Empty, POST, raw=True),
    Route("/parameters/{name}", parameters.show_parameter, requests.Empty),
    Route("/parameters/{name}", parameters.set_parameter, parameters.NewValue, ("PUT",)),
]

ENVELOPE = [
    Route("/envelope", envelope.show, requests.Empty),
    Route("/envelope", envelope.put, requests.Empty, ("PUT",), raw=True),
    Route("/envelope", envelope.remove, requests.Empty, ("DELETE",)),
]
MESSAGE = [Route("/message", message.send_message, message.RawMessage, POST, job=True)]

VEHICLES = [
    Route("/vehicles", vehicles.list_vehicles, requests.Empty),
    Route("/vehicles/{sysid}", vehicles.show_vehicle, requests.Empty),
]

DOCS = [
    Route("/openapi.json", specification, requests.Empty),
    Route("/docs", docs_page.page, requests.Empty),
    Route("/docs/{file}", docs_page.asset, requests.Empty),
]

PAGE = [  # no part of the API, and not described
    Route("/", page.index, requests.Empty),
    Route("/page/{file}", page.asset, requests.Empty),
]

ROUTES = [
    *COMMAND,
    *MOVEMENT,
    *TELEMETRY,
    *JOBS,
    *MISSION,
    *PERIPHERICAL,
    *PARAMETERS,
    *ENVELOPE,
    *MESSAGE,
    *VEHICLES,
    *FLEET,
    *DOCS,
]
