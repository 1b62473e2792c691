"""TAKEOFF: run, climb to TKOFF_ALT, and circle TKOFF_DIST ahead."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...geodesy import Ned
from ..demand import STAY, Demand
from ..takeoff import TakeoffRun
from .base import NavigatingMode


class Takeoff(NavigatingMode):
    """Takes off in the direction that the plane stands in."""

    name = "TAKEOFF"
    number = 13

    _planned = False
    _climbing = False
    _level_off_told = False

    def enter(self, checked: bool) -> bool:
        self._run = TakeoffRun(self.plane)
        self._planned = self._climbing = self._level_off_told = False
        self._start = self.plane.estimator.position
        return True

    def step(self, dt: float) -> Demand:
        plane = self.plane
        if plane.home is None:
            return STAY
        if not self._planned and plane.flying and plane.body.airborne:
            self._plan_in_flight()
        if not self._planned or self._climbing:
            demand = self._run.step()
            self._plan(self._run)
            self._finish_climb()
            return demand
        return self.fly(plane.navigator.circle())

    def _aim(self, course: float, climb: float) -> None:
        plane, here = self.plane, self.plane.estimator.position
        away = plane.parameters["TKOFF_DIST"]
        self._start, self._planned = here, True
        target = Ned(here.north + away * math.cos(course), here.east + away * math.sin(course), here.down - climb)
        plane.navigator.go_to(target)
        plane.navigator.direction = plane.navigator.default_direction()

    def _plan(self, run: TakeoffRun) -> None:
        plane = self.plane
        if self._planned or run.course is None:
            return
        height, away = plane.parameters["TKOFF_ALT"], plane.parameters["TKOFF_DIST"]
        self._aim(run.course, height)
        self._climbing = True
        heading = math.degrees(run.course) % 360
        text = f"Takeoff to {height:.0f}m for {away:.1f}m heading {heading:.1f} deg"
        plane.say(mavlink.MAV_SEVERITY_INFO, text)

    def _plan_in_flight(self) -> None:
        plane = self.plane
        missing = plane.parameters["TKOFF_ALT"] - plane.altitude
        velocity = plane.estimator.velocity
        if missing <= 0:
            plane.say(mavlink.MAV_SEVERITY_INFO, "Above TKOFF alt - loitering")
            self._aim(0.0, 0.0)
            plane.navigator.go_to(plane.estimator.position)
        else:
            plane.say(mavlink.MAV_SEVERITY_INFO, "Climbing to TKOFF alt then loitering")
            self._aim(math.atan2(velocity.east, velocity.north), missing)

    def _finish_climb(self) -> None:
        plane, here = self.plane, self.plane.estimator.position
        if not self._climbing:
            return
        climbed, height = self._start.down - here.down, plane.parameters["TKOFF_ALT"]
        seconds = (height - climbed) / max(-plane.body.velocity_down, 0.1)
        if not self._level_off_told and climbed >= 10 and seconds <= plane.parameters["TKOFF_PLIM_SEC"]:
            self._level_off_told = True
            text = f"Takeoff level-off starting at {int(height - climbed)}m"
            plane.say(mavlink.MAV_SEVERITY_INFO, text)
        away = math.dist(here[:2], self._start[:2])
        if climbed >= height - 2 or away >= plane.parameters["TKOFF_DIST"]:
            self._climbing = False
            plane.navigator.go_to(plane.navigator.target)

    @property
    def taking_off(self) -> bool:
        return self._climbing

    @property
    def target(self) -> Ned | None:
        return super().target if self._planned else None
