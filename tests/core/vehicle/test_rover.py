"""A rover's heartbeat says ACTIVE in every mode but HOLD, be it at rest or not; it sends no landed state."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.telemetry.flight_modes import mode_name
from mavproxy_uavapi.core.vehicle.readiness import landed_state
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
ROVER = mavlink.MAV_TYPE_GROUND_ROVER


@pytest.fixture
def drone(loop: FastLoop, drone: Drone) -> Drone:
    """A rover, disarmed in MANUAL."""
    telemetry, obey = drone._telemetry, drone._obey

    def rovers() -> Any:
        reported = telemetry()
        resting = drone.mode == "HOLD"
        reported["HEARTBEAT"] |= {
            "type": ROVER,
            "system_status": mavlink.MAV_STATE_STANDBY if resting else mavlink.MAV_STATE_ACTIVE,
        }
        reported["EXTENDED_SYS_STATE"]["landed_state"] = mavlink.MAV_LANDED_STATE_UNDEFINED
        return reported

    def obeyed(message: Any) -> bool:
        if message.command != mavlink.MAV_CMD_DO_SET_MODE:
            return bool(obey(message))
        drone.mode = mode_name(ROVER, int(message.param2))
        drone.tell("HEARTBEAT")
        return True

    drone._telemetry, drone._obey, drone.mode = rovers, obeyed, "MANUAL"
    drone.tell_all()
    loop.settle()
    return drone


@pytest.fixture
def standing(loop: FastLoop, drone: Drone) -> Drone:
    """The rover, armed in MANUAL."""
    drone.armed = True
    drone.tell_all()
    loop.settle()
    return drone


def test_rover_that_stands_armed_in_manual_is_on_the_ground(standing: Drone, copter: Vehicle) -> None:
    assert (copter.mode, copter.state.armed, landed_state(copter)) == ("MANUAL", True, "on_ground")


def test_rover_that_stands_armed_in_manual_can_be_disarmed(
    standing: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.disarm)
    assert standing.armed is False


def test_rover_that_stands_armed_in_manual_can_be_armed_for_guided(
    standing: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.arm)
    assert (standing.armed, standing.mode) == (True, "GUIDED")
