"""Modes in which a pilot's sticks, or their absence, decide: STABILIZE, ALT_HOLD, LOITER and BRAKE."""

from __future__ import annotations

import math

from ..geodesy import Ned, rotate_to_ne
from ..physics import GRAVITY
from .base import Demand, Mode

BRAKE_DECELERATION = 7.5
"""m/s/s, BRAKE_MODE_DECEL_RATE."""


class PilotMode(Mode):
    """Helpers for modes that read the sticks."""

    def _lean(self) -> tuple[float, float]:
        """Horizontal acceleration north, east (m/s/s) that the roll and pitch sticks ask for."""
        copter = self.copter
        longest = GRAVITY * math.tan(copter.position.limits.lean)
        forward = -copter.sticks.axis(2, copter.now) * longest
        right = copter.sticks.axis(1, copter.now) * longest
        return rotate_to_ne(forward, right, copter.body.yaw)

    def _yaw_rate(self) -> float:
        return self.copter.sticks.axis(4, self.copter.now) * math.radians(self.copter.parameters["PILOT_Y_RATE"])

    def _climb_rate(self) -> float:
        """Metres per second upwards; the middle of the throttle stick (THR_DZ wide) holds the altitude."""
        copter = self.copter
        offset = copter.sticks.throttle(copter.now) - 0.5
        deadzone = max(0.0, min(0.3, copter.parameters["THR_DZ"] / 1000))
        if abs(offset) <= deadzone:
            return 0.0
        up, down = self._pilot_speeds()
        share = (abs(offset) - deadzone) / (0.5 - deadzone)
        return share * up if offset > 0 else -share * down

    def _pilot_speeds(self) -> tuple[float, float]:
        """Fastest climb and descent, m/s; PILOT_SPEED_DN 0 means the same as up."""
        parameters = self.copter.parameters
        up = max(parameters["PILOT_SPEED_UP"], 10) / 100
        return up, max(parameters["PILOT_SPEED_DN"], 0) / 100 or up

    def _apply_pilot_limits(self) -> None:
        copter = self.copter
        limits = copter.default_limits()
        limits.speed_up, limits.speed_down = self._pilot_speeds()
        limits.acceleration_z = max(copter.parameters["PILOT_ACCEL_Z"], 10) / 100
        copter.position.limits = limits

    def _still_on_ground(self) -> bool:
        """Whether to stay at idle; a raised throttle stick lifts the vehicle off."""
        copter = self.copter
        if not copter.armed:
            return True
        if copter.landed and self._climb_rate() > 0 and copter.spooled_up:
            copter.lift_off()
        return copter.landed


class Stabilize(PilotMode):
    """Sticks command lean angles and thrust directly."""

    name = "STABILIZE"
    number = 0
    needs_position = False
    manual_throttle = True
    positions = False

    def enter(self, checked: bool) -> bool:
        del checked
        self.copter.position.limits = self.copter.default_limits()
        return True

    def step(self, dt: float) -> Demand:
        del dt
        copter = self.copter
        throttle = copter.sticks.throttle(copter.now)
        if not copter.armed or (copter.landed and throttle == 0):
            return self.wait_on_ground()
        copter.relax()
        hover = copter.hover_throttle
        # Half stick hovers: below it thrust is linear to nothing, above it linear to full.
        share = throttle / 0.5 if throttle <= 0.5 else 1 + (throttle - 0.5) / 0.5 * (1 / hover - 1)
        if copter.landed and copter.spooled_up and share > 0.9:
            copter.lift_off()
        north, east = self._lean()
        return Demand(Ned(north, east, GRAVITY * (1 - share)), self._yaw_rate())


class AltHold(PilotMode):
    """Sticks command lean angles and climb rate."""

    name = "ALT_HOLD"
    number = 2
    needs_position = False
    positions = False

    def enter(self, checked: bool) -> bool:
        del checked
        self._apply_pilot_limits()
        return True

    def step(self, dt: float) -> Demand:
        copter = self.copter
        if self._still_on_ground():
            return self._wait()
        control, estimate = copter.position, copter.estimator
        control.follow_horizontally(estimate.position, estimate.velocity)
        control.climb_at(-self._climb_rate(), dt)
        north, east = self._lean()
        return Demand(Ned(north, east, self.fly(dt).thrust.down), self._yaw_rate())

    def _wait(self) -> Demand:
        demand = self.wait_on_ground()
        return Demand() if self._climb_rate() > 0 else demand


class Loiter(AltHold):
    """Sticks command velocity; centred they hold the position."""

    name = "LOITER"
    number = 5
    needs_position = True
    positions = True

    def step(self, dt: float) -> Demand:
        copter = self.copter
        if self._still_on_ground():
            return self._wait()
        control = copter.position
        speed = max(copter.parameters["LOIT_SPEED"], 20) / 100
        control.limits.speed = speed
        forward, right = -copter.sticks.axis(2, copter.now) * speed, copter.sticks.axis(1, copter.now) * speed
        control.fly_at(*rotate_to_ne(forward, right, copter.body.yaw), dt)
        control.climb_at(-self._climb_rate(), dt)
        return Demand(self.fly(dt).thrust, self._yaw_rate())


class Brake(Mode):
    """Stop as fast as possible and stay; neither sticks nor CONDITION_YAW do anything."""

    name = "BRAKE"
    number = 17
    armable = False

    def enter(self, checked: bool) -> bool:
        del checked
        limits = self.copter.default_limits()
        limits.acceleration = BRAKE_DECELERATION
        limits.speed = max(limits.speed, math.hypot(*self.copter.position.velocity[:2]))
        self.copter.position.limits = limits
        # Braking begins now, not after a started acceleration has run out.
        self.copter.position.acceleration[:2] = [0.0, 0.0]
        return True

    def step(self, dt: float) -> Demand:
        if self.copter.grounded:
            return self.wait_on_ground()
        return self.hold_still(dt)
