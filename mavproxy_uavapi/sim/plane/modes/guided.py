"""GUIDED: circle around the place that the ground station chose."""

from __future__ import annotations

import math

from ...events import ItemReached
from ...geodesy import Ned
from ..demand import Demand
from .base import NavigatingMode


class Guided(NavigatingMode):
    """A mode change makes the present place the target; MISSION_ITEM_REACHED 0 reports each arrival."""

    name = "GUIDED"
    number = 15
    guided = True
    takes_speeds = True

    _radius = 0.0
    _arrival_told = False

    def enter(self, checked: bool) -> bool:
        self._radius = 0.0
        self.go_to(self.plane.estimator.position)
        return True

    def go_to(self, target: Ned, *, counter_clockwise: bool = False, radius: float = 0.0) -> None:
        """Fly to a place and circle around it; a radius of 0 keeps that of before, WP_LOITER_RAD at first.

        As in ArduPlane a direction counts with a radius, and without one where the radius is WP_LOITER_RAD.
        """
        plane, navigator = self.plane, self.plane.navigator
        navigator.go_to(target, slope=target.down > plane.estimator.position.down)
        if radius > 0:
            self._radius = radius
            navigator.direction = -1 if counter_clockwise else 1
        elif self._radius <= 1:
            navigator.direction = -1 if counter_clockwise else navigator.default_direction()
        self._arrival_told = False

    def step(self, dt: float) -> Demand:
        plane = self.plane
        demand = plane.navigator.circle(self._radius)
        if plane.navigator.reached and not self._arrival_told:
            self._arrival_told = True
            plane.emit(ItemReached(0))
        return self.fly(demand)

    @property
    def radius(self) -> float:
        """Metres of the circle."""
        return self.plane.navigator.radius(self._radius)

    def change_altitude(self, down: float) -> None:
        """Keep the place and change the height, metres NED."""
        if math.isfinite(down):
            self.plane.navigator.change_altitude(down)
