"""What a mode asks of the rover."""

from __future__ import annotations

from typing import NamedTuple


class Drive(NamedTuple):
    """speed is m/s forward under control of the speed controller, turn_rate rad/s clockwise.

    With rolls the motor gives what brings the car to that speed in the end, and nothing brakes.
    """

    speed: float = 0.0
    turn_rate: float = 0.0
    rolls: bool = False


COAST = Drive(rolls=True)
STOP = Drive()
