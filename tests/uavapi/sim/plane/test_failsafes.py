"""What the plane does by itself when its battery is low."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.control import Control
from tests.support.simulated import vehicle


def test_a_low_battery_returns(flying):
    vehicle(flying).parameters.set("BATT_LOW_VOLT", 10.5)
    vehicle(flying).parameters.set("BATT_FS_LOW_ACT", 1)
    Control(flying.simulator).handle_line('{"op": "fault", "name": "low_battery"}')
    flying.run(12.0)
    assert vehicle(flying).mode.name == "RTL"
    assert flying.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
