"""What the tests of the vehicle share."""

from __future__ import annotations

import pytest

from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop


@pytest.fixture
def armed(loop: FastLoop, drone: Drone) -> Drone:
    """The drone on the ground, armed in GUIDED."""
    drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    return drone
