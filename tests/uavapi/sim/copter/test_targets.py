"""POSITION_TARGET_LOCAL_NED and POSITION_TARGET_GLOBAL_INT in each mode of the copter, as SITL sends them."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

POSITION = 0x0DF8
POSITION_VELOCITY_ACCELERATION = 0x0C00
VELOCITY_AND_ACCELERATION = 0x0C07
ACCELERATION = 0x0C3F
GLOBAL_POSITION = 0xFDF8
VELOCITY_SETPOINT = 0x0DC7
ACCELERATION_SETPOINT = 0x0C3F
POSITION_AND_VELOCITY_SETPOINT = 0x0DC0
ALL_BUT_YAW_SETPOINT = 0x0C00
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
LOCAL, GLOBAL = "POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT"


def requested(ground, name):
    """What REQUEST_MESSAGE brings: the message, or None; it is accepted in either case."""
    ground.heard.clear()
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    assert ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number) == mavlink.MAV_RESULT_ACCEPTED
    return next(iter(ground.of(name)), None)


def local_target(ground):
    """Mask, position and velocity of POSITION_TARGET_LOCAL_NED."""
    target = requested(ground, LOCAL)
    assert target.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    return target.type_mask, (target.x, target.y, target.z), (target.vx, target.vy, target.vz)


@pytest.mark.parametrize("number", [0, 5, 6, 9, 17])
def test_no_local_target_outside_guided(flying, number):
    flying.local((5.0, 0.0, -10.0))
    flying.mode(number)
    assert requested(flying, LOCAL) is None


@pytest.mark.parametrize("number", [0, 5, 9, 17])
def test_modes_without_a_waypoint_send_no_global_target(flying, number):
    flying.local((5.0, 0.0, -10.0))
    flying.mode(number)
    assert requested(flying, GLOBAL) is None


def test_a_takeoff_reports_zeros_before_any_position_was_flown(flying):
    assert local_target(flying) == (POSITION, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert requested(flying, GLOBAL) is None


def test_a_takeoff_reports_the_position_flown_last(flying):
    flying.local((5.0, 0.0, -12.0))
    flying.run(5.0)
    flying.mode(9)
    flying.run(40.0)
    flying.mode(4)
    flying.arm()
    assert local_target(flying)[0] == VELOCITY_AND_ACCELERATION
    assert flying.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 5) == mavlink.MAV_RESULT_ACCEPTED
    assert local_target(flying) == (POSITION, (5.0, 0.0, -12.0), (0.0, 0.0, 0.0))
    assert requested(flying, GLOBAL) is None


@pytest.mark.parametrize("mask", [VELOCITY_SETPOINT, ACCELERATION_SETPOINT])
def test_a_velocity_or_acceleration_forgets_the_position(flying, mask):
    flying.local((5.0, 0.0, -12.0))
    flying.local((0.0, 0.0, 0.0), mask)
    flying.mode(9)
    flying.run(40.0)
    flying.mode(4)
    flying.arm()
    flying.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 5)
    assert local_target(flying) == (POSITION, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_a_position_is_reported_in_both_messages(flying):
    flying.local((10.0, 0.0, -12.0))
    assert local_target(flying) == (POSITION, (10.0, 0.0, -12.0), (0.0, 0.0, 0.0))
    target = requested(flying, GLOBAL)
    assert (target.coordinate_frame, target.type_mask) == (mavlink.MAV_FRAME_GLOBAL, GLOBAL_POSITION)
    assert target.alt == pytest.approx(596.0, abs=0.02)
    assert target.lat_int == pytest.approx(-353632610 + 898, abs=2)


def test_a_velocity_is_reported_until_it_expires(flying):
    flying.local((1.0, 0.0, 0.0), VELOCITY_SETPOINT)
    assert local_target(flying) == (VELOCITY_AND_ACCELERATION, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert requested(flying, GLOBAL) is None
    flying.run(3.5)
    assert local_target(flying) == (VELOCITY_AND_ACCELERATION, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_an_acceleration_keeps_its_kind_when_it_expires(flying):
    flying.local((0.0, 0.0, 0.0), ACCELERATION_SETPOINT, acceleration=(0.5, 0.0, 0.0))
    assert requested(flying, LOCAL).afx == 0.5
    flying.run(3.5)
    target = requested(flying, LOCAL)
    assert (target.type_mask, target.afx) == (ACCELERATION, 0.0)


@pytest.mark.parametrize("mask", [POSITION_AND_VELOCITY_SETPOINT, ALL_BUT_YAW_SETPOINT])
def test_a_position_with_a_velocity_reports_all_and_moves_along(flying, mask):
    flying.local((12.0, 0.0, -12.0), mask, velocity=(1.0, 0.0, 0.0))
    flying.run(2.0)
    type_mask, position, velocity = local_target(flying)
    assert type_mask == POSITION_VELOCITY_ACCELERATION
    assert position == pytest.approx((14.0, 0.0, -12.0), abs=0.05)
    assert velocity == (1.0, 0.0, 0.0)
    assert requested(flying, GLOBAL) is None


def test_a_pause_does_not_change_what_is_reported(flying):
    flying.local((5.0, 0.0, -12.0))
    flying.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    flying.local((6.0, 0.0, -12.0))
    assert local_target(flying) == (POSITION, (6.0, 0.0, -12.0), (0.0, 0.0, 0.0))
    assert requested(flying, GLOBAL) is not None


def test_rtl_reports_the_climb_the_return_and_nothing_when_it_lands(flying):
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_ALT_FINAL_M", 5.0, 9))
    flying.local((40.0, 0.0, -10.0))
    flying.run(12.0)
    flying.mode(6)
    flying.run(1.0)
    assert requested(flying, GLOBAL).lat_int == pytest.approx(-353632610 + 3593, abs=20)
    flying.run(25.0)
    target = requested(flying, GLOBAL)
    assert flying.body.down > -10.0
    assert target.lat_int == pytest.approx(-353632610, abs=5)
    # The final descent is not flown by the waypoint controller, whose target stays at the height of the return.
    assert target.alt == pytest.approx(599.0, abs=0.1)


def test_global_target_is_in_the_extended_status_and_the_local_nowhere(flying):
    flying.local((10.0, 0.0, -12.0))
    flying.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 5, 1))
    flying.run(2.0)
    assert len(flying.of(GLOBAL)) >= 8
    assert not flying.of(LOCAL)
    flying.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, 100000)
    flying.run(2.0)
    assert len(flying.of(LOCAL)) >= 19
