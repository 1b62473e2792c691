"""Modes that Rover has and that this vehicle refuses to enter: there is no vehicle to follow and no dock."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..chassis import Chassis
from ..drive import STOP, Drive
from .base import Mode

REFUSED = (
    (6, "FOLLOW", ""),
    (8, "DOCK", "Dock: target not acquired"),
    (16, "INITIALISING", ""),  # before the first one
)
"""Number, name, and what the rover says."""


class Refused(Mode):
    """A mode that is never entered."""

    def __init__(self, rover: Chassis, number: int, name: str, why: str) -> None:
        super().__init__(rover)
        self.number, self.name, self._why = number, name, why

    def enter(self, checked: bool) -> bool:
        if self._why:
            self.rover.say(mavlink.MAV_SEVERITY_NOTICE, self._why)
        return False

    def step(self, dt: float) -> Drive:
        return STOP
