"""LOITER: stop, and come back within LOIT_RADIUS when pushed away."""

from __future__ import annotations

import math

from ...geodesy import Ned, wrap_pi
from ...reports import Navigation
from ..drive import STOP, Drive
from ..navigator import HEADING_P, grip
from .base import Mode

FORWARD_ONLY_BACKWARDS = 2
"""LOIT_TYPE; 0 takes the shorter way, 1 always goes forward."""


class Loiter(Mode):
    """Stays at the place where braking from the present speed ends."""

    name = "LOITER"
    number = 5
    navigates = True

    _place = Ned(0.0, 0.0, 0.0)

    def enter(self, checked: bool) -> bool:
        rover = self.rover
        if checked and not rover.estimator.ready:
            return False
        speed = rover.body.speed
        way = math.copysign(speed * speed / (2 * grip(rover.parameters).deceleration), speed)
        here = rover.estimator.position
        self._place = Ned(
            here.north + way * math.cos(rover.body.yaw), here.east + way * math.sin(rover.body.yaw), here.down
        )
        return True

    def step(self, dt: float) -> Drive:
        rover, here = self.rover, self.rover.estimator.position
        away = math.dist(here[:2], self._place[:2]) - rover.parameters["LOIT_RADIUS"]
        if away <= 0:
            return STOP
        speed = min(away * rover.parameters["LOIT_SPEED_GAIN"], rover.parameters["WP_SPEED"])
        bearing = math.atan2(self._place.east - here.east, self._place.north - here.north)
        error = wrap_pi(bearing - rover.body.yaw)
        kind = int(rover.parameters["LOIT_TYPE"])
        if kind == FORWARD_ONLY_BACKWARDS or (kind == 0 and abs(error) > math.pi / 2):
            error, speed = wrap_pi(error + math.pi), -speed
        return Drive(speed * (1 - 0.5 * min(abs(error) / (math.pi / 2), 1.0)), HEADING_P * error)

    @property
    def target(self) -> Ned | None:
        return self._place

    def navigation(self) -> Navigation | None:
        return Navigation(distance=math.dist(self.rover.estimator.position[:2], self._place[:2]))
