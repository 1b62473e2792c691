"""The plane: what it says of itself, what it takes on the ground, and what wind and pilot do to it."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Wind
from mavproxy_uavapi.sim.control import Control
from tests.support.back_door import BackDoor
from tests.support.simulated import ACCEPTED, FAILED, UNSUPPORTED, away, body, height, landed_state
from tests.support.simulated_plane import AUTO, CIRCLE, GUIDED, MANUAL, RTL, TAKEOFF


def test_it_says_that_it_is_a_plane_on_the_ground(plane):
    plane.run(1.1)
    heartbeat = plane.of("HEARTBEAT")[-1]
    assert (heartbeat.type, heartbeat.custom_mode, heartbeat.base_mode) == (mavlink.MAV_TYPE_FIXED_WING, MANUAL, 81)
    assert heartbeat.system_status == mavlink.MAV_STATE_STANDBY
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_ON_GROUND


@pytest.mark.parametrize(
    ("command", "result"),
    [
        *[(command, UNSUPPORTED) for command in (21, 115, 193, 194)],
        *[(command, FAILED) for command in (22, 178, 185, 189, 191, 3000)],
        *[(command, ACCEPTED) for command in (17, 20, 300, 195)],
    ],
)
def test_commands_on_the_ground(plane, command, result):
    assert plane.command(command) == result


@pytest.mark.parametrize(
    ("number", "result", "text"),
    [
        (9, FAILED, "No such mode 9"),
        (16, FAILED, "No such mode 16"),
        (19, FAILED, "Q_ENABLE 0"),
        (AUTO, ACCEPTED, "Mission complete, changing mode to RTL"),
        (CIRCLE, ACCEPTED, None),
        (GUIDED, ACCEPTED, None),
    ],
)
def test_modes(plane, number, result, text):
    assert plane.mode(number) == result
    plane.run(0.1)
    assert text is None or text in plane.texts()


def test_rtl_is_not_armed_in_and_an_armed_plane_waits(plane):
    plane.mode(RTL)
    assert plane.arm() == FAILED
    plane.mode(GUIDED)
    assert plane.arm() == ACCEPTED
    plane.run(5.0)
    assert "Arm: RTL mode not armable" in plane.texts()
    assert away(plane, 0.0, 0.0) == 0.0
    assert plane.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_STANDBY
    assert plane.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED


def test_the_wind_carries_the_plane_and_is_reported(on_runway):
    ground = on_runway(wind=Wind(6.0, 270.0))
    ground.simulator.parameters.set("SIM_WIND_T", 1)  # the same at every height
    ground.mode(TAKEOFF)
    ground.arm()
    ground.run(60.0)
    speeds = []
    for _ in range(40):
        ground.run(1.0)
        speeds.append(math.hypot(*body(ground).velocity[:2]))
    assert max(speeds) - min(speeds) == pytest.approx(12.0, abs=2.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_WIND)
    ground.run(0.02)
    wind = ground.of("WIND")[-1]
    assert (wind.speed, wind.direction) == pytest.approx((6.0, -90.0))


def test_a_plane_disarmed_by_its_pilot_comes_down(flying):
    BackDoor(Control(flying.simulator).handle_line).fault("pilot_disarm")
    flying.run(30.0)
    assert height(flying) == 0.0
    assert math.hypot(*body(flying).velocity[:2]) == 0.0
