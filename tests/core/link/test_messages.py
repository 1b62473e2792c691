from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.link.messages import (
    NO_YAW,
    GlobalTarget,
    MavCommand,
    NedTarget,
    VelocityTarget,
    Yaw,
    towards,
)

mavlink = mavutil.mavlink
DRONE = Address(3, 1)

# Type masks as ArduPilot's documentation lists them: bits that are set are ignored.
USE_POSITION = 0b0000_1101_1111_1000
USE_VELOCITY = 0b0000_1101_1100_0111
YAW_BIT, RATE_BIT = 1 << 10, 1 << 11


def params(message: Any) -> list[float]:
    return [getattr(message, f"param{number}") for number in range(1, 8)]


@pytest.mark.parametrize(
    ("command", "number", "first"),
    [
        (messages.set_mode(4), mavlink.MAV_CMD_DO_SET_MODE, [1, 4]),
        (messages.arm(), mavlink.MAV_CMD_COMPONENT_ARM_DISARM, [1, 0]),
        (messages.disarm(False), mavlink.MAV_CMD_COMPONENT_ARM_DISARM, [0, 0]),
        (messages.disarm(True), mavlink.MAV_CMD_COMPONENT_ARM_DISARM, [0, 21196]),
        (messages.check_prearm(), mavlink.MAV_CMD_RUN_PREARM_CHECKS, []),
        (messages.takeoff(12.5), mavlink.MAV_CMD_NAV_TAKEOFF, [0, 0, 0, 0, 0, 0, 12.5]),
        (messages.takeoff(30, 15), mavlink.MAV_CMD_NAV_TAKEOFF, [15, 0, 0, 0, 0, 0, 30]),
        (messages.change_speed("air", 3), mavlink.MAV_CMD_DO_CHANGE_SPEED, [0, 3, -1]),
        (messages.change_speed("ground", 3), mavlink.MAV_CMD_DO_CHANGE_SPEED, [1, 3, -1]),
        (messages.change_speed("climb", 3), mavlink.MAV_CMD_DO_CHANGE_SPEED, [2, 3, -1]),
        (messages.change_speed("descent", 3), mavlink.MAV_CMD_DO_CHANGE_SPEED, [3, 3, -1]),
        (messages.set_home_here(), mavlink.MAV_CMD_DO_SET_HOME, [1]),
        (messages.yaw_to(359), mavlink.MAV_CMD_CONDITION_YAW, [359, 0, 0, 0]),
        (messages.pause(True), mavlink.MAV_CMD_DO_PAUSE_CONTINUE, [0]),
        (messages.pause(False), mavlink.MAV_CMD_DO_PAUSE_CONTINUE, [1]),
        (messages.set_servo(9, 1500), mavlink.MAV_CMD_DO_SET_SERVO, [9, 1500]),
        (messages.request_message(242), mavlink.MAV_CMD_REQUEST_MESSAGE, [242]),
        (messages.set_interval(33, 4), mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, [33, 250_000]),
    ],
    ids=lambda value: value.name if isinstance(value, MavCommand) else "",
)
def test_command_has_its_number_and_parameters(command: MavCommand, number: int, first: list[float]) -> None:
    message = command.to(DRONE, 2)
    assert (message.target_system, message.target_component) == DRONE
    assert (message.command, message.confirmation) == (number, 2)
    assert params(message) == first + [0] * (7 - len(first))


def test_only_the_harmless_is_repeatable_and_only_set_home_is_patient() -> None:
    assert not messages.takeoff(10).repeatable
    assert messages.arm().repeatable
    assert messages.set_home_here().patient
    assert not messages.arm().patient


def test_command_is_named_as_in_mavlink() -> None:
    assert messages.takeoff(10).name == "NAV_TAKEOFF"
    assert MavCommand(65000).name == "65000"


def test_ned_target_uses_the_position_only() -> None:
    message = NedTarget(1, 2, -3).to(DRONE, NO_YAW)
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert (message.target_system, message.target_component) == DRONE
    assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert message.type_mask == USE_POSITION
    assert (message.x, message.y, message.z) == (1, 2, -3)


def test_global_target_is_in_degrees_and_above_home() -> None:
    message = GlobalTarget(-35.1234567, 149.7654321, 20.5).to(DRONE, NO_YAW)
    assert message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
    assert (message.target_system, message.target_component) == DRONE
    assert message.coordinate_frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    assert message.type_mask == USE_POSITION
    assert (message.lat_int, message.lon_int, message.alt) == (-351234567, 1497654321, 20.5)


def test_velocity_target_uses_the_velocity_only() -> None:
    message = VelocityTarget(1, 2, -3).to(DRONE, NO_YAW)
    assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert message.type_mask == USE_VELOCITY
    assert (message.vx, message.vy, message.vz) == (1, 2, -3)
    assert (message.x, message.y, message.z) == (0, 0, 0)


@pytest.mark.parametrize("target", [NedTarget(1, 2, 3), GlobalTarget(1, 2, 3), VelocityTarget(1, 2, 3)])
def test_yaw_and_its_rate_are_used_when_given(target: Any) -> None:
    neither = target.to(DRONE, NO_YAW)
    heading = target.to(DRONE, Yaw(heading=1.5))
    rate = target.to(DRONE, Yaw(rate=0.25))
    assert neither.type_mask & (YAW_BIT | RATE_BIT) == YAW_BIT | RATE_BIT
    assert (heading.type_mask & (YAW_BIT | RATE_BIT), heading.yaw) == (RATE_BIT, 1.5)
    assert (rate.type_mask & (YAW_BIT | RATE_BIT), rate.yaw_rate) == (YAW_BIT, 0.25)


def test_heading_and_rate_of_zero_are_used_too() -> None:
    assert Yaw(heading=0.0).mask == RATE_BIT
    assert Yaw(rate=0.0).mask == YAW_BIT


@pytest.mark.parametrize(("north", "east", "degrees"), [(1, 0, 0), (0, 1, 90), (-1, 0, 180), (0, -1, -90)])
def test_towards_looks_along(north: float, east: float, degrees: float) -> None:
    assert towards(north, east).heading == pytest.approx(math.radians(degrees))


def test_towards_nowhere_is_no_yaw() -> None:
    assert towards(0.05, 0.05) is NO_YAW


def test_parameters_are_read_by_name_and_set_as_real() -> None:
    read, write = messages.read_parameter(DRONE, "RTL_ALT"), messages.set_parameter(DRONE, "RTL_ALT", 12.5)
    assert (read.target_system, read.param_id, read.param_index) == (3, "RTL_ALT", -1)
    assert (write.target_system, write.param_id, write.param_value) == (3, "RTL_ALT", 12.5)
    assert write.param_type == mavlink.MAV_PARAM_TYPE_REAL32


def test_ids_of_messages_are_known_by_name() -> None:
    assert messages.MESSAGE_IDS["GLOBAL_POSITION_INT"] == 33
