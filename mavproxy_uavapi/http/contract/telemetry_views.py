"""MAVLink message -> answer body. Pure. Units: m, m/s, degrees; frames: docs/api.md."""

from __future__ import annotations

import base64
import math
from typing import Annotated, Any

from pydantic import ConfigDict, with_config
from pymavlink import mavutil
from typing_extensions import TypedDict

from mavproxy_uavapi.core.geodesy import from_deg_e7
from mavproxy_uavapi.http.contract.answers import (
    Degrees,
    GlobalPositionView,
    Latitude,
    Longitude,
    PositionView,
    VelocityView,
    means,
)

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


@with_config(ConfigDict(extra="allow"))
class FieldsView(TypedDict):
    """A message's fields as on the wire, beside its name; unknown values are null, bytes are base64 text."""

    mavpackettype: Annotated[str, means("the name of the message", "SYS_STATUS")]


@with_config(ConfigDict(extra="allow"))
class MessageReport(FieldsView):
    """A message's fields beside its name, and how it comes."""

    count: Annotated[int, means("how many came", 812)]
    rate: Annotated[float, means("Hz", 4.0)]


class MessageKind(TypedDict):
    """A message that comes, and what it counts."""

    rate: Annotated[float, means("Hz", 4.0)]
    units: Annotated[
        dict[str, str],
        means("unit of each number, as MAVLink has it; those of a list one by one", {"vx": "cm/s", "hdg": "cdeg"}),
    ]
    component: Annotated[int, means("component id of its sender, the autopilot", 1)]
    instance: Annotated[str | None, means("the field that tells which of several devices it is of", None)]


def units(message: Any) -> dict[str, str]:
    """The unit of each number that is known: `volt`, or `volt[2]` of a list; empty where MAVLink has none."""
    found = {}
    for name in message.get_fieldnames():
        value, unit = known(message, name), message.fieldunits_by_name.get(name, "")
        listed = {f"{name}[{n}]": item for n, item in enumerate(value)} if isinstance(value, list) else {name: value}
        found.update({key: unit for key, item in listed.items() if isinstance(item, int | float)})
    return found


def fields(message: Any) -> FieldsView:
    """All of them."""
    values: Any = {"mavpackettype": message.get_type()}
    for name in message.get_fieldnames():
        value = known(message, name)
        values[name] = base64.b64encode(bytes(value)).decode() if isinstance(value, bytes | bytearray) else value
    return values  # type: ignore[no-any-return]


class GeneralView(TypedDict):
    """VFR_HUD."""

    airspeed: Annotated[float | None, means("m/s", 0.1)]
    groundspeed: Annotated[float | None, means("m/s", 4.9)]
    heading: Annotated[int | None, means("degrees", 90)]
    throttle: Annotated[int | None, means("%", 41)]
    alt: Annotated[float | None, means("m above mean sea level", 604.2)]


def general(m: Any) -> GeneralView:
    """Of VFR_HUD."""
    return {
        "airspeed": known(m, "airspeed"),
        "groundspeed": known(m, "groundspeed"),
        "heading": known(m, "heading"),
        "throttle": known(m, "throttle"),
        "alt": known(m, "alt"),
    }


class GpsView(TypedDict):
    """GLOBAL_POSITION_INT."""

    position: GlobalPositionView
    velocity: VelocityView
    heading: Degrees | None


def gps(m: Any) -> GpsView:
    """Of GLOBAL_POSITION_INT."""
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


class CourseView(TypedDict):
    """How fast, and where to."""

    ground_speed: Annotated[float | None, means("m/s", 4.9)]
    speed_direction: Annotated[float | None, means("degrees", 90.2)]


class GpsRawView(TypedDict):
    """GPS_RAW_INT: the receiver's own solution."""

    position: PositionView
    velocity: CourseView
    satelites: Annotated[int | None, means("how many it sees", 10)]
    fix_type: Annotated[int, means("GPS_FIX_TYPE", 6)]


def gps_raw(m: Any) -> GpsRawView:
    """Of GPS_RAW_INT."""
    return {
        "position": {"lat": from_deg_e7(m.lat), "lon": from_deg_e7(m.lon), "alt": m.alt / 1000},
        "velocity": {"ground_speed": scaled(m, "vel", 100), "speed_direction": scaled(m, "cog", 100)},
        "satelites": known(m, "satellites_visible"),
        "fix_type": m.fix_type,
    }


class NedPositionView(TypedDict):
    """A place from the EKF origin."""

    x: Annotated[float | None, means("m north", 20.0)]
    y: Annotated[float | None, means("m east", 10.0)]
    z: Annotated[float | None, means("m down", -12.0)]


class NedView(TypedDict):
    """LOCAL_POSITION_NED."""

    position: NedPositionView
    velocity: VelocityView


def ned(m: Any) -> NedView:
    """Of LOCAL_POSITION_NED."""
    return {
        "position": {"x": known(m, "x"), "y": known(m, "y"), "z": known(m, "z")},
        "velocity": {"vx": known(m, "vx"), "vy": known(m, "vy"), "vz": known(m, "vz")},
    }


class AttitudeView(TypedDict):
    """ATTITUDE."""

    roll: Degrees
    pitch: Degrees
    yaw: Annotated[float, means("degrees clockwise from north, 0 to 360", 90.1)]
    rollspeed: Annotated[float, means("deg/s", 0.0)]
    pitchspeed: Annotated[float, means("deg/s", 0.0)]
    yawspeed: Annotated[float, means("deg/s", 0.1)]


def attitude(m: Any) -> AttitudeView:
    """Of ATTITUDE."""
    return {
        "roll": math.degrees(m.roll),
        "pitch": math.degrees(m.pitch),
        "yaw": math.degrees(m.yaw) % 360.0,
        "rollspeed": math.degrees(m.rollspeed),
        "pitchspeed": math.degrees(m.pitchspeed),
        "yawspeed": math.degrees(m.yawspeed),
    }


class SensorView(TypedDict):
    """A sensor as SYS_STATUS has it."""

    present: bool
    enabled: bool
    health: bool


def sensors(m: Any) -> dict[str, SensorView]:
    """Of SYS_STATUS, by the names of SENSORS."""

    def condition(bit: int) -> SensorView:
        return {
            "present": bool(m.onboard_control_sensors_present & bit),
            "enabled": bool(m.onboard_control_sensors_enabled & bit),
            "health": bool(m.onboard_control_sensors_health & bit),
        }

    return {name: condition(bit) for name, bit in SENSORS.items()}


class BatteryView(TypedDict):
    """SYS_STATUS: the battery."""

    voltage: Annotated[int | None, means("mV", 12600)]
    current: Annotated[int | None, means("cA", 1520)]
    battery_remaining: Annotated[int | None, means("%", 87)]


def battery(m: Any) -> BatteryView:
    """Of SYS_STATUS."""
    return {
        "voltage": known(m, "voltage_battery"),
        "current": known(m, "current_battery"),
        "battery_remaining": known(m, "battery_remaining"),
    }


class ErrorsView(TypedDict):
    """SYS_STATUS: errors."""

    communication_drop_rate: Annotated[int, means("0.01 %", 0)]
    communication_errors: Annotated[int, means("on the autopilot's links", 0)]
    autopilot_errors: Annotated[list[int], means("its own counters that are not 0", [])]


def errors(m: Any) -> ErrorsView:
    """Of SYS_STATUS."""
    counts = (m.errors_count1, m.errors_count2, m.errors_count3, m.errors_count4)
    return {
        "communication_drop_rate": m.drop_rate_comm,
        "communication_errors": m.errors_comm,
        "autopilot_errors": [count for count in counts if count],
    }


class HomeView(NedPositionView):
    """HOME_POSITION: home, also from the EKF origin."""

    lat: Latitude
    lon: Longitude
    altitude: Annotated[float, means("m above mean sea level", 584.0)]


def home(m: Any) -> HomeView:
    """Of HOME_POSITION."""
    return {
        "lat": from_deg_e7(m.latitude),
        "lon": from_deg_e7(m.longitude),
        "altitude": m.altitude / 1000,
        "x": known(m, "x"),
        "y": known(m, "y"),
        "z": known(m, "z"),
    }


class FitnessView(TypedDict):
    """How well a calibration fits the field; x, y and z are compass 1, 2 and 3."""

    x: Annotated[float | None, means("mGauss RMS", 6.1)]
    y: Annotated[float | None, means("mGauss RMS", 7.2)]
    z: Annotated[float | None, means("mGauss RMS", None)]


class CompassView(TypedDict):
    """MAG_CAL_REPORT."""

    calibration_status: Annotated[int, means("MAG_CAL_STATUS", 4)]
    autosaved: bool
    fitness: FitnessView


def compass(m: Any, fitness: list[float | None]) -> CompassView:
    """Of MAG_CAL_REPORT, and of the fits of compass 1, 2 and 3."""
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
