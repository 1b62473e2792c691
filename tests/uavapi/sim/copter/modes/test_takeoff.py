"""The first second of the copter's takeoff, in which the motors run up and the vehicle still stands."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
VELOCITY_SETPOINT = 0x0DC7
ON_GROUND = mavlink.MAV_LANDED_STATE_ON_GROUND
IDLE_PULSE = 1100
STOPPED_PULSE = 1000


def landed_state(ground):
    return ground.simulator.telemetry.build("EXTENDED_SYS_STATE").landed_state


def system_status(ground):
    return ground.simulator.telemetry.build("HEARTBEAT").system_status


def motor_pulse(ground):
    return ground.simulator.telemetry.build("SERVO_OUTPUT_RAW").servo1_raw


@pytest.fixture
def starting(standing):
    """Four tenths of a second into a takeoff."""
    assert standing.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10) == mavlink.MAV_RESULT_ACCEPTED
    standing.run(0.4)
    return standing


def test_the_vehicle_counts_as_landed_until_it_leaves_the_ground(starting):
    assert (landed_state(starting), system_status(starting)) == (ON_GROUND, mavlink.MAV_STATE_STANDBY)
    starting.run(1.2)
    assert landed_state(starting) == mavlink.MAV_LANDED_STATE_TAKEOFF
    assert system_status(starting) == mavlink.MAV_STATE_ACTIVE
    starting.run(10.0)
    assert landed_state(starting) == mavlink.MAV_LANDED_STATE_IN_AIR


def test_motors_idle_when_armed_after_the_arming_delay(ground):
    ground.run(6.0)
    assert motor_pulse(ground) == STOPPED_PULSE
    ground.mode(4)
    ground.arm()
    ground.run(1.0)
    assert motor_pulse(ground) == STOPPED_PULSE
    ground.run(2.0)
    assert motor_pulse(ground) == IDLE_PULSE


@pytest.mark.parametrize(
    "hold",
    [
        lambda ground: ground.local((0.0, 0.0, 0.0), VELOCITY_SETPOINT),
        lambda ground: ground.local((5.0, 0.0, -10.0)),
        lambda ground: ground.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0),
        lambda ground: ground.mode(17),
        lambda ground: ground.mode(5),
    ],
    ids=["zero velocity", "position", "pause", "BRAKE", "LOITER"],
)
def test_a_hold_keeps_it_on_the_ground_with_motors_idle(starting, hold):
    hold(starting)
    starting.run(6.0)
    assert starting.body.down == 0.0
    assert (landed_state(starting), system_status(starting)) == (ON_GROUND, mavlink.MAV_STATE_STANDBY)
    assert starting.copter.armed
    assert motor_pulse(starting) == IDLE_PULSE


def test_a_landing_disarms_it_where_it_stands(starting):
    assert starting.mode(9) == mavlink.MAV_RESULT_ACCEPTED
    starting.run(1.0)
    assert not starting.copter.armed
    assert starting.body.down == 0.0
    assert motor_pulse(starting) == STOPPED_PULSE


def test_it_may_be_disarmed_and_sent_up_higher(starting):
    assert starting.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 20) == mavlink.MAV_RESULT_ACCEPTED
    assert starting.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mavlink.MAV_RESULT_ACCEPTED
    assert not starting.copter.armed


def test_a_hold_in_the_climb_stops_it_in_the_air(starting):
    starting.run(4.0)
    starting.local((0.0, 0.0, 0.0), VELOCITY_SETPOINT)
    starting.run(5.0)
    assert -10.0 < starting.body.down < -2.0
    assert landed_state(starting) == mavlink.MAV_LANDED_STATE_IN_AIR
