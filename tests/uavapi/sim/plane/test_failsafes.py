"""What the plane does by itself when its battery is low, or its fence is broken."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.control import Control
from tests.support.back_door import BackDoor
from tests.support.simulated import vehicle

CRUISE, RTL, LOITER, GUIDED = 7, 11, 12, 15


def test_a_low_battery_returns(flying):
    vehicle(flying).parameters.set("BATT_LOW_VOLT", 10.5)
    vehicle(flying).parameters.set("BATT_FS_LOW_ACT", 1)
    BackDoor(Control(flying.simulator).handle_line).fault("low_battery")
    flying.run(12.0)
    assert vehicle(flying).mode.name == "RTL"
    assert flying.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL


@pytest.mark.matrix
@pytest.mark.parametrize(
    ("action", "mode"),
    [(0, "CRUISE"), (1, "RTL"), (2, "CRUISE"), (4, "CRUISE"), (6, "GUIDED"), (7, "GUIDED"), (8, "RTL")],
)
def test_a_broken_fence_does_what_fence_action_says(flying, action, mode):
    flying.mode(CRUISE)
    for name, value in {"FENCE_TYPE": 2, "FENCE_ACTION": action, "FENCE_RADIUS": 200, "FENCE_ENABLE": 1}.items():
        flying.simulator.parameters.set(name, value)
    flying.run(25.0)
    assert flying.simulator.vehicle.mode.name == mode
    assert "Circle fence breached" in flying.texts()
    if mode == "CRUISE":
        return
    flying.run(60.0)
    assert math.hypot(*flying.simulator.vehicle.body.position[:2]) < 200
    assert flying.simulator.vehicle.mode.name == mode and "Fence breach cleared" in flying.texts()
    if mode == "GUIDED":  # half way between FENCE_ALT_MIN and FENCE_ALT_MAX
        assert flying.simulator.vehicle.altitude == pytest.approx(45.0, abs=8.0)


@pytest.mark.matrix
@pytest.mark.parametrize(
    ("watches", "action", "mode", "ends_in"),
    [
        (0, 1, GUIDED, "GUIDED"),
        (1, 0, GUIDED, "GUIDED"),
        (1, 0, LOITER, "RTL"),
        (1, 1, GUIDED, "RTL"),
        (1, 2, GUIDED, "FBWA"),
        (1, 1, RTL, "RTL"),
        (3, 1, GUIDED, "GUIDED"),
    ],
)
def test_a_ground_station_that_falls_silent_is_missed_as_configured(flying, watches, action, mode, ends_in):
    for name, value in {"FS_GCS_ENABL": watches, "FS_LONG_ACTN": action}.items():
        flying.simulator.parameters.set(name, value)
    flying.mode(mode)
    flying.run(10.0)
    assert not any("GCS Failsafe" in text for text in flying.texts())  # none was ever there
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    flying.send(heartbeat)
    flying.run(4.5)
    assert not any("GCS Failsafe" in text for text in flying.texts())
    flying.run(1.0)
    assert vehicle(flying).mode.name == ends_in
    missed = watches == 1
    assert (f"GCS Failsafe On: {ends_in}" in flying.texts()) == missed
    flying.send(heartbeat)
    flying.run(0.5)
    assert ("GCS Failsafe Off" in flying.texts()) == missed
