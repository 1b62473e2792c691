"""MANUAL, ACRO and STEERING, in which the sticks decide; HOLD, in which nothing does; and those never entered."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..chassis import Chassis
from ..drive import COAST, STOP, Drive
from .base import Mode

STEERING_STICK, THROTTLE_STICK = 1, 3
REFUSED = (
    (6, "FOLLOW", ""),
    (8, "DOCK", "Dock: target not acquired"),
    (16, "INITIALISING", ""),  # before the first one
)
"""Modes that Rover has, but there is no vehicle to follow and no dock: number, name, and what the rover says."""


class PilotMode(Mode):
    """Reads the sticks."""

    base_flags = mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    needs_position = False

    def _sticks(self) -> tuple[float, float]:
        """Steering and throttle, -1 to 1; backwards the wheel turns the car the other way, as a car does."""
        sticks, now = self.rover.sticks, self.rover.now
        throttle = sticks.axis(THROTTLE_STICK, now)
        steering = sticks.axis(STEERING_STICK, now)
        return (-steering if throttle < 0 else steering), throttle


class Manual(PilotMode):
    """Sticks command wheel angle and motor output."""

    name = "MANUAL"
    number = 0
    needs_velocity = False

    def step(self, dt: float) -> Drive:
        steering, throttle = self._sticks()
        rover = self.rover
        turn_rate = steering * abs(rover.body.speed) / max(rover.parameters["TURN_RADIUS"], 0.1)
        return Drive(throttle * rover.top_speed, turn_rate, rolls=True)


class Acro(PilotMode):
    """Sticks command turn rate and speed."""

    name = "ACRO"
    number = 1

    def step(self, dt: float) -> Drive:
        steering, throttle = self._sticks()
        turn_rate = math.radians(self.rover.parameters["ACRO_TURN_RATE"]) * steering
        return Drive(throttle * self.rover.top_speed, turn_rate)


class Steering(PilotMode):
    """Sticks command lateral acceleration and speed."""

    name = "STEERING"
    number = 3

    def step(self, dt: float) -> Drive:
        steering, throttle = self._sticks()
        rover = self.rover
        speed = abs(rover.body.speed)
        radius = max(rover.parameters["TURN_RADIUS"], 0.1)
        lateral = max(0.1, min(speed * speed / radius, rover.parameters["ATC_TURN_MAX_G"] * 9.80665))
        return Drive(throttle * rover.top_speed, lateral * steering / max(speed, 0.1))


class Hold(Mode):
    """No throttle and straight wheels: the rover rolls until it stands."""

    name = "HOLD"
    number = 4
    needs_position = False
    needs_velocity = False

    def step(self, dt: float) -> Drive:
        return COAST


class Refused(Mode):
    """A mode that is never entered."""

    def __init__(self, rover: Chassis, number: int, name: str, why: str) -> None:
        super().__init__(rover)
        self.number, self.name, self._why = number, name, why

    def enter(self, checked: bool) -> bool:
        if self._why:
            self.rover.say(mavlink.MAV_SEVERITY_NOTICE, self._why)
        return False

    def step(self, dt: float) -> Drive:
        return STOP
