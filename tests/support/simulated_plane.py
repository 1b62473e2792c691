"""A simulated plane: its modes, the circle that it flies, and where it is sent."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.simulated import place

MANUAL, CIRCLE, FBWB, CRUISE, AUTO, RTL, LOITER, TAKEOFF, GUIDED = 0, 1, 6, 7, 10, 11, 12, 13, 15
CIRCLE_FLOWN = 97.0
"""Metres; what WP_LOITER_RAD 80 becomes at CMAC."""


def reposition(
    ground: Any,
    north: float,
    east: float,
    z: float = 100.0,
    *,
    change: int = 1,
    radius: float = 0.0,
    direction: float = math.nan,
    speed: float = -1.0,
    frame: int = 3,
) -> int | None:
    """MAV_CMD_DO_REPOSITION to a place (m from the start); its MAV_RESULT."""
    parameters = (speed, change, radius, direction)
    result: int | None = ground.command_int(
        mavlink.MAV_CMD_DO_REPOSITION, frame, parameters, (*place(ground, north, east), z)
    )
    return result
