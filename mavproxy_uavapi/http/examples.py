"""The documentation's examples: a request per model, an answer per path.

Tests check both: requests against their models, answers against those for a vehicle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mavproxy_uavapi.http import requests
from mavproxy_uavapi.http.message import RawMessage
from mavproxy_uavapi.http.parameters import NewValue
from mavproxy_uavapi.http.settings import NewSetting
from mavproxy_uavapi.http.telemetry_views import SENSORS

PLACE = {"lat": -35.3629, "long": 149.1652, "alt": 20}
RUN = {
    "script": "square.py",
    "args": ["10"],
    "session": "uavapi_1_square_20260102_030405",
    "attach": "tmux attach -t uavapi_1_square_20260102_030405",
    "started_at": "2026-01-02T03:04:05+00:00",
    "out_log": "/home/pilot/uav_scripts/logs/square_20260102_030405_out.log",
    "err_log": "/home/pilot/uav_scripts/logs/square_20260102_030405_err.log",
    "running": True,
    "running_for_s": 12.5,
    "stopping": False,
}
ENDED = {
    **{name: value for name, value in RUN.items() if name not in ("running_for_s", "stopping")},
    "running": False,
    "ended_at": "2026-01-02T03:05:06+00:00",
    "exit_status": 0,
    "killed": False,
}
ITEM = {"seq": 1, "command": "NAV_TAKEOFF", "frame": "relative"} | {f"param{n}": 0.0 for n in range(1, 5)}
ITEMS = [{**ITEM, "lat": 0.0, "long": 0.0, "alt": 10.0, "autocontinue": True}]
FENCE = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"kind": "exclusion", "name": "fence circle 0", "radius": 25.0},
            "geometry": {"type": "Point", "coordinates": [149.1665, -35.3625]},
        }
    ],
    "limits": {},
}
POINTS = [{"seq": 1, "frame": "relative", "lat": -35.3625, "long": 149.1665, "alt": 30.0}]
JOB = {
    "job": "7",
    "verb": "/movement/go_to_ned_wait",
    "request": {"x": 20, "y": 10, "z": -12},
    "client": "127.0.0.1",
    "state": "running",
    "progress": {"altitude": 12.0, "distance_to_go": 7.4},
    "seconds": 3.2,
    "result": None,
    "error": None,
}
SETTING = {
    "name": "max_age",
    "value": 3.0,
    "meaning": "s after which telemetry is stale",
    "unit": "s",
    "accepts": "a number from 0.1 to 3600",
    "choices": [],
    "default": 5.0,
    "origin": "uavapi set",
    "settable": True,
}
ABORTED = {"status": 409, "code": "aborted", "detail": "/movement/go_to_ned_wait was aborted by DELETE /jobs/7"}
WPL = """\
QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.165230\t584\t1
1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1
2\t0\t3\t16\t0\t0\t0\t0\t-35.363000\t149.165300\t12\t1
3\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""

REQUESTS: Mapping[type[requests.Request], Mapping[str, Any]] = {
    requests.Takeoff: {"alt": 10},
    RawMessage: {"name": "STATUSTEXT", "fields": {"severity": "MAV_SEVERITY_INFO", "text": "hello"}},
    requests.LandAt: {"lat": -35.3629, "long": 149.1652},
    requests.Reverse: {"reverse": True},
    NewValue: {"value": 500},
    NewSetting: {"value": 3},
    requests.ModeName: {"mode": "LOITER"},
    requests.NewSpeed: {"new_v": 5},
    requests.SimFactor: {"sim_factor": 5},
    requests.GpsTarget: {**PLACE, "look_at_target": False},
    requests.NedPlace: {"x": 20, "y": 10, "z": -12},
    requests.BodyOffset: {"front": 5, "right": 0, "down": 0},
    requests.NedVelocity: {"vx": 1, "vy": 0, "vz": 0, "duration": 5},
    requests.Heading: {"heading": 90},
    requests.YawRate: {"yaw_rate": 10},
    requests.Servo: {"channel": 9, "pwm": 1500},
    requests.ExecuteScript: {"script_name": "square.py", "args": ["10"]},
    requests.ScriptName: {"script_name": "square.py"},
    requests.Photo: {"command": "rpicam-still", "resolution": "1280x720", "exposure": 20},
    requests.StreamFilter: {"names": "ATTITUDE,GPS_RAW_INT", "rate": 2},
}

VEHICLE = {
    "id": 1,
    "type": "copter",
    "mode": "GUIDED",
    "armed": True,
    "landed_state": "in_air",
    "link": {"alive": True, "heartbeat_age_s": 0.4, "packet_loss": 0.0},
    "ekf_ok": True,
    "gps_fix": 6,
    "battery_remaining": 87,
    "ready_to_arm": True,
    "why_not": [],
    "position": {"lat": -35.363, "lon": 149.1653, "alt": 604.2, "relative_alt": 20.0},
    "velocity": {"vx": 4.9, "vy": 0.1, "vz": 0.0},
    "heading": 90.1,
    "age_s": 0.12,
    "current": True,
    "paused": False,
    "commanded_by": {"job": "7", "verb": "/movement/go_to_ned_wait", "client": "127.0.0.1"},
    "held_by": None,
}

PATH_PARAMETERS = {
    "name": {
        "/telemetry/message/{name}": "ATTITUDE",
        "/mission/scripts/{name}": "square.py",
        "/parameters/{name}": "WPNAV_SPEED",
        "/settings/{name}": "max_age",
    },
    "sysid": {"/vehicles/{sysid}": "1"},
    "id": {"/jobs/{id}": "7", "/logs/{id}": "3"},
    "file": {"/docs/{file}": "swagger-ui.css"},
}

# The body's `result`, and its members besides device, id and result.
RESULTS: Mapping[str, str] = {
    "/command/arm": "Armed vehicle",
    "/command/disarm": "Disarmed vehicle",
    "/command/takeoff": "Takeoff successful! Vehicle at 10 meters",
    "/command/land": "Landed at home successfully",
    "/command/rtl": "Landed at home successfully",
    "/command/brake": "Copter braking. Use /command/guided to enable movement commands again",
    "/command/guided": "Copter in GUIDED mode",
    "/command/set_mode": "Mode LOITER",
    "/command/reboot": "The autopilot has booted",
    "PUT /parameters/{name}": "WPNAV_SPEED is 500",
    "POST /parameters": "1 of 1 parameters are set",
    "/logs/{id}/download": "Log 3 downloaded",
    "/command/land_at": "Landing mission started for coord (-35.3629, 149.1652)",
    "/command/set_reverse": "Driving backwards",
    "/command/set_air_speed": "Air speed set to 5m/s",
    "/command/set_ground_speed": "Ground speed set to 5m/s",
    "/command/set_climb_speed": "Climb speed set to 5m/s",
    "/command/set_descent_speed": "Descent speed set to 5m/s",
    "/command/set_sim_speedup": "Simulation speedup set to 5x",
    "/command/set_home": "Home location set successfully!",
    "/movement/go_to_gps": "Going to coord (-35.3629, 149.1652, 20)",
    "/movement/go_to_gps_wait": "Arrived at coord (-35.3629, 149.1652, 20)",
    "/movement/go_to_ned": "Going to NED coord (20, 10, -12)",
    "/movement/go_to_ned_wait": "Arrived at NED coord (20, 10, -12)",
    "/movement/drive": "Copter is driving",
    "/movement/drive_wait": "Copter arrived at (20, 10, -12)",
    "/movement/drive_body": "Copter is driving",
    "/movement/drive_body_wait": "Copter arrived at (5, 0, 0)",
    "/movement/travel_at_ned": "Travelling at NED velocity (1, 0, 0)",
    "/movement/travel_at_body": "Travelling at body velocity (1, 0, 0)",
    "/movement/set_heading": "Heading set to 90 degrees",
    "/movement/set_yaw_rate": "Yaw rate set to 10 deg/s",
    "/movement/stop": "Copter has stopped",
    "/movement/resume": "Copter has resumed",
    "/peripherical/servo_output": "Servo 9 set to 1500 PWM",
    "/mission/start": "Mission started",
    "POST /mission/waypoints": "Mission of 3 items uploaded",
    "DELETE /mission/waypoints": "Mission cleared",
    "POST /mission/fence": "Fence of 1 items uploaded",
    "DELETE /mission/fence": "Fence cleared",
    "POST /mission/rally": "List of 1 rally points uploaded",
    "DELETE /mission/rally": "Rally points cleared",
    "/authority/take": "anna holds vehicle 1",
    "/authority/release": "Vehicle 1 is released",
}

AGE = {"age_s": 0.12}
NOBODY_HOLDS = {"vehicle": 1, "held_by": None, "role": None, "remaining_s": None, "commanded_by": None}
HELD = {**NOBODY_HOLDS, "held_by": "anna", "role": "fly", "remaining_s": 30.0}
ONE_SENSOR = {"present": True, "enabled": True, "health": True}
MEMBERS: Mapping[str, Mapping[str, Any]] = {
    "/authority": {"vehicles": [HELD]},
    "/authority/take": HELD,
    "/authority/release": NOBODY_HOLDS,
    "/telemetry/general": {
        "info": {"airspeed": 0.1, "groundspeed": 4.9, "heading": 90, "throttle": 41, "alt": 604.2},
        **AGE,
    },
    "/telemetry/gps": {
        "info": {
            "position": {"lat": -35.363, "lon": 149.1653, "alt": 604.2, "relative_alt": 20.0},
            "velocity": {"vx": 4.9, "vy": 0.1, "vz": 0.0},
            "heading": 90.1,
        },
        **AGE,
    },
    "/telemetry/gps_raw": {
        "info": {
            "position": {"lat": -35.363, "lon": 149.1653, "alt": 604.2},
            "velocity": {"ground_speed": 4.9, "speed_direction": 90.2},
            "satelites": 10,
            "fix_type": 6,
        },
        **AGE,
    },
    "/telemetry/ned": {
        "info": {"position": {"x": 20.0, "y": 10.0, "z": -12.0}, "velocity": {"vx": 0.0, "vy": 0.0, "vz": 0.0}},
        **AGE,
    },
    "/telemetry/compass": {
        "info": {"calibration_status": 4, "autosaved": True, "fitness": {"x": 6.1, "y": 7.2, "z": None}},
        **AGE,
    },
    "/telemetry/sys_status": {
        "status": {"mavpackettype": "SYS_STATUS", "voltage_battery": 12600, "load": 120},
        **AGE,
    },
    "/telemetry/sensor_status": {
        "status": dict.fromkeys(SENSORS, ONE_SENSOR),
        **AGE,
    },
    "/telemetry/battery_info": {"info": {"voltage": 12600, "current": 1520, "battery_remaining": 87}, **AGE},
    "/telemetry/error_info": {
        "info": {"communication_drop_rate": 0, "communication_errors": 0, "autopilot_errors": []},
        **AGE,
    },
    "/telemetry/home_info": {
        "lat": -35.363261,
        "lon": 149.16523,
        "altitude": 584.0,
        "x": 0.0,
        "y": 0.0,
        "z": 0.0,
        **AGE,
    },
    "/telemetry/attitude": {
        "info": {"roll": 0.5, "pitch": -1.2, "yaw": 90.1, "rollspeed": 0.0, "pitchspeed": 0.0, "yawspeed": 0.1},
        **AGE,
    },
    "/telemetry/status": {
        "info": {
            "vehicle_type": "copter",
            "mode": "GUIDED",
            "armed": False,
            "landed_state": "on_ground",
            "link": {"alive": True, "heartbeat_age_s": 0.4, "packet_loss": 0.0},
            "ekf_ok": True,
            "gps_fix": 6,
            "battery_remaining": 87,
            "ready_to_arm": False,
            "why_not": ["PreArm: RC not found"],
        },
        **AGE,
    },
    "/telemetry/message/{name}": {
        "info": {"mavpackettype": "ATTITUDE", "roll": 0.01, "count": 812, "rate": 4.0},
        **AGE,
    },
    "/logs": {
        "logs": [{"id": 3, "size": 1204224, "time": "2026-05-04T13:20:07Z", "downloaded": False}],
        "age_s": 0.0,
    },
    "GET /parameters": {"parameters": {"WPNAV_SPEED": 500.0}},
    "POST /parameters": {"parameters": {"WPNAV_SPEED": 500.0}, "failed": {}},
    "/parameters/{name}": {"name": "WPNAV_SPEED", "value": 500.0},
    "/mission/upload-script": {
        "type": 44,
        "info": "Mission File 'square.py' saved at /home/pilot/uav_scripts/square.py successfully.",
    },
    "/mission/list-scripts": {"type": 42, "scripts": ["square.py"], "shell_scripts": ["patrol.sh"]},
    "/mission/execute-script": {"type": 46, **RUN},
    "/mission/running-scripts": {
        "type": 50,
        "scripts": [{**RUN, "processes": [{"pid": 4711, "command": "python3 square.py 10"}]}],
    },
    "/mission/stop-script": {"type": 52, "info": "Stopped", **ENDED},
    "/mission/clear-scripts": {"type": 48, "info": "Removed 1 script(s)", "removed": ["square.py"]},
    "/mission/clear": {"type": 48, "info": "Removed 1 script(s)", "removed": ["square.py"]},
    "/mission/scripts/{name}": {
        "script": "square.py",
        "running": False,
        "run": {**ENDED, "out": "landed\n", "err": ""},
    },
    "GET /mission/waypoints": {"home": {**ITEMS[0], "seq": 0, "command": "NAV_WAYPOINT"}, "items": ITEMS},
    "GET /mission/fence": {"fence": FENCE},
    "GET /mission/rally": {"points": POINTS},
    "/mission/progress": {
        "info": {
            "current": 2,
            "total": 3,
            "last_reached": 1,
            "state": "active",
            "mode": "AUTO",
            "distance_m": 14,
        },
        **AGE,
    },
}

# Bodies without the usual envelope.
BODIES: Mapping[str, Mapping[str, Any]] = {
    "/vehicles": {"vehicles": [VEHICLE]},
    "/vehicles/{sysid}": VEHICLE,
    "/jobs": {"jobs": [JOB]},
    "/settings": {"settings": [SETTING]},
    "/settings/{name}": {"result": "max_age is 3.0", **SETTING},
    "GET /jobs/{id}": JOB,
    "DELETE /jobs/{id}": {**JOB, "state": "aborted", "error": ABORTED},
}
ENVELOPE = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"kind": "inclusion", "name": "field", "ceiling": 60},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[149.16, -35.367], [149.17, -35.367], [149.17, -35.359], [149.16, -35.359], [149.16, -35.367]]
                ],
            },
        },
        {
            "type": "Feature",
            "properties": {"kind": "exclusion", "name": "mast", "radius": 25, "ceiling": 40},
            "geometry": {"type": "Point", "coordinates": [149.1665, -35.3625]},
        },
    ],
    "limits": {"height": 60, "distance": 400, "speed": 8},
}
