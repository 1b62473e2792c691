"""MISSION_ITEM with current 2 and 3: the old way to give the copter's GUIDED a target, as SITL takes it."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT
RELATIVE = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
GUIDED, ALTITUDE = 2, 3
LATITUDE, LONGITUDE = -35.363161, 149.165230
"""11.1 m north of home."""


def item(ground, current, command, place, frame=RELATIVE, parameters=(0.0, 0.0, 0.0, 0.0), integer=False):
    """The result of its MISSION_ACK."""
    ground.heard.clear()
    head = (1, 1, 0, frame, command, current, 1, *parameters)
    if integer:
        x, y = round(place[0] * 1e7), round(place[1] * 1e7)
        ground.send(mavlink.MAVLink_mission_item_int_message(*head, x, y, place[2]))
    else:
        ground.send(mavlink.MAVLink_mission_item_message(*head, *place))
    ground.run(0.01)
    return ground.of("MISSION_ACK")[0].type


@pytest.mark.parametrize("integer", [False, True])
@pytest.mark.parametrize(("frame", "altitude"), [(RELATIVE, 15.0), (mavlink.MAV_FRAME_GLOBAL, 599.0), (2, 599.0)])
def test_a_guided_waypoint_is_flown_to(flying, integer, frame, altitude):
    place = (LATITUDE, LONGITUDE, altitude)
    assert item(flying, GUIDED, WAYPOINT, place, frame, integer=integer) == mavlink.MAV_MISSION_ACCEPTED
    flying.run(12.0)
    # The floats of MISSION_ITEM round a longitude to about a metre.
    assert flying.body.position == pytest.approx((11.1, 0.0, -15.0), abs=0.1 if integer else 1.0)


def test_a_guided_yaw_turns_the_vehicle(flying):
    before = flying.heading
    turn = mavlink.MAV_CMD_CONDITION_YAW
    assert item(flying, GUIDED, turn, (0, 0, 0), 2, (90.0, 0.0, 1.0, 1.0)) == mavlink.MAV_MISSION_ACCEPTED
    flying.run(6.0)
    assert flying.heading == pytest.approx((before + 90) % 360, abs=1.0)


@pytest.mark.parametrize(
    ("command", "place", "result"),
    [
        (mavlink.MAV_CMD_NAV_LAND, (LATITUDE, LONGITUDE, 0.0), mavlink.MAV_MISSION_ERROR),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (LATITUDE, LONGITUDE, 20.0), mavlink.MAV_MISSION_ERROR),
        (mavlink.MAV_CMD_NAV_LOITER_UNLIM, (LATITUDE, LONGITUDE, 20.0), mavlink.MAV_MISSION_ERROR),
        (31000, (LATITUDE, LONGITUDE, 20.0), mavlink.MAV_MISSION_UNSUPPORTED),
        (WAYPOINT, (99.0, LONGITUDE, 20.0), mavlink.MAV_MISSION_INVALID_PARAM5_X),
        (WAYPOINT, (LATITUDE, LONGITUDE, math.nan), mavlink.MAV_MISSION_INVALID_PARAM7),
        (WAYPOINT, (LATITUDE, LONGITUDE, 83000.0), mavlink.MAV_MISSION_INVALID_PARAM7),
    ],
)
def test_other_guided_items_are_refused_and_change_nothing(flying, command, place, result):
    assert item(flying, GUIDED, command, place) == result
    flying.run(3.0)
    assert flying.body.position == pytest.approx((0.0, 0.0, -10.0), abs=0.1)


@pytest.mark.parametrize(
    ("parameters", "result"),
    [
        ((math.nan, 0.0, 0.0, 0.0), mavlink.MAV_MISSION_INVALID_PARAM1),
        ((0.0, math.inf, 0.0, 0.0), mavlink.MAV_MISSION_INVALID_PARAM2),
        ((0.0, 0.0, math.nan, 0.0), mavlink.MAV_MISSION_INVALID_PARAM3),
        ((0.0, 0.0, 0.0, -math.inf), mavlink.MAV_MISSION_INVALID_PARAM4),
        ((0.0, 0.0, 0.0, math.nan), mavlink.MAV_MISSION_ACCEPTED),
    ],
)
def test_only_the_yaw_of_a_waypoint_may_be_missing(flying, parameters, result):
    assert item(flying, GUIDED, WAYPOINT, (LATITUDE, LONGITUDE, 15.0), parameters=parameters) == result


@pytest.mark.parametrize("current", [GUIDED, ALTITUDE])
def test_a_local_frame_is_refused(flying, current):
    place = (LATITUDE, LONGITUDE, 15.0)
    result = item(flying, current, WAYPOINT, place, mavlink.MAV_FRAME_LOCAL_NED)
    assert result == mavlink.MAV_MISSION_UNSUPPORTED_FRAME


def test_a_command_without_a_place_may_have_anything_there(flying):
    turn = mavlink.MAV_CMD_CONDITION_YAW
    assert item(flying, GUIDED, turn, (500.0, 500.0, math.nan), 77) == mavlink.MAV_MISSION_ACCEPTED


def test_floats_are_warned_of_once_in_an_upload_only(flying):
    item(flying, GUIDED, WAYPOINT, (LATITUDE, LONGITUDE, 15.0))
    flying.run(0.02)
    warning = "got MISSION_ITEM; GCS should send MISSION_ITEM_INT"
    assert warning not in flying.texts()
    heard = []
    for _ in range(2):
        assert item(flying, 0, WAYPOINT, (LATITUDE, LONGITUDE, 15.0)) == mavlink.MAV_MISSION_ERROR
        flying.run(0.02)
        heard += flying.texts()
    assert heard.count(warning) == 1


def test_a_guided_waypoint_outside_guided_is_refused(flying):
    flying.mode(17)
    assert item(flying, GUIDED, WAYPOINT, (LATITUDE, LONGITUDE, 15.0)) == mavlink.MAV_MISSION_ERROR


@pytest.mark.parametrize("number", [4, 17])
def test_an_altitude_is_acknowledged_and_does_nothing(flying, number):
    flying.mode(number)
    assert item(flying, ALTITUDE, WAYPOINT, (0.0, 0.0, 20.0)) == mavlink.MAV_MISSION_ACCEPTED
    flying.run(3.0)
    assert flying.body.down == pytest.approx(-10.0, abs=0.1)


def test_a_guided_item_does_not_disturb_an_upload(flying):
    flying.send(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    flying.run(0.02)
    assert item(flying, GUIDED, WAYPOINT, (LATITUDE, LONGITUDE, 15.0)) == mavlink.MAV_MISSION_ACCEPTED
    home = (-35.0, 149.0, 0.0)
    assert item(flying, 0, WAYPOINT, home, mavlink.MAV_FRAME_GLOBAL, integer=True) == mavlink.MAV_MISSION_ACCEPTED
    assert len(flying.copter.mission.items) == 1
