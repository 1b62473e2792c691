"""CIRCLE and LOITER: fly circles, by the sticks' limits or around a point."""

from __future__ import annotations

from ..demand import Demand
from .base import Mode, NavigatingMode


class Circle(Mode):
    """A gentle turn at the present altitude, around no point in particular."""

    name = "CIRCLE"
    number = 1
    navigates = True

    _down = 0.0

    def enter(self, checked: bool) -> bool:
        self._down = self.plane.estimator.position.down
        return super().enter(checked)

    def step(self, dt: float) -> Demand:
        plane = self.plane
        bank = plane.navigator.steepest_bank / 3
        if plane.throttle_suppressed and not plane.flying:
            return Demand()
        return Demand(bank, plane.navigator.climb_to(self._down), plane.navigator.airspeed)


class Loiter(NavigatingMode):
    """Circles of WP_LOITER_RAD around the place where it was entered."""

    name = "LOITER"
    number = 12

    def enter(self, checked: bool) -> bool:
        navigator = self.plane.navigator
        navigator.go_to(self.plane.estimator.position)
        navigator.direction = navigator.default_direction()
        return True

    def step(self, dt: float) -> Demand:
        return self.fly(self.plane.navigator.circle())


class AvoidAdsb(Loiter):
    """GUIDED for the avoidance of other aircraft, of which there are none here."""

    name = "AVOID_ADSB"
    number = 14
