import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.simulated import ACCEPTED, away, height
from tests.support.simulated_plane import CIRCLE_FLOWN, reposition


def test_return(flying):
    reposition(flying, 700.0, 0.0)
    flying.run(40.0)
    assert flying.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    flying.run(70.0)
    assert away(flying, 0.0, 0.0) == pytest.approx(CIRCLE_FLOWN, abs=5.0)
    assert height(flying) == pytest.approx(100.0, abs=1.0)
