"""RTL: fly home and circle there, or go on with the mission's landing."""

from __future__ import annotations

from ...mission import State
from ..demand import Demand
from .base import NavigatingMode

THEN_LAND, LAND_AT_ONCE = 1, 2
"""RTL_AUTOLAND."""
AT_ALTITUDE = 10.0
"""Metres from RTL_ALTITUDE at which it counts as reached."""


class Rtl(NavigatingMode):
    """At RTL_ALTITUDE above home (below 0: as high as it is), with RTL_RADIUS."""

    name = "RTL"
    number = 11
    armable = False

    _looked_for_landing = False

    def enter(self, checked: bool) -> bool:
        plane, here = self.plane, self.plane.estimator.position
        height = plane.parameters["RTL_ALTITUDE"]
        down = here.down if height < 0 else plane.home_offset.down - height
        radius = plane.parameters["RTL_RADIUS"]
        navigator = plane.navigator
        navigator.go_to(plane.home_offset._replace(down=down), slope=down > here.down)
        navigator.direction = navigator.default_direction() if radius == 0 else (-1 if radius < 0 else 1)
        self._looked_for_landing = False
        return True

    def step(self, dt: float) -> Demand:
        navigator = self.plane.navigator
        demand = navigator.circle(self.plane.parameters["RTL_RADIUS"])
        self._look_for_landing()
        return self.fly(demand)

    def _look_for_landing(self) -> None:
        plane, navigator = self.plane, self.plane.navigator
        how = int(plane.parameters["RTL_AUTOLAND"])
        high = abs(plane.estimator.position.down - navigator.target.down) < AT_ALTITUDE
        arrived = navigator.circling and high
        if self._looked_for_landing or not (how == LAND_AT_ONCE or (how == THEN_LAND and arrived)):
            return
        self._looked_for_landing = True
        if plane.select_landing() and plane.mission.state is not State.RUNNING:
            plane.set_mode(plane.mission_mode.number)
