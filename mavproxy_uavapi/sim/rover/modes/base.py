"""What all modes of a rover have in common."""

from __future__ import annotations

from typing import ClassVar

from ... import mode
from ...geodesy import Ned
from ...reports import Navigation
from ..chassis import Chassis
from ..drive import Drive


class Mode(mode.VehicleMode):
    """A mode of a rover; `step` is called at the control rate while it is the current one."""

    base_flags = 0
    needs_velocity: ClassVar[bool] = True

    def __init__(self, rover: Chassis) -> None:
        self.rover = rover

    def step(self, dt: float) -> Drive:
        """One control step of dt seconds."""
        raise NotImplementedError

    def set_speed(self, speed: float) -> bool:
        """MAV_CMD_DO_CHANGE_SPEED in m/s; False where the mode has no speed of its own."""
        return False

    def navigation(self) -> Navigation | None:
        """What NAV_CONTROLLER_OUTPUT reports; nothing where a pilot drives."""
        if not self.navigates:
            return None
        return Navigation()


class NavigatingMode(Mode):
    """A mode that drives to points."""

    navigates = True

    @property
    def target(self) -> Ned | None:
        return self.rover.navigator.target

    def set_speed(self, speed: float) -> bool:
        return self.rover.navigator.limit_speed(speed)

    def navigation(self) -> Navigation | None:
        way = self.rover.navigator
        return Navigation(
            nav_bearing=way.bearing,
            target_bearing=way.bearing,
            distance=way.distance,
            crosstrack=way.crosstrack,
        )
