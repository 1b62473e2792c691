"""MAV_CMD_DO_PAUSE_CONTINUE through `commands.py`, GUIDED and AUTO of the copter, as SITL answers it."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.mission import Item

PAUSE = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
VELOCITY_SETPOINT = 0x0DC7
ACCEPTED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED


def take_off(ground, altitude=10):
    return ground.command(TAKEOFF, 0, 0, 0, 0, 0, 0, altitude)


def test_a_pause_on_the_ground_keeps_takeoffs_from_starting(standing):
    assert standing.command(PAUSE, 0) == ACCEPTED
    assert take_off(standing) == ACCEPTED
    standing.run(3.0)
    assert standing.copter.landed
    assert standing.mode(4) == ACCEPTED
    standing.run(2.0)
    assert standing.copter.landed
    assert standing.command(PAUSE, 1) == ACCEPTED
    standing.run(5.0)
    assert standing.body.down < -2.0


def test_a_pause_outlives_a_disarming(standing):
    standing.command(PAUSE, 0)
    standing.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert standing.arm() == ACCEPTED
    standing.run(3.0)
    take_off(standing)
    standing.run(5.0)
    assert standing.copter.landed


def test_entering_guided_from_another_mode_ends_a_pause(standing):
    standing.command(PAUSE, 0)
    standing.mode(5)
    standing.mode(4)
    take_off(standing)
    standing.run(5.0)
    assert standing.body.down < -2.0


def test_a_pause_in_a_climb_stops_it_and_continuing_ends_it(standing):
    take_off(standing, 15)
    standing.run(4.0)
    standing.command(PAUSE, 0)
    standing.run(3.0)
    held = standing.body.down
    assert -14.0 < held < -1.0
    standing.run(2.0)
    assert standing.body.down == pytest.approx(held, abs=0.05)
    assert standing.simulator.telemetry.build("EXTENDED_SYS_STATE").landed_state == mavlink.MAV_LANDED_STATE_TAKEOFF
    standing.command(PAUSE, 1)
    standing.run(12.0)
    assert standing.body.down == pytest.approx(-15.0, abs=0.1)


def test_a_nonsense_setpoint_ends_a_pause(flying):
    flying.command(PAUSE, 0)
    flying.local((math.nan, 0.0, 0.0), VELOCITY_SETPOINT)
    flying.local((20.0, 0.0, -10.0))
    flying.run(4.0)
    assert flying.body.north > 3.0


def test_a_velocity_that_expires_in_a_pause_is_not_flown_after_it(flying):
    flying.local((3.0, 0.0, 0.0), VELOCITY_SETPOINT)
    flying.run(0.5)
    flying.command(PAUSE, 0)
    flying.run(4.0)
    flying.command(PAUSE, 1)
    flying.run(1.0)
    assert flying.body.velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.1)


def test_a_yaw_waits_for_the_end_of_a_pause(flying):
    before = flying.heading
    flying.command(PAUSE, 0)
    flying.command(mavlink.MAV_CMD_CONDITION_YAW, 40, 0, 1, 1)
    flying.run(3.0)
    assert flying.heading == pytest.approx(before, abs=0.5)
    flying.command(PAUSE, 1)
    flying.run(4.0)
    assert flying.heading == pytest.approx((before + 40) % 360, abs=1.0)


@pytest.mark.parametrize("number", [0, 5, 6, 9, 17])
def test_other_modes_neither_pause_nor_continue(flying, number):
    flying.mode(number)
    assert flying.command(PAUSE, 0) == FAILED
    assert flying.command(PAUSE, 1) == FAILED
    flying.run(0.02)
    assert {"Failed to pause", "Failed to resume"} <= set(flying.texts())


def test_what_is_neither_pause_nor_continue_is_denied(flying):
    assert flying.command(PAUSE, 2) == mavlink.MAV_RESULT_DENIED


@pytest.fixture
def on_mission(ground):
    """Climbing at the start of a mission: 60 m north, and stay there."""
    ground.run(6.0)
    north = round((ground.copter.home.latitude + 60 / 111319.5) * 1e7)
    east = round(ground.copter.home.longitude * 1e7)
    ground.copter.mission.replace(
        [
            Item(mavlink.MAV_CMD_NAV_WAYPOINT, 0, 0, 0, 0, 0, 0, 0, 0),
            Item(TAKEOFF, 3, 0, 0, 0, 0, 0, 0, 10),
            Item(mavlink.MAV_CMD_NAV_LOITER_UNLIM, 3, 0, 0, 0, 0, north, east, 10),
        ]
    )
    ground.mode(4)
    ground.arm()
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    ground.run(4.0)
    return ground


def test_a_mission_pauses_on_a_leg_only(on_mission):
    assert on_mission.command(PAUSE, 0) == FAILED
    on_mission.run(8.0)
    assert on_mission.body.north > 1.0
    assert on_mission.command(PAUSE, 0) == ACCEPTED
    on_mission.run(5.0)
    held = on_mission.body.north
    assert on_mission.mode(3) == ACCEPTED
    on_mission.run(3.0)
    assert on_mission.body.north == pytest.approx(held, abs=0.1)
    assert on_mission.simulator.telemetry.build("MISSION_CURRENT").mission_state == mavlink.MISSION_STATE_PAUSED
    assert on_mission.command(PAUSE, 1) == ACCEPTED
    on_mission.run(20.0)
    assert on_mission.body.north == pytest.approx(60.0, abs=0.5)
    assert on_mission.command(PAUSE, 0) == FAILED


def test_coming_back_to_auto_ends_a_pause(on_mission):
    on_mission.run(8.0)
    assert on_mission.command(PAUSE, 0) == ACCEPTED
    on_mission.mode(17)
    on_mission.mode(3)
    on_mission.run(5.0)
    assert on_mission.body.velocity_north > 1.0


def test_a_mission_reports_the_waypoint_of_a_leg_only(on_mission):
    assert on_mission.simulator.telemetry.build("POSITION_TARGET_GLOBAL_INT") is None
    on_mission.run(8.0)
    target = on_mission.simulator.telemetry.build("POSITION_TARGET_GLOBAL_INT")
    assert target.lat_int == pytest.approx(-353632610 + 5390, abs=5)
    assert on_mission.simulator.telemetry.build("POSITION_TARGET_LOCAL_NED") is None
