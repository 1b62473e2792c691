"""Modes that Rover has and that this vehicle refuses to enter: there is no vehicle to follow and no dock."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..drive import STOP, Drive
from .base import Mode


class Refused(Mode):
    """A mode that is never entered."""

    def enter(self, checked: bool) -> bool:
        return False

    def step(self, dt: float) -> Drive:
        return STOP


class Follow(Refused):
    """Needs another vehicle's position."""

    name = "FOLLOW"
    number = 6


class Dock(Refused):
    """Needs a docking target in sight."""

    name = "DOCK"
    number = 8

    def enter(self, checked: bool) -> bool:
        self.rover.say(mavlink.MAV_SEVERITY_NOTICE, "Dock: target not acquired")
        return super().enter(checked)


class Initialising(Refused):
    """The mode before the first one."""

    name = "INITIALISING"
    number = 16
