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
    wheel steers to on the ground, None straight on.
    """

    bank: float = 0.0
    climb: float = 0.0
    airspeed: float = 0.0
    throttle: Throttle = Throttle.AUTOMATIC
    course: float | None = None


STAY = Demand(throttle=Throttle.SUPPRESSED)
