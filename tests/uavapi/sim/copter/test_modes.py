"""The copter's modes but GUIDED and AUTO, how one is left for another, and what noise and wind do to them."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Wind


def altitude(ground):
    return -ground.body.down


def test_land_slows_near_the_ground_and_disarms_on_touchdown(new_ground):
    ground = new_ground()
    ground.fly(25.0)
    assert ground.command(mavlink.MAV_CMD_NAV_LAND) == mavlink.MAV_RESULT_ACCEPTED
    ground.run(4.0)
    assert ground.body.velocity_down == pytest.approx(1.5, abs=0.1)
    while altitude(ground) > 8.0:
        ground.run(0.1)
    assert ground.body.velocity_down == pytest.approx(0.5, abs=0.1)
    ground.run(20.0)
    assert ground.copter.landed
    assert not ground.copter.armed
    assert "Disarming motors" in ground.texts()


def test_rtl_climbs_returns_lands_and_disarms(flying):
    flying.local((60.0, 0.0, -10.0))
    flying.run(15.0)
    assert flying.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == mavlink.MAV_RESULT_ACCEPTED
    flying.run(6.0)
    assert altitude(flying) == pytest.approx(15.0, abs=0.2)
    assert flying.body.north > 50.0
    flying.run(12.0)
    assert math.hypot(flying.body.north, flying.body.east) < 1.0
    flying.run(60.0)
    assert flying.body.down == 0.0
    assert not flying.copter.armed


def test_rtl_close_to_home_climbs_no_higher_than_the_cone(flying):
    flying.local((4.0, 0.0, -10.0))
    flying.run(10.0)
    flying.mode(6)
    highest = 0.0
    for _ in range(80):
        flying.run(0.1)
        highest = max(highest, altitude(flying))
    assert highest == pytest.approx(12.0, abs=0.3)


def test_rtl_climbs_at_least_rtl_climb_min(flying):
    flying.send(mavlink.MAVLink_param_set_message(1, 1, b"RTL_CLIMB_MIN_M", 8.0, 4))
    flying.mode(6)
    flying.run(8.0)
    assert altitude(flying) == pytest.approx(18.0, abs=0.2)


def test_brake_stops_quickly_and_stays(flying):
    flying.local((200.0, 0.0, -10.0))
    flying.run(6.0)
    start = flying.body.north
    flying.mode(17)
    flying.run(8.0)
    assert flying.body.velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.2)
    assert flying.body.north - start < 20.0


def test_loiter_with_centred_sticks_holds_the_position(flying):
    flying.copter.sticks.move(3, 1500)
    flying.mode(5)
    flying.run(2.0)
    held = flying.body.position
    flying.run(10.0)
    assert flying.body.position == pytest.approx(held, abs=0.1)


def test_loiter_with_the_throttle_down_descends_as_in_sitl(flying):
    flying.mode(5)
    flying.run(10.0)
    assert flying.body.down == 0.0


def test_a_stick_moves_the_vehicle_in_loiter(flying):
    flying.copter.sticks.move(3, 1500)
    flying.copter.body.yaw = 0.0
    flying.mode(5)
    flying.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 1200, 0, 0, 0, 0, 0, 0))
    flying.run(2.0)
    assert flying.body.velocity_north > 2.0


def test_a_pilot_takes_off_and_lands_in_alt_hold(ground):
    ground.run(6.0)
    ground.mode(2)
    ground.arm()
    ground.run(3.0)
    ground.copter.sticks.move(3, 1800)
    ground.run(5.0)
    assert altitude(ground) > 3.0
    ground.copter.sticks.move(3, 1000)
    ground.run(15.0)
    assert ground.copter.landed


def test_stabilize_flies_by_throttle(ground):
    ground.run(6.0)
    ground.arm()
    ground.run(3.0)
    ground.copter.sticks.move(3, 1600)
    ground.run(3.0)
    assert altitude(ground) > 1.0


def test_the_mode_switch_changes_the_mode(flying):
    flying.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 0, 0, 0, 1300, 0, 0, 0))
    flying.run(0.1)
    assert flying.copter.mode.name == "LAND"
    assert flying.of("HEARTBEAT")[-1].custom_mode == 9


def test_disarmed_any_mode_is_accepted_but_in_the_air_a_position_is_needed(flying):
    flying.copter.estimator.blind_until = math.inf
    flying.mode(2)
    assert flying.mode(4) == mavlink.MAV_RESULT_FAILED
    flying.run(0.02)
    assert "Mode change to GUIDED failed: requires position" in flying.texts()


def test_auto_in_the_air_without_a_mission_is_refused(flying):
    assert flying.mode(3) == mavlink.MAV_RESULT_FAILED
    flying.run(0.02)
    assert "Mode change to AUTO failed: init failed" in flying.texts()
    assert flying.mode(99) == mavlink.MAV_RESULT_FAILED


def test_a_lost_position_in_flight_lands(flying):
    flying.copter.estimator.blind_until = math.inf
    flying.run(2.0)
    assert flying.copter.mode.name == "LAND"
    assert "EKF Failsafe" in flying.texts()
    assert flying.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL


def test_wind_is_leaned_against(new_ground):
    ground = new_ground(Options(wind=Wind(8.0, 0.0)))
    ground.fly()
    ground.run(5.0)
    assert ground.body.position == pytest.approx((0.0, 0.0, -10.0), abs=0.3)
    assert math.hypot(ground.body.roll, ground.body.pitch) > math.radians(3)


def test_gps_noise_makes_the_vehicle_wander_but_not_far(new_ground):
    ground = new_ground(Options(gps_noise=1.0, seed=3))
    ground.run(6.0)
    ground.mode(4)
    ground.arm()
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10)
    ground.run(60.0)
    off = math.hypot(ground.body.north, ground.body.east)
    assert 0.05 < off < 6.0
    estimate = ground.copter.estimator.position
    assert math.dist(estimate, ground.body.position) > 0.05
