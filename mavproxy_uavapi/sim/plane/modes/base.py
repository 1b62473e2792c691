"""What all modes of a plane have in common."""

from __future__ import annotations

import math
from typing import ClassVar

from ... import mode
from ...geodesy import Ned
from ...reports import Navigation
from ..airframe import Airframe
from ..demand import STAY, Demand


class Mode(mode.VehicleMode):
    """A mode of a plane; `step` is called at the control rate while it is the current one."""

    automatic_throttle: ClassVar[bool] = True
    guided: ClassVar[bool] = False
    """Whether the ground station may give it targets."""
    takes_speeds: ClassVar[bool] = False
    """Whether DO_CHANGE_SPEED has an effect."""
    needs_position = False
    vtol: ClassVar[bool] = False

    def __init__(self, plane: Airframe) -> None:
        self.plane = plane

    def step(self, dt: float) -> Demand:
        """One control step of dt seconds."""
        raise NotImplementedError

    def navigation(self) -> Navigation | None:
        """What NAV_CONTROLLER_OUTPUT reports."""
        return None


class NavigatingMode(Mode):
    """A mode that flies to targets."""

    navigates = True

    @property
    def target(self) -> Ned | None:
        return self.plane.navigator.target

    def navigation(self) -> Navigation | None:
        plane, way = self.plane, self.plane.navigator
        bearing = math.degrees(way.bearing)
        return Navigation(
            math.degrees(plane.body.roll),
            math.degrees(plane.body.pitch),
            bearing,
            bearing,
            way.distance,
            plane.estimator.position.down - way.down,
            way.airspeed - plane.airspeed,
            way.crosstrack,
        )

    def fly(self, demand: Demand) -> Demand:
        """The demand, or none while the throttle waits for a take-off."""
        plane = self.plane
        if plane.throttle_suppressed and not plane.flying:
            return STAY
        plane.throttle_suppressed = False
        return demand
