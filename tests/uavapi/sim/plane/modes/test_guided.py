"""GUIDED of the plane: places, heights and speeds from a ground station, and from another one."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Wind
from mavproxy_uavapi.sim.control import Control
from tests.support.back_door import BackDoor
from tests.support.simulated import ACCEPTED, DENIED, FAILED, UNSUPPORTED, away, body, height, place, vehicle
from tests.support.simulated_plane import CIRCLE_FLOWN, GUIDED, LOITER, TAKEOFF, reposition


def test_reposition_circles_around_the_place_and_reports_the_arrival(flying):
    assert reposition(flying, 500.0, 0.0) == ACCEPTED
    flying.run(60.0)
    assert [m.seq for m in flying.of("MISSION_ITEM_REACHED")] == [0]
    assert away(flying, 500.0, 0.0) == pytest.approx(CIRCLE_FLOWN, abs=3.0)
    assert height(flying) == pytest.approx(100.0, abs=1.0)
    assert body(flying).yaw_rate > 0


def test_reposition_with_a_radius_and_the_other_way_round(flying):
    assert reposition(flying, 400.0, 300.0, 80.0, radius=120.0, direction=1.0, speed=26.0) == ACCEPTED
    flying.run(60.0)
    assert away(flying, 400.0, 300.0) == pytest.approx(136.0, abs=4.0)
    assert body(flying).yaw_rate < 0
    assert vehicle(flying).airspeed == pytest.approx(22.0, abs=0.2)


def test_what_reposition_does_not_take(flying):
    command = mavlink.MAV_CMD_DO_REPOSITION
    assert reposition(flying, 0.0, 300.0, change=0) == ACCEPTED
    assert reposition(flying, 0.0, 300.0, frame=1) == DENIED
    assert flying.command_int(command, 3, (-1, 1, 0, 0), (0, 0, 50.0)) == DENIED
    assert flying.command_int(command, 3, (-1, 1, 0, 0), (999999999, 0, 50.0)) == DENIED
    assert flying.command(command, -1, 1) == UNSUPPORTED
    flying.mode(LOITER)
    assert reposition(flying, 0.0, 300.0, change=0) == FAILED


def test_guided_items_and_altitudes(flying):
    lat, lon = place(flying, 0.0, 400.0)
    item = mavlink.MAVLink_mission_item_int_message
    flying.send(item(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, lat, lon, 90.0, 0))
    flying.run(0.02)
    assert flying.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_ACCEPTED
    target = vehicle(flying).mode.target
    assert (target.north, target.east, target.down) == pytest.approx((0.0, 400.0, -90.0), abs=0.1)
    flying.send(item(1, 1, 0, 3, 16, 3, 1, 0, 0, 0, 0, 0, 0, 60.0, 0))
    assert vehicle(flying).mode.target.down == pytest.approx(-60.0, abs=0.1)
    flying.send(item(1, 1, 0, 2, 16, 3, 1, 0, 0, 0, 0, 0, 0, 584.0 + 60.0, 0))
    assert vehicle(flying).mode.target.down == pytest.approx(-60.0, abs=0.1)
    flying.local((100.0, 100.0, -50.0))
    assert vehicle(flying).mode.target.down == pytest.approx(-60.0, abs=0.1)
    position = mavlink.MAVLink_set_position_target_global_int_message
    flying.send(position(0, 1, 1, 6, 0x0DF8, 0, 0, 55.0, 0, 0, 0, 0, 0, 0, 0, 0))
    assert vehicle(flying).mode.target.north == pytest.approx(0.0, abs=0.1)
    assert vehicle(flying).mode.target.down == pytest.approx(-55.0, abs=0.1)
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_ALTITUDE, 70.0, 3) == ACCEPTED
    flying.run(40.0)
    assert height(flying) == pytest.approx(70.0, abs=1.0)
    flying.mode(LOITER)
    flying.send(item(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, lat, lon, 90.0, 0))
    flying.run(0.02)
    assert flying.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_ERROR


def test_speeds(flying):
    speed = mavlink.MAV_CMD_DO_CHANGE_SPEED
    assert flying.command(speed, 0, 26.0, -1) == ACCEPTED
    assert [flying.command(speed, 0, value, -1) for value in (90.0, 5.0)] == [FAILED, FAILED]
    assert flying.command(speed, 2, 3.0, -1) == FAILED
    flying.run(10.0)
    assert "Set airspeed 26 m/s" in flying.texts()
    assert vehicle(flying).airspeed == pytest.approx(26.0, abs=0.5)
    assert flying.command(speed, 0, -2.0, -1) == ACCEPTED
    flying.run(10.0)
    assert vehicle(flying).airspeed == pytest.approx(22.0, abs=0.5)
    flying.mode(LOITER)
    assert flying.command(speed, 0, 26.0, -1) == FAILED


def test_a_ground_speed_holds_against_the_wind(on_runway):
    ground = on_runway(wind=Wind(8.0, 0.0))
    ground.mode(TAKEOFF)
    ground.arm()
    ground.run(30.0)
    ground.mode(GUIDED)
    assert ground.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 20.0, -1) == ACCEPTED
    reposition(ground, 3000.0, 0.0)
    ground.run(40.0)
    assert math.hypot(*body(ground).velocity[:2]) == pytest.approx(20.0, abs=0.5)
    assert vehicle(ground).airspeed > 25.0


def test_another_mode_has_its_own_speed_again(flying):
    assert flying.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, 26.0, -1) == ACCEPTED
    flying.mode(LOITER)
    flying.mode(GUIDED)
    assert vehicle(flying).navigator.speed_target is None


def test_another_station_sends_it_elsewhere_in_guided(flying):
    BackDoor(Control(flying.simulator).handle_line).fault("other_station", position=[300, 300, -80])
    flying.run(60.0)
    assert away(flying, 300.0, 300.0) == pytest.approx(CIRCLE_FLOWN, abs=4.0)
