"""What the tests of the vehicle share."""

from __future__ import annotations

from typing import Any

import pytest


@pytest.fixture
def armed(loop: Any, drone: Any) -> Any:
    """The drone on the ground, armed in GUIDED."""
    drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    return drone
