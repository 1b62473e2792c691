import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options
from mavproxy_uavapi.sim.mission import Item

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK


def prearm_healthy(ground):
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    return bool(ground.of("SYS_STATUS")[-1].onboard_control_sensors_health & PREARM)


def test_arming_before_the_estimator_is_ready_fails_and_says_why(ground):
    ground.run(1.0)
    assert ground.arm() == mavlink.MAV_RESULT_FAILED
    ground.run(0.02)
    assert "Arm: AHRS: EKF3 still initialising" in ground.texts()
    assert not prearm_healthy(ground)


def test_guided_needs_a_position_to_arm_even_when_forced(ground):
    ground.run(3.0)
    ground.mode(4)
    assert ground.command(ARM, 1, 21196) == mavlink.MAV_RESULT_FAILED
    ground.run(0.02)
    assert "Arm: Need Position Estimate" in ground.texts()


def test_once_ready_it_arms_and_the_prearm_bit_is_healthy(ground):
    ground.run(6.0)
    assert prearm_healthy(ground)
    assert ground.arm() == mavlink.MAV_RESULT_ACCEPTED
    ground.run(0.02)
    assert "Arming motors" in ground.texts()


def test_the_time_until_ready_is_an_option(new_ground):
    ground = new_ground(Options(ready_after=20.0))
    ground.run(15.0)
    assert ground.arm() == mavlink.MAV_RESULT_FAILED
    ground.run(6.0)
    assert ground.arm() == mavlink.MAV_RESULT_ACCEPTED


def test_auto_without_a_mission_is_entered_on_the_ground_but_does_not_arm(ground):
    ground.run(6.0)
    assert ground.mode(3) == mavlink.MAV_RESULT_ACCEPTED
    assert ground.arm() == mavlink.MAV_RESULT_FAILED
    ground.run(0.02)
    assert "Arm: Mode requires mission" in ground.texts()


@pytest.mark.parametrize(("number", "name"), [(3, "AUTO"), (6, "RTL"), (9, "LAND"), (17, "BRAKE")])
def test_some_modes_do_not_arm(ground, number, name):
    ground.run(6.0)
    ground.copter.mission.items = [Item(mavlink.MAV_CMD_NAV_TAKEOFF, 3, 0, 0, 0, 0, 0, 0, 10.0)] * 2
    ground.mode(number)
    assert ground.arm() == mavlink.MAV_RESULT_FAILED
    ground.run(0.02)
    assert f"Arm: {name} mode not armable" in ground.texts()


def test_running_the_checks_reports_reasons_and_is_refused_while_armed(ground):
    ground.run(2.0)
    ground.heard.clear()
    assert ground.command(mavlink.MAV_CMD_RUN_PREARM_CHECKS) == mavlink.MAV_RESULT_ACCEPTED
    ground.run(0.02)
    assert "PreArm: AHRS: waiting for home" in ground.texts()
    ground.run(5.0)
    ground.arm()
    assert ground.command(mavlink.MAV_CMD_RUN_PREARM_CHECKS) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_disarming_in_the_air_is_refused_unless_forced(flying):
    assert flying.command(ARM, 0) == mavlink.MAV_RESULT_FAILED
    assert flying.command(ARM, 0, 21196) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(5.0)
    assert flying.body.down == 0.0


def test_an_armed_vehicle_on_the_ground_disarms_itself(ground):
    ground.run(6.0)
    ground.arm()
    ground.run(9.5)
    assert ground.copter.armed
    ground.run(1.0)
    assert not ground.copter.armed


def test_arming_moves_home_until_somebody_sets_it(ground):
    ground.run(6.0)
    ground.copter.body.north = 10.0
    ground.run(0.01)
    ground.arm()
    assert ground.copter.home_offset.north == pytest.approx(10.0, abs=0.01)
    ground.command(ARM, 0)
    assert ground.command(mavlink.MAV_CMD_DO_SET_HOME, 1) == mavlink.MAV_RESULT_ACCEPTED
    ground.copter.body.north = 20.0
    ground.run(0.01)
    ground.arm()
    assert ground.copter.home_offset.north == pytest.approx(10.0, abs=0.01)
