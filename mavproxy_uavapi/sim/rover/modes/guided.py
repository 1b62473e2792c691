"""GUIDED: the companion computer or the ground says where to go, or how fast which way."""

from __future__ import annotations

import math
from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...events import ItemReached
from ...geodesy import Ned, wrap_pi
from ...reports import Navigation
from ..drive import STOP, Drive
from ..navigator import HEADING_P
from .base import NavigatingMode

TIMEOUT = 3.0
"""Seconds after which a heading or turn rate that is not renewed stops the rover."""


class GuidedSubmode(Enum):
    """Which kind of setpoint came last."""

    STOP = auto()
    POSITION = auto()
    HEADING = auto()
    TURN_RATE = auto()


class Guided(NavigatingMode):
    """Setpoints outlive a disarming: an armed rover goes on to its target."""

    name = "GUIDED"
    number = 15

    submode = GuidedSubmode.STOP
    _turn = 0.0
    """Heading in radians or turn rate in rad/s, by submode."""
    _speed = 0.0
    _updated = -math.inf
    _expired = True
    _arrival_told = True

    def enter(self, checked: bool) -> bool:
        self.submode = GuidedSubmode.STOP
        self.rover.navigator.start()
        return True

    def go_to(self, target: Ned) -> None:
        """Drive to a place, NED metres from the EKF origin, and stop there."""
        self.submode, self._arrival_told = GuidedSubmode.POSITION, False
        self.rover.navigator.go_to(target)

    def drive_towards(self, heading: float, speed: float) -> None:
        """Hold a heading (radians) at a speed (m/s, negative backwards) for three seconds."""
        self._start(GuidedSubmode.HEADING, heading, speed)

    def turn_at(self, rate: float, speed: float) -> None:
        """Turn at a rate (rad/s) at a speed (m/s, negative backwards) for three seconds."""
        self._start(GuidedSubmode.TURN_RATE, rate, speed)

    def _start(self, submode: GuidedSubmode, turn: float, speed: float) -> None:
        self.submode, self._turn, self._speed = submode, turn, speed
        self._updated, self._expired = self.rover.now, False

    def step(self, dt: float) -> Drive:
        if self.submode is GuidedSubmode.STOP:
            return STOP
        if self.submode is GuidedSubmode.POSITION:
            return self._drive_to_target(dt)
        self._watch_time()
        if self._expired:
            return STOP
        if self.submode is GuidedSubmode.TURN_RATE:
            return Drive(self._speed, self._turn)
        return Drive(self._speed, HEADING_P * wrap_pi(self._turn - self.rover.body.yaw))

    def _drive_to_target(self, dt: float) -> Drive:
        drive = self.rover.navigator.step(dt)
        if self.rover.navigator.reached and not self._arrival_told:
            self._arrival_told = True
            self.rover.emit(ItemReached(0))
        return drive

    def _watch_time(self) -> None:
        if not self._expired and self.rover.now - self._updated > TIMEOUT:
            self._expired = True
            self.rover.say(mavlink.MAV_SEVERITY_WARNING, "target not received last 3secs, stopping")

    def set_speed(self, speed: float) -> bool:
        return self.submode is GuidedSubmode.POSITION and super().set_speed(speed)

    @property
    def target(self) -> Ned | None:
        return super().target if self.submode is GuidedSubmode.POSITION else None

    def navigation(self) -> Navigation | None:
        return super().navigation() if self.submode is GuidedSubmode.POSITION else Navigation()
