"""RTL and SMART_RTL: straight home, or back the way that the rover came."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...geodesy import Ned
from ..drive import STOP, Drive
from .base import NavigatingMode


class Rtl(NavigatingMode):
    """Drives home at RTL_SPEED, or WP_SPEED, and stops there."""

    name = "RTL"
    number = 11
    armable = False

    _arrival_told = False

    def enter(self, checked: bool) -> bool:
        rover = self.rover
        if rover.home is None:
            return False
        rover.navigator.start(rover.parameters["RTL_SPEED"])
        rover.navigator.go_to(rover.home_offset)
        self._arrival_told = False
        return True

    @property
    def home_reached(self) -> bool:
        """Whether the rover has come home."""
        return self.rover.navigator.reached

    def step(self, dt: float) -> Drive:
        drive = self.rover.navigator.step(dt)
        if self.home_reached and not self._arrival_told:
            self._arrival_told = True
            self.rover.say(mavlink.MAV_SEVERITY_INFO, "Reached destination")
        return drive


class SmartRtl(NavigatingMode):
    """Drives back along the path since arming; what loops in it is not cut off."""

    name = "SMART_RTL"
    number = 12
    armable = False

    _at_home = False

    def enter(self, checked: bool) -> bool:
        rover = self.rover
        if rover.estimator.origin is None:
            return False
        rover.navigator.start(rover.parameters["RTL_SPEED"])
        self._back = [point._replace(down=0.0) for point in rover.return_path.points()]
        self._at_home = False
        self._next()
        return True

    def _next(self) -> None:
        if not self._back:
            self._at_home = True
            self.rover.say(mavlink.MAV_SEVERITY_INFO, "Reached destination")
            return
        target = self._back.pop()
        self.rover.navigator.go_to(target, self._back[-1] if self._back else None)

    def step(self, dt: float) -> Drive:
        if self._at_home:
            return STOP
        drive = self.rover.navigator.step(dt)
        if self.rover.navigator.reached:
            self._next()
        return drive

    @property
    def target(self) -> Ned | None:
        return None if self._at_home else super().target
