"""FBWB and CRUISE: the plane's pilot steers, and the altitude is held."""

import pytest

from mavproxy_uavapi.sim.control import Control
from tests.support.back_door import BackDoor
from tests.support.simulated import body, height
from tests.support.simulated_plane import CRUISE, FBWB


@pytest.mark.parametrize("mode", [FBWB, CRUISE])
def test_the_pilot_flies_and_altitude_is_held(flying, mode):
    control = BackDoor(Control(flying.simulator).handle_line)
    control.fault("pilot_sticks", throttle=1600)
    flying.mode(mode)
    flying.run(5.0)
    start = height(flying)
    flying.run(20.0)
    assert height(flying) == pytest.approx(start, abs=1.0)
    control.fault("pilot_sticks", roll=1800)
    flying.run(3.0)
    assert body(flying).yaw_rate > 0.1
