from __future__ import annotations

import math

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy, ModeChanged, Superseded
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.piloting import FAR, place
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
YAW = mavlink.MAV_CMD_CONDITION_YAW


def test_heading_is_turned_to_the_shorter_way(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.set_heading, 359.0)
    assert [(m.command, m.param1, m.param3, m.param4) for m in flying.orders()] == [(YAW, 359.0, 0, 0)]


def test_yaw_rate_repeats_the_position_that_is_flown_to(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    loop.pass_time(1.0)
    pilotage.do(copter.set_yaw_rate, 90.0)
    _, second = flying.setpoints()
    assert (second.lat_int, second.lon_int) == flying.place((200.0, 0.0))
    assert second.alt == pytest.approx(20.0, abs=0.01)
    assert second.yaw_rate == pytest.approx(math.pi / 2)
    assert second.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert not second.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    assert job.running


def test_yaw_rate_without_a_movement_holds_the_place(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.set_yaw_rate, -45.0)
    setpoint = flying.setpoints()[0]
    assert (setpoint.x, setpoint.y, setpoint.z) == (0.0, 0.0, -20.0)
    assert setpoint.yaw_rate == pytest.approx(-math.pi / 4)


def test_yaw_rate_repeats_the_velocity_that_the_autopilot_reports(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.moving = [1.0, 0.0, 0.0]  # another station's
    pilotage.do(copter.set_yaw_rate, 10.0)
    assert flying.setpoints()[-1].vx == 1.0


def test_yaw_rate_does_not_fly_back_to_a_target_that_others_have_replaced(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.go_to, NedTarget(50.0, 0.0, -20.0), wait=True)
    flying.target, flying.at = [0.0, 0.0, -20.0], [0.0, 0.0, -20.0]
    pilotage.do(copter.set_yaw_rate, 10.0)
    last = flying.setpoints()[-1]
    assert place(flying, 0.0, 0.0) == pytest.approx((last.lat_int / 1e7, last.lon_int / 1e7), abs=1e-6)
    assert last.alt == pytest.approx(20.0, abs=0.1)


def test_yaw_rate_holds_the_place_where_no_target_is_reported(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.go_to, FAR)
    loop.pass_time(0.3)
    flying.target = None  # as after a take-off: POSITION_TARGET_LOCAL_NED tells an old place
    pilotage.do(copter.set_yaw_rate, 10.0)
    last = flying.setpoints()[-1]
    assert (last.x, last.z) == pytest.approx((flying.at[0], flying.at[2]), abs=3.0)


def test_yaw_rate_in_a_takeoff_is_busy(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    flying.landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    loop.pass_time(0.3)
    with pytest.raises(Busy, match="taking off"):
        pilotage.do(copter.set_yaw_rate, 10.0)
    assert flying.setpoints() == []


def test_yaw_rate_is_not_sent_over_a_switch_while_it_asks_for_the_target(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.mute_requests = True
    job = pilotage.start(copter.set_yaw_rate, 10.0)
    loop.pass_time(0.5)
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged):
        pilotage.result(job)
    assert flying.setpoints() == []


def test_heading_is_done_when_the_attitude_shows_it(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.answers[YAW] = [mavlink.MAV_RESULT_ACCEPTED]
    job = pilotage.start(copter.set_heading, 350.0)
    loop.pass_time(5.0)
    assert job.running
    flying.yaw = math.radians(-9.0)
    assert pilotage.result(job) == "done"


def test_movement_ends_the_turn_that_it_undoes(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.answers[YAW] = [mavlink.MAV_RESULT_ACCEPTED]
    turn = pilotage.start(copter.set_heading, 350.0)
    pilotage.do(copter.go_to, FAR)
    with pytest.raises(Superseded):
        pilotage.result(turn)
