"""What the plane does by itself when its battery is low, or its fence is broken."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.control import Control
from tests.support.simulated import vehicle

CRUISE = 7


def test_a_low_battery_returns(flying):
    vehicle(flying).parameters.set("BATT_LOW_VOLT", 10.5)
    vehicle(flying).parameters.set("BATT_FS_LOW_ACT", 1)
    Control(flying.simulator).handle_line('{"op": "fault", "name": "low_battery"}')
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
