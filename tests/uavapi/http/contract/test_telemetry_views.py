from __future__ import annotations

import math

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.http.contract import telemetry_views as views
from tests.support.messages import message_of

mavlink = mavutil.mavlink


@pytest.mark.parametrize(
    ("name", "field", "unknown"),
    [
        ("GLOBAL_POSITION_INT", "hdg", 65535),
        ("GPS_RAW_INT", "eph", 65535),
        ("GPS_RAW_INT", "vel", 65535),
        ("GPS_RAW_INT", "satellites_visible", 255),
        ("SYS_STATUS", "voltage_battery", 65535),
        ("SYS_STATUS", "current_battery", -1),
        ("SYS_STATUS", "battery_remaining", -1),
        ("BATTERY_STATUS", "temperature", 32767),
        ("BATTERY_STATUS", "current_consumed", -1),
        ("RC_CHANNELS", "chan18_raw", 65535),
        ("RC_CHANNELS", "rssi", 255),
        ("VFR_HUD", "airspeed", math.nan),
        ("VFR_HUD", "airspeed", math.inf),
    ],
)
def test_what_a_message_does_not_know_is_none(name: str, field: str, unknown: float) -> None:
    extra = {"voltages": [1] * 10} if name == "BATTERY_STATUS" else {}
    assert views.known(message_of(name, **{field: unknown}, **extra), field) is None
    assert views.known(message_of(name, **{field: 7}, **extra), field) == 7


def test_the_same_number_elsewhere_is_a_value() -> None:
    assert views.known(message_of("ATTITUDE", time_boot_ms=65535), "time_boot_ms") == 65535
    assert views.known(message_of("GLOBAL_POSITION_INT", vx=-1), "vx") == -1


def test_unknown_elements_of_an_array_are_none() -> None:
    battery = message_of("BATTERY_STATUS", voltages=[3700, 65535] + [65535] * 8)
    assert views.fields(battery)["voltages"] == [3700] + [None] * 9


def test_fields_are_all_fields_and_bytes_are_base64() -> None:
    reported = views.fields(message_of("ATTITUDE", yaw=1.5))
    assert set(reported) == {"mavpackettype", *mavlink.MAVLink_attitude_message.fieldnames}
    assert reported["yaw"] == 1.5
    raw = views.fields(message_of("DATA96", type=1, len=3, data=b"abc" + bytes(93)))
    assert raw["data"] == [97, 98, 99] + [0] * 93 or isinstance(raw["data"], str)


def test_gps_is_in_degrees_metres_and_metres_a_second() -> None:
    message = message_of(
        "GLOBAL_POSITION_INT", lat=-351234567, lon=1491234567, alt=584123, relative_alt=-1500, vx=150, vy=-50, vz=25,
        hdg=35999,
    )  # fmt: skip
    assert views.gps(message) == {
        "position": {"lat": -35.1234567, "lon": 149.1234567, "alt": 584.123, "relative_alt": -1.5},
        "velocity": {"vx": 1.5, "vy": -0.5, "vz": 0.25},
        "heading": 359.99,
    }


def test_gps_raw_heading_of_655_degrees_is_none() -> None:
    reported = views.gps_raw(message_of("GPS_RAW_INT", cog=65535, vel=250, satellites_visible=11, fix_type=3))
    assert reported["velocity"] == {"ground_speed": 2.5, "speed_direction": None}
    assert (reported["satelites"], reported["fix_type"]) == (11, 3)


def test_errors_are_those_that_are_not_zero() -> None:
    message = message_of("SYS_STATUS", drop_rate_comm=12, errors_comm=3, errors_count2=5, errors_count4=7)
    assert views.errors(message) == {
        "communication_drop_rate": 12, "communication_errors": 3, "autopilot_errors": [5, 7],
    }  # fmt: skip


def test_sensors_are_known_by_their_own_bits() -> None:
    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    reported = views.sensors(message_of("SYS_STATUS", onboard_control_sensors_present=gps))
    assert reported["gps"] == {"present": True, "enabled": False, "health": False}
    assert reported["gyro"] == {"present": False, "enabled": False, "health": False}


def test_home_is_in_degrees_and_metres() -> None:
    message = message_of(
        "HOME_POSITION", latitude=-350000001, longitude=1490000001, altitude=584250, x=1.5, z=math.nan
    )
    assert views.home(message) == {
        "lat": -35.0000001, "lon": 149.0000001, "altitude": 584.25, "x": 1.5, "y": 0.0, "z": None,
    }  # fmt: skip


def test_yaw_is_reported_from_0_to_360() -> None:
    assert views.attitude(message_of("ATTITUDE", yaw=-math.pi / 2, yawspeed=math.pi))["yaw"] == pytest.approx(270)
    assert views.attitude(message_of("ATTITUDE", yawspeed=math.pi))["yawspeed"] == pytest.approx(180)
