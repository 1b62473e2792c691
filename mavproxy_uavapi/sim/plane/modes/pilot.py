"""Modes in which the pilot's sticks decide. Their attitude control is simplified: sticks set bank and climb."""

from __future__ import annotations

import math

from ..airframe import Airframe
from ..demand import Demand, Throttle
from .base import Mode

ROLL_STICK, PITCH_STICK = 1, 2
MANUAL_BANK = math.radians(60)
STICK_CLIMB = 6.0
"""m/s of climb with the pitch stick at its end."""
GLIDE = -3.0
"""m/s without throttle."""


class PilotMode(Mode):
    """Roll stick: bank. Pitch stick: climb. Throttle stick: airspeed."""

    automatic_throttle = False
    limits_bank = True

    def step(self, dt: float) -> Demand:
        plane = self.plane
        sticks, now = plane.sticks, plane.now
        throttle = sticks.throttle(now)
        most = plane.navigator.steepest_bank if self.limits_bank else MANUAL_BANK
        bank = sticks.axis(ROLL_STICK, now) * most
        climb = -sticks.axis(PITCH_STICK, now) * STICK_CLIMB
        if throttle <= 0.0:
            return Demand(bank, climb + GLIDE, plane.navigator.airspeed_range[0], Throttle.IDLE)
        if not plane.body.airborne:
            return Demand(bank, climb, throttle=Throttle.FULL if throttle > 0.5 else Throttle.IDLE)
        return Demand(bank, climb, self._airspeed(throttle))

    def _airspeed(self, throttle: float) -> float:
        slowest, fastest = self.plane.navigator.airspeed_range
        return slowest + (fastest - slowest) * throttle


class SticksMode(PilotMode):
    """One of the modes that differ in their limits only."""

    def __init__(self, plane: Airframe, number: int, name: str, limits_bank: bool) -> None:
        super().__init__(plane)
        self.number, self.name, self.limits_bank = number, name, limits_bank


STICKS_MODES = (
    (0, "MANUAL", False),
    (2, "STABILIZE", True),
    (3, "TRAINING", True),
    (4, "ACRO", False),  # in ArduPlane the sticks are rates
    (5, "FBWA", True),
    (8, "AUTOTUNE", True),  # FBWA that learns, which is not simulated
)
"""Number, name, and whether the bank is limited."""


class FlyByWireB(PilotMode):
    """Pitch stick as climb rate; without it the altitude is held. Throttle stick as airspeed."""

    name = "FBWB"
    number = 6
    automatic_throttle = True

    _down: float | None = None

    def enter(self, checked: bool) -> bool:
        self._down = None
        return super().enter(checked)

    def step(self, dt: float) -> Demand:
        plane = self.plane
        if plane.throttle_suppressed and not plane.flying:
            return super().step(dt) if plane.sticks.throttle(plane.now) > 0 else Demand(throttle=Throttle.SUPPRESSED)
        stick = -plane.sticks.axis(PITCH_STICK, plane.now)
        if self._down is None or stick != 0.0:
            self._down = plane.estimator.position.down
        climb = stick * max(0.1, min(30.0, plane.parameters["FBWB_CLIMB_RATE"]))
        if stick == 0.0:
            climb = plane.navigator.climb_to(self._down)
        return Demand(self._bank(), climb, self._airspeed(plane.sticks.throttle(plane.now)))

    def _bank(self) -> float:
        plane = self.plane
        return plane.sticks.axis(ROLL_STICK, plane.now) * plane.navigator.steepest_bank


class Cruise(FlyByWireB):
    """FBWB that holds the course over ground while the roll stick is centred."""

    name = "CRUISE"
    number = 7

    _course: float | None = None

    def enter(self, checked: bool) -> bool:
        self._course = None
        return super().enter(checked)

    def _bank(self) -> float:
        plane = self.plane
        if plane.sticks.axis(ROLL_STICK, plane.now) != 0.0:
            self._course = None
            return super()._bank()
        if self._course is None:
            velocity = plane.estimator.velocity
            self._course = math.atan2(velocity.east, velocity.north)
        return plane.navigator.hold_course(self._course).bank
