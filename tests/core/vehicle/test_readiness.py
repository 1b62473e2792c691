from __future__ import annotations

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.vehicle.readiness import condition, landed_state, why_not
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink


def test_status_of_a_vehicle_that_is_ready(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    assert condition(copter, True, loop.time() + 0.5) == {
        "mode": "STABILIZE",
        "armed": False,
        "landed_state": "on_ground",
        "link": {"alive": True, "heartbeat_age_s": 0.5, "packet_loss": 0.0},
        "ekf_ok": True,
        "gps_fix": 6,
        "battery_remaining": 87,
        "ready_to_arm": True,
        "why_not": [],
    }


def test_status_of_a_vehicle_in_the_air(loop: FastLoop, flying: Drone, copter: Vehicle) -> None:
    reported = condition(copter, True, loop.time())
    assert (reported["mode"], reported["armed"], reported["landed_state"]) == ("GUIDED", True, "in_air")


def test_reasons_are_its_recent_texts_about_arming(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.ready = False
    drone.say("PreArm: long ago")
    loop.pass_time(70.0)
    for text in ("PreArm: compass not healthy", "Arm: throttle too high", "PreArm: compass not healthy", "hello"):
        drone.say(text)
    loop.pass_time(1.0)
    assert why_not(copter, True, loop.time()) == [
        "no position estimate yet",
        "PreArm: compass not healthy",
        "Arm: throttle too high",
    ]
    assert condition(copter, True, loop.time())["ready_to_arm"] is False


def test_reason_without_a_text_gets_one_of_ours(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.ready = False
    loop.pass_time(1.0)
    assert "pre-arm checks do not pass" in why_not(copter, True, loop.time())


def test_missing_fix_is_a_reason(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.mute.add("GPS_RAW_INT")
    drone.send("gps_raw_int", fix_type=2)
    loop.settle()
    assert why_not(copter, True, loop.time()) == ["no 3D GPS fix"]


def test_lost_link_is_the_only_reason(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.ready = False
    drone.power_off()
    assert why_not(copter, False, copter.state.heartbeat_at + 7.25) == ["no heartbeat for 7.2 s"]


def test_armed_vehicle_needs_no_reasons(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.ready, drone.armed = False, True
    loop.pass_time(1.0)
    assert why_not(copter, True, loop.time()) == []


@pytest.mark.parametrize(
    ("reported", "name"),
    [
        (mavlink.MAV_LANDED_STATE_ON_GROUND, "on_ground"),
        (mavlink.MAV_LANDED_STATE_IN_AIR, "in_air"),
        (mavlink.MAV_LANDED_STATE_TAKEOFF, "takeoff"),
        (mavlink.MAV_LANDED_STATE_LANDING, "landing"),
    ],
)
def test_landed_state_is_what_it_reports(
    loop: FastLoop, drone: Drone, copter: Vehicle, reported: int, name: str
) -> None:
    drone.landed = reported
    loop.pass_time(0.5)
    assert landed_state(copter) == name


def test_landed_state_without_its_message_is_the_heartbeats(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.mute.add("EXTENDED_SYS_STATE")
    drone.send("extended_sys_state", landed_state=0)
    drone.fly()
    loop.settle()
    assert landed_state(copter) == "in_air"
    copter.state.system_status = None
    assert landed_state(copter) == "unknown"


def test_unknown_charge_is_none(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.mute.add("SYS_STATUS")
    drone.send("sys_status", battery_remaining=-1)
    loop.settle()
    assert condition(copter, True, loop.time())["battery_remaining"] is None


def test_old_charge_is_none(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.mute.add("SYS_STATUS")
    loop.pass_time(10.0)
    assert condition(copter, True, loop.time())["battery_remaining"] is None
