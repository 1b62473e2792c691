"""GUIDED of the copter: its setpoints, and the commands that it takes, as SITL flies them."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.geodesy import Ned, from_ned
from tests.uavapi.sim.conftest import STEP

VELOCITY_ONLY = 0b110111000111
YAW_ONLY = 0b100111111111
YAW_RATE_ONLY = 0b010111111111
ACCELERATION_ONLY = 0b110000111111
POSITION_AND_VELOCITY = 0b110111000000
POSITION_AND_YAW = 0b100111111000
VELOCITY_AND_YAW_RATE = 0b010111000111
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF


def test_takeoff_only_armed_and_in_guided(ground):
    ground.run(6.0)
    ground.mode(4)
    assert ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10) == mavlink.MAV_RESULT_FAILED
    ground.mode(0)
    ground.arm()
    assert ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10) == mavlink.MAV_RESULT_FAILED
    ground.mode(4)
    assert ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, -1) == mavlink.MAV_RESULT_FAILED
    assert ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10) == mavlink.MAV_RESULT_ACCEPTED
    ground.run(20.0)
    assert ground.body.down == pytest.approx(-10.0, abs=0.05)
    assert ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 20) == mavlink.MAV_RESULT_FAILED


def test_takeoff_goes_through_landed_states(ground):
    ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 100000)
    ground.fly(5.0)
    ground.run(0.2)
    ground.command(mavlink.MAV_CMD_NAV_LAND)
    ground.run(20.0)
    states = [m.landed_state for m in ground.of("EXTENDED_SYS_STATE")]
    assert mavlink.MAV_LANDED_STATE_IN_AIR in states
    assert states[-1] == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert mavlink.MAV_LANDED_STATE_LANDING in states


@pytest.mark.parametrize(
    ("frame", "vector", "expected"),
    [
        (mavlink.MAV_FRAME_LOCAL_NED, (20.0, -10.0, -15.0), (20.0, -10.0, -15.0)),
        (mavlink.MAV_FRAME_LOCAL_OFFSET_NED, (20.0, -10.0, -5.0), (20.0, -10.0, -15.0)),
        (mavlink.MAV_FRAME_BODY_OFFSET_NED, (10.0, 0.0, 0.0), (0.0, 10.0, -10.0)),
        (mavlink.MAV_FRAME_BODY_NED, (0.0, 10.0, 0.0), (-10.0, 0.0, -10.0)),
    ],
)
def test_position_setpoints_in_local_frames(flying, frame, vector, expected):
    flying.command(mavlink.MAV_CMD_CONDITION_YAW, 90, 0, 0, 0)
    flying.run(5.0)
    flying.local(vector, frame=frame)
    flying.run(20.0)
    assert flying.body.position == pytest.approx(expected, abs=0.25)


@pytest.mark.parametrize(
    ("frame", "altitude"),
    [(0, 604.0), (5, 604.0), (3, 20.0), (6, 20.0), (10, 20.0), (11, 20.0)],
)
def test_position_setpoints_in_global_frames(flying, frame, altitude):
    place = from_ned(flying.copter.estimator.origin, Ned(30.0, 40.0, 0.0))
    flying.send(
        mavlink.MAVLink_set_position_target_global_int_message(
            0,
            1,
            1,
            frame,
            0b110111111000,
            round(place.latitude * 1e7),
            round(place.longitude * 1e7),
            altitude,
            *([0.0] * 8),
        )
    )
    flying.run(20.0)
    assert flying.body.position == pytest.approx((30.0, 40.0, -20.0), abs=0.1)


def test_position_move_reaches_wpnav_speed_and_overshoots_as_sitls(flying):
    flying.local((150.0, 0.0, -10.0))
    fastest = farthest = 0.0
    for _ in range(400):
        flying.run(0.1)
        fastest, farthest = max(fastest, flying.body.velocity_north), max(farthest, flying.body.north)
    assert fastest == pytest.approx(10.0, abs=0.3)
    assert farthest < 151.0
    assert flying.body.north == pytest.approx(150.0, abs=0.1)


def test_a_new_target_in_flight_blends_without_a_jump_in_acceleration(flying):
    flying.local((100.0, 0.0, -10.0))
    flying.run(5.0)
    flying.local((0.0, 100.0, -10.0))
    before = flying.body.velocity
    for _ in range(25):
        flying.run(STEP)
        assert math.dist(flying.body.velocity, before) / STEP < 4.0
        before = flying.body.velocity
    flying.run(30.0)
    assert flying.body.position == pytest.approx((0.0, 100.0, -10.0), abs=0.1)


def test_velocity_setpoints_expire(flying):
    flying.local((0.0, 4.0, 0.0), VELOCITY_ONLY)
    flying.run(2.5)
    assert flying.body.velocity_east == pytest.approx(4.0, abs=0.3)
    flying.run(5.0)
    assert flying.body.velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.2)


def test_velocity_in_the_body_frame_turns_with_the_nose(flying):
    flying.command(mavlink.MAV_CMD_CONDITION_YAW, 180, 0, 0, 0)
    flying.run(6.0)
    flying.local((3.0, 0.0, 0.0), VELOCITY_ONLY, frame=mavlink.MAV_FRAME_BODY_NED)
    flying.run(2.5)
    assert flying.body.velocity_north == pytest.approx(-3.0, abs=0.3)


def test_acceleration_setpoints_accelerate_and_expire(flying):
    flying.local((0.0, 0.0, 0.0), ACCELERATION_ONLY, acceleration=(1.0, 0.0, 0.0))
    flying.run(2.0)
    assert flying.body.velocity_north == pytest.approx(2.0, abs=0.4)
    flying.run(8.0)
    assert flying.body.velocity_north == pytest.approx(0.0, abs=0.2)


def test_position_with_velocity_follows_a_moving_target(flying):
    flying.local((0.0, 0.0, -10.0), POSITION_AND_VELOCITY, velocity=(2.0, 0.0, 0.0))
    flying.run(2.9)
    assert flying.body.velocity_north == pytest.approx(2.0, abs=1.0)
    flying.run(8.0)
    assert flying.body.velocity_north == pytest.approx(0.0, abs=0.1)


def test_yaw_fields_turn_the_vehicle(flying):
    flying.local((0.0, 0.0, -10.0), POSITION_AND_YAW, yaw=math.radians(120))
    flying.run(5.0)
    assert flying.heading == pytest.approx(120.0, abs=1.0)
    flying.local((0.0, 0.0, 0.0), VELOCITY_AND_YAW_RATE, yaw_rate=math.radians(20))
    flying.run(2.0)
    assert flying.heading == pytest.approx(160.0, abs=3.0)
    flying.run(3.0)
    stopped_at = flying.heading
    flying.run(2.0)
    assert flying.heading == pytest.approx(stopped_at, abs=1.0)


@pytest.mark.parametrize("mask", [YAW_ONLY, YAW_RATE_ONLY])
def test_a_yaw_alone_stops_the_vehicle_as_in_arducopter(flying, mask):
    flying.local((100.0, 0.0, -10.0))
    flying.run(4.0)
    flying.local((0.0, 0.0, 0.0), mask, yaw=1.5, yaw_rate=1.0)
    flying.run(10.0)
    assert flying.body.velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.1)
    assert flying.body.north < 60.0


@pytest.mark.parametrize("velocity", [(float("nan"), 0.0, 0.0), (0.0, 2000.0, 0.0)])
def test_a_nonsense_velocity_stops_the_vehicle(flying, velocity):
    flying.local((3.0, 0.0, 0.0), VELOCITY_ONLY)
    flying.run(1.5)
    flying.local(velocity, VELOCITY_ONLY)
    flying.run(4.0)
    assert flying.body.velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.2)


def test_setpoints_outside_guided_and_on_the_ground_do_nothing(ground):
    ground.run(6.0)
    ground.mode(4)
    ground.arm()
    ground.local((10.0, 0.0, -10.0))
    ground.run(5.0)
    assert ground.body.position == (0.0, 0.0, 0.0)
    ground.mode(5)
    ground.local((10.0, 0.0, -10.0))
    ground.run(1.0)
    assert ground.body.position == (0.0, 0.0, 0.0)


def test_reposition_needs_command_int_and_the_mode_or_the_flag(flying):
    place = from_ned(flying.copter.estimator.origin, Ned(20.0, 0.0, 0.0))
    where = (round(place.latitude * 1e7), round(place.longitude * 1e7), 12.0)
    reposition = mavlink.MAV_CMD_DO_REPOSITION
    assert flying.command(reposition, -1, 0, 0, 0, place.latitude, place.longitude, 12) == 3
    flying.mode(17)
    assert flying.command_int(reposition, 3, (-1, 0, 0, 0), where) == mavlink.MAV_RESULT_DENIED
    assert flying.command_int(reposition, 3, (-1, 1, 0, 0), where) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(12.0)
    assert flying.copter.mode.name == "GUIDED"
    assert flying.body.position == pytest.approx((20.0, 0.0, -12.0), abs=0.2)
    assert flying.command_int(reposition, 3, (-1, 1, 0, 0), (999999999, 0, 1.0)) == mavlink.MAV_RESULT_DENIED


@pytest.mark.parametrize(
    ("start", "parameters", "end"),
    [
        (0, (90, 0, 0, 0), 90),
        (0, (90, 0, -1, 0), 90),
        (350, (20, 0, 1, 1), 10),
        (10, (20, 0, -1, 1), 350),
    ],
)
def test_condition_yaw_directions_and_relative_angles(flying, start, parameters, end):
    flying.copter.body.yaw = math.radians(start)
    assert flying.command(mavlink.MAV_CMD_CONDITION_YAW, *parameters) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(10.0)
    assert flying.heading == pytest.approx(end, abs=1.0)


def test_condition_yaw_the_long_way_takes_longer_and_keeps_its_speed(flying):
    flying.copter.body.yaw = 0.0
    flying.command(mavlink.MAV_CMD_CONDITION_YAW, 90, 30, -1, 0)
    flying.run(3.0)
    assert flying.heading == pytest.approx(270.0, abs=8.0)
    assert flying.command(mavlink.MAV_CMD_CONDITION_YAW, 400, 0, 0, 0) == mavlink.MAV_RESULT_FAILED


def test_change_speed_limits_a_move_until_the_kind_of_setpoint_changes(flying):
    flying.local((0.0, 0.0, -10.0))
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 3) == mavlink.MAV_RESULT_ACCEPTED
    flying.local((100.0, 0.0, -10.0))
    flying.run(6.0)
    assert flying.body.velocity_north == pytest.approx(3.0, abs=0.1)
    flying.local((0.0, 0.0, 0.0), VELOCITY_ONLY)
    flying.local((100.0, 0.0, -10.0))
    flying.run(5.0)
    assert flying.body.velocity_north > 5.0
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 0) == mavlink.MAV_RESULT_DENIED
    flying.mode(9)
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 3) == mavlink.MAV_RESULT_FAILED


def test_pause_holds_even_against_new_targets_until_resume(flying):
    pause = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
    flying.local((100.0, 0.0, -10.0))
    flying.run(4.0)
    assert flying.command(pause, 0) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(10.0)
    held = flying.body.position
    flying.local((0.0, 50.0, -10.0))
    flying.run(3.0)
    assert flying.body.position == pytest.approx(held, abs=0.1)
    assert flying.command(pause, 1) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(25.0)
    assert flying.body.position == pytest.approx((0.0, 50.0, -10.0), abs=0.1)
    flying.mode(5)
    assert flying.command(pause, 0) == mavlink.MAV_RESULT_FAILED


def test_flying_down_into_the_ground_lands_and_disarms(flying):
    for _ in range(40):
        flying.local((0.0, 0.0, 1.5), VELOCITY_ONLY)
        flying.run(0.5)
    assert flying.copter.landed
    flying.run(12.0)
    assert not flying.copter.armed


def test_the_nose_follows_the_way_unless_commanded_otherwise(flying):
    flying.local((0.0, 60.0, -10.0))
    flying.run(5.0)
    assert flying.heading == pytest.approx(90.0, abs=2.0)
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_YAW_BEHAVIOR", 0.0, 2))
    flying.local((0.0, -60.0, -10.0))
    flying.run(8.0)
    assert flying.heading == pytest.approx(90.0, abs=2.0)


@pytest.mark.parametrize(("x", "y", "z"), [(0, 0, 12.0), (-353632610, 1491652300, 0.0)])
def test_a_reposition_to_no_place_or_height_is_denied(flying, x, y, z):
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    result = flying.command_int(mavlink.MAV_CMD_DO_REPOSITION, frame, (-1, 0, 0, 0), (x, y, z))
    assert result == mavlink.MAV_RESULT_DENIED
    flying.run(2.0)
    assert flying.body.position == pytest.approx((0.0, 0.0, -10.0), abs=0.1)


def test_a_reposition_in_a_local_frame_is_denied_with_a_text(flying):
    where = (-353631610, 1491652300, 10.0)
    assert flying.command_int(mavlink.MAV_CMD_DO_REPOSITION, 1, (-1, 1, 0, 0), where) == mavlink.MAV_RESULT_DENIED
    flying.run(0.02)
    assert "Unknown mavlink coordinate frame 1" in flying.texts()


@pytest.mark.parametrize(("flags", "result"), [(0, mavlink.MAV_RESULT_DENIED), (1, mavlink.MAV_RESULT_ACCEPTED)])
def test_a_reposition_leaves_another_mode_only_with_its_flag(flying, flags, result):
    flying.mode(17)
    where = (-353631610, 1491652300, 10.0)
    assert flying.command_int(mavlink.MAV_CMD_DO_REPOSITION, 3, (-1, flags, 0, 0), where) == result
    flying.run(12.0)
    assert flying.body.north == pytest.approx(11.1 if flags else 0.0, abs=0.2)


def test_a_reposition_does_not_end_a_pause(flying):
    flying.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    where = (-353631610, 1491652300, 10.0)
    reposition = mavlink.MAV_CMD_DO_REPOSITION
    assert flying.command_int(reposition, 3, (-1, 1, 0, 0), where) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(3.0)
    assert flying.body.position == pytest.approx((0.0, 0.0, -10.0), abs=0.1)
    flying.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1)
    flying.run(10.0)
    assert flying.body.north == pytest.approx(11.1, abs=0.2)


def test_a_yaw_rate_is_held_to_the_slew_limit(flying):
    before = flying.heading
    flying.local((0.0, 0.0, 0.0), VELOCITY_AND_YAW_RATE, yaw_rate=2.0)
    flying.run(2.0)
    assert 90.0 < (flying.heading - before) % 360 < 121.0


def test_brake_does_not_turn(flying):
    flying.mode(17)
    before = flying.heading
    assert flying.command(mavlink.MAV_CMD_CONDITION_YAW, 90, 0, 1, 1) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(3.0)
    assert flying.heading == pytest.approx(before, abs=0.5)


@pytest.mark.parametrize(
    ("number", "taken"), [(0, False), (2, False), (5, False), (9, False), (17, False), (4, True), (6, True)]
)
def test_only_modes_with_a_speed_of_their_own_take_one(flying, number, taken):
    flying.mode(number)
    expected = mavlink.MAV_RESULT_ACCEPTED if taken else mavlink.MAV_RESULT_FAILED
    for kind in range(4):
        assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, kind, 3) == expected
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 4, 3) == mavlink.MAV_RESULT_DENIED
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 5, 3) == mavlink.MAV_RESULT_FAILED


def test_one_vertical_speed_resets_the_other(flying):
    flying.local((0.0, 0.0, -10.0))
    flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 2, 1)
    flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 3, 0.5)
    limits = flying.copter.position.limits
    assert (limits.speed_up, limits.speed_down) == (2.5, 0.5)
    flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 2, 1)
    assert (limits.speed_up, limits.speed_down) == (1.0, 1.5)


def test_the_speed_for_a_takeoff_is_the_one_set_in_guided_before_it(ground):
    ground.run(6.0)
    ground.mode(4)
    ground.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 2, 1)
    ground.arm()
    ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10)
    ground.run(9.0)
    assert ground.body.velocity_down == pytest.approx(-1.0, abs=0.1)


def test_a_short_timeout_ends_velocity_and_yaw_rate(flying):
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"GUID_TIMEOUT", 1.0, 9))
    flying.local((2.0, 0.0, 0.0), VELOCITY_AND_YAW_RATE, yaw_rate=0.5)
    flying.run(0.9)
    assert flying.body.yaw_rate == pytest.approx(0.5, abs=0.05)
    flying.run(3.0)
    assert flying.body.yaw_rate == pytest.approx(0.0, abs=0.05)
    assert flying.body.velocity_north == pytest.approx(0.0, abs=0.3)
