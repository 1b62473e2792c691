"""What a mode asks of the plane."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto


class Throttle(Enum):
    """Who sets the throttle."""

    SUPPRESSED = auto()
    """Nobody: the plane waits for its take-off, or has landed."""
    AUTOMATIC = auto()
    """The speed controller."""
    FULL = auto()
    """The take-off."""
    IDLE = auto()
    """The flare and the landing run: none."""


@dataclass(frozen=True)
class Demand:
    """The demand for one step.

    bank is rad, right positive; climb m/s, upward positive; airspeed m/s, indicated. course (rad) is what the nose
    wheel steers to on the ground, None straight on. With a height (m above the EKF's origin) the climb rate is what
    brings the plane there at that airspeed: trade is the share of an error of the speed that the pitch makes up for,
    time (s) that of the control, lead (s) how far ahead of its filter the height is.
    """

    bank: float = 0.0
    climb: float = 0.0
    airspeed: float = 0.0
    throttle: Throttle = Throttle.AUTOMATIC
    course: float | None = None
    height: float | None = None
    trade: float = 1.0
    time: float = 5.0
    lead: float = 0.0


STAY = Demand(throttle=Throttle.SUPPRESSED)
