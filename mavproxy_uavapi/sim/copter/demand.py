"""What a flight mode asks of the aircraft."""

from __future__ import annotations

from typing import NamedTuple

from ..geodesy import Ned
from ..physics import GRAVITY

NO_LIFT = Ned(0.0, 0.0, GRAVITY)


class Demand(NamedTuple):
    """The demand for one step.

    thrust is m/s/s beyond weight, yaw_rate rad/s; idle lets the motors spool down to ground idle.
    """

    thrust: Ned = NO_LIFT
    yaw_rate: float = 0.0
    idle: bool = False


IDLE = Demand(idle=True)
SPOOLING = Demand()
