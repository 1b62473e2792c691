import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.simulated import FAILED, away, body, height, landed_state, vehicle
from tests.support.simulated_plane import CIRCLE_FLOWN, TAKEOFF


def test_takeoff(plane):
    plane.mode(TAKEOFF)
    plane.arm()
    plane.run(5.0)
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_TAKEOFF
    plane.run(5.5)
    # SITL: 57 m after 10.1 s.
    assert height(plane) == pytest.approx(55.0, abs=6.0)
    assert "Takeoff to 50m for 200.0m heading 353.0 deg" in plane.texts()
    plane.run(40.0)
    assert height(plane) == pytest.approx(50.0, abs=1.0)
    course = math.radians(353)
    centre = (200 * math.cos(course) + 2, 200 * math.sin(course))
    assert away(plane, *centre) == pytest.approx(CIRCLE_FLOWN, abs=6.0)
    assert vehicle(plane).airspeed == pytest.approx(22.0, abs=0.2)
    assert math.hypot(*body(plane).velocity[:2]) == pytest.approx(23.4, abs=0.3)
    assert math.degrees(body(plane).roll) == pytest.approx(38.0, abs=2.0)
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_IN_AIR
    assert plane.of("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE
    assert plane.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == FAILED
