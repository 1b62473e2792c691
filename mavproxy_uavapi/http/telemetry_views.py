"""MAVLink message -> answer body. Pure. Units: m, m/s, degrees; frames: docs/api.md."""

from __future__ import annotations

import base64
import math
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.geodesy import from_deg_e7

mavlink = mavutil.mavlink

UINT16_MAX = 65535
INT16_MAX = 32767
UINT8_MAX = 255

# The values that mean "unknown" in MAVLink's message definitions, for messages that ArduPilot sends.
UNKNOWN: dict[str, dict[str, int]] = {
    "GLOBAL_POSITION_INT": {"hdg": UINT16_MAX},
    "GPS_RAW_INT": {
        "eph": UINT16_MAX,
        "epv": UINT16_MAX,
        "vel": UINT16_MAX,
        "cog": UINT16_MAX,
        "satellites_visible": UINT8_MAX,
    },
    "SYS_STATUS": {"voltage_battery": UINT16_MAX, "current_battery": -1, "battery_remaining": -1},
    "BATTERY_STATUS": {
        "voltages": UINT16_MAX,
        "temperature": INT16_MAX,
        "current_battery": -1,
        "current_consumed": -1,
        "energy_consumed": -1,
        "battery_remaining": -1,
    },
    "RC_CHANNELS": {**{f"chan{n}_raw": UINT16_MAX for n in range(1, 19)}, "rssi": UINT8_MAX},
}

SENSORS = {
    "gyro": mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO,
    "accelerometer": mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL,
    "gps": mavlink.MAV_SYS_STATUS_SENSOR_GPS,
    "altitude_control": mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL,
    "position_control": mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL,
    "radio_receiver": mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER,
    "motor_output": mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS,
    "battery": mavlink.MAV_SYS_STATUS_SENSOR_BATTERY,
    "pre_arm_check": mavlink.MAV_SYS_STATUS_PREARM_CHECK,
}


def known(message: Any, name: str) -> Any:
    """A field's value; None if it means "unknown"; of an array element by element."""
    value = getattr(message, name)
    unknown = UNKNOWN.get(message.get_type(), {}).get(name)
    if isinstance(value, list):
        return [None if item == unknown else item for item in value]
    if value == unknown:
        return None
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def scaled(message: Any, name: str, divisor: float) -> float | None:
    """A field's value in the answer's unit; None if unknown."""
    value = known(message, name)
    return None if value is None else value / divisor


def fields(message: Any) -> dict[str, Any]:
    """All fields as on the wire, except unknown values; bytes as base64 text."""
    values = {"mavpackettype": message.get_type()}
    for name in message.get_fieldnames():
        value = known(message, name)
        values[name] = base64.b64encode(bytes(value)).decode() if isinstance(value, bytes | bytearray) else value
    return values


def general(m: Any) -> dict[str, Any]:
    """VFR_HUD: speeds in m/s, heading in degrees, throttle in %, alt in m AMSL."""
    return {name: known(m, name) for name in ("airspeed", "groundspeed", "heading", "throttle", "alt")}


def gps(m: Any) -> dict[str, Any]:
    """GLOBAL_POSITION_INT: degrees, m AMSL and above home, m/s north, east, down."""
    return {
        "position": {
            "lat": from_deg_e7(m.lat),
            "lon": from_deg_e7(m.lon),
            "alt": m.alt / 1000,
            "relative_alt": m.relative_alt / 1000,
        },
        "velocity": {"vx": m.vx / 100, "vy": m.vy / 100, "vz": m.vz / 100},
        "heading": scaled(m, "hdg", 100),
    }


def gps_raw(m: Any) -> dict[str, Any]:
    """GPS_RAW_INT: the receiver's own solution; degrees, m AMSL, m/s."""
    return {
        "position": {"lat": from_deg_e7(m.lat), "lon": from_deg_e7(m.lon), "alt": m.alt / 1000},
        "velocity": {"ground_speed": scaled(m, "vel", 100), "speed_direction": scaled(m, "cog", 100)},
        "satelites": known(m, "satellites_visible"),
        "fix_type": m.fix_type,
    }


def ned(m: Any) -> dict[str, Any]:
    """LOCAL_POSITION_NED: m and m/s north, east, down from the EKF origin."""
    return {
        "position": {"x": known(m, "x"), "y": known(m, "y"), "z": known(m, "z")},
        "velocity": {"vx": known(m, "vx"), "vy": known(m, "vy"), "vz": known(m, "vz")},
    }


def attitude(m: Any) -> dict[str, Any]:
    """ATTITUDE: degrees and deg/s; yaw is 0 to 360 clockwise from north."""
    angles = {"roll": math.degrees(m.roll), "pitch": math.degrees(m.pitch), "yaw": math.degrees(m.yaw) % 360.0}
    rates = {name: math.degrees(getattr(m, name)) for name in ("rollspeed", "pitchspeed", "yawspeed")}
    return {**angles, **rates}


def sensors(m: Any) -> dict[str, Any]:
    """SYS_STATUS: for each sensor whether it is present, enabled and healthy."""

    def condition(bit: int) -> dict[str, bool]:
        return {
            "present": bool(m.onboard_control_sensors_present & bit),
            "enabled": bool(m.onboard_control_sensors_enabled & bit),
            "health": bool(m.onboard_control_sensors_health & bit),
        }

    return {name: condition(bit) for name, bit in SENSORS.items()}


def battery(m: Any) -> dict[str, Any]:
    """SYS_STATUS: mV, cA, %."""
    return {
        "voltage": known(m, "voltage_battery"),
        "current": known(m, "current_battery"),
        "battery_remaining": known(m, "battery_remaining"),
    }


def errors(m: Any) -> dict[str, Any]:
    """SYS_STATUS: drop rate (0.01 %), errors on the autopilot's links, and its own non-zero counters."""
    counts = (m.errors_count1, m.errors_count2, m.errors_count3, m.errors_count4)
    return {
        "communication_drop_rate": m.drop_rate_comm,
        "communication_errors": m.errors_comm,
        "autopilot_errors": [count for count in counts if count],
    }


def home(m: Any) -> dict[str, Any]:
    """HOME_POSITION: degrees, m AMSL, and m from the EKF origin."""
    return {
        "lat": from_deg_e7(m.latitude),
        "lon": from_deg_e7(m.longitude),
        "altitude": m.altitude / 1000,
        "x": known(m, "x"),
        "y": known(m, "y"),
        "z": known(m, "z"),
    }


def compass(m: Any, fitness: list[float | None]) -> dict[str, Any]:
    """MAG_CAL_REPORT: status (MAG_CAL_STATUS), whether it was saved, and the fits (mGauss RMS) of compass 1, 2, 3."""
    x, y, z = fitness
    return {
        "calibration_status": m.cal_status,
        "autosaved": bool(m.autosaved),
        "fitness": {"x": x, "y": y, "z": z},
    }


IGNORE_POSITION = 0b111  # POSITION_TARGET_TYPEMASK: x, y, z


def target(m: Any) -> dict[str, Any]:
    """POSITION_TARGET_GLOBAL_INT: where the autopilot flies to, degrees and m AMSL; None if that is no place."""
    if m.type_mask & IGNORE_POSITION or (m.lat_int, m.lon_int) == (0, 0):
        return {"position": None}
    return {"position": {"lat": from_deg_e7(m.lat_int), "lon": from_deg_e7(m.lon_int), "alt": known(m, "alt")}}
