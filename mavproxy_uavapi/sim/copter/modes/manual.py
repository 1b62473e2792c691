"""Modes in which a pilot's sticks, or their absence, decide: STABILIZE, ALT_HOLD, LOITER and BRAKE."""

from __future__ import annotations

import math

from ...geodesy import Ned, rotate_to_ne
from ...physics import GRAVITY
from ...position_control import JERK
from ..demand import Demand
from .base import Mode

BRAKE_DECELERATION = 7.5
"""m/s/s, BRAKE_MODE_DECEL_RATE."""
BRAKE_GAIN = JERK / BRAKE_DECELERATION
"""1/s: what ArduCopter's shape_vel_accel_xy makes of the two, so that it brakes as long as it may."""


class PilotMode(Mode):
    """Helpers for modes that read the sticks."""

    def _lean(self) -> tuple[float, float]:
        """Horizontal acceleration north, east (m/s/s) that the roll and pitch sticks ask for."""
        aircraft = self.aircraft
        longest = GRAVITY * math.tan(aircraft.position.limits.lean)
        forward = -aircraft.sticks.axis(2, aircraft.now) * longest
        right = aircraft.sticks.axis(1, aircraft.now) * longest
        return rotate_to_ne(forward, right, aircraft.body.yaw)

    def _yaw_rate(self) -> float:
        aircraft = self.aircraft
        return aircraft.sticks.axis(4, aircraft.now) * math.radians(aircraft.parameters["PILOT_Y_RATE"])

    def _climb_rate(self) -> float:
        """Metres per second upwards; the middle of the throttle stick (THR_DZ wide) holds the altitude."""
        aircraft = self.aircraft
        offset = aircraft.sticks.throttle(aircraft.now) - 0.5
        deadzone = max(0.0, min(0.3, aircraft.parameters["THR_DZ"] / 1000))
        if abs(offset) <= deadzone:
            return 0.0
        up, down = self._pilot_speeds()
        share = (abs(offset) - deadzone) / (0.5 - deadzone)
        return share * up if offset > 0 else -share * down

    def _pilot_speeds(self) -> tuple[float, float]:
        """Fastest climb and descent, m/s; PILOT_SPD_DN 0 means the same as up."""
        parameters = self.aircraft.parameters
        up = max(parameters["PILOT_SPD_UP"], 0.1)
        return up, max(parameters["PILOT_SPD_DN"], 0) or up

    def _apply_pilot_limits(self) -> None:
        aircraft = self.aircraft
        limits = aircraft.default_limits()
        limits.speed_up, limits.speed_down = self._pilot_speeds()
        limits.acceleration_z = max(aircraft.parameters["PILOT_ACC_Z"], 0.1)
        aircraft.position.limits = limits

    def _still_on_ground(self) -> bool:
        """Whether to stay at idle; a raised throttle stick lifts the vehicle off."""
        aircraft = self.aircraft
        if not aircraft.armed:
            return True
        if aircraft.landed and self._climb_rate() > 0 and aircraft.spooled_up:
            aircraft.lift_off()
        return aircraft.landed


class Stabilize(PilotMode):
    """Sticks command lean angles and thrust directly."""

    name = "STABILIZE"
    number = 0
    needs_position = False
    manual_throttle = True
    navigates = False

    def enter(self, checked: bool) -> bool:
        self.aircraft.position.limits = self.aircraft.default_limits()
        return True

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        throttle = aircraft.sticks.throttle(aircraft.now)
        if not aircraft.armed or (aircraft.landed and throttle == 0):
            return self.wait_on_ground()
        aircraft.relax()
        hover = aircraft.hover_throttle
        # Half stick hovers: below it thrust is linear to nothing, above it linear to full.
        share = throttle / 0.5 if throttle <= 0.5 else 1 + (throttle - 0.5) / 0.5 * (1 / hover - 1)
        if aircraft.landed and aircraft.spooled_up and share > 0.9:
            aircraft.lift_off()
        north, east = self._lean()
        return Demand(Ned(north, east, GRAVITY * (1 - share)), self._yaw_rate())


class AltHold(PilotMode):
    """Sticks command lean angles and climb rate."""

    name = "ALT_HOLD"
    number = 2
    needs_position = False
    navigates = False

    def enter(self, checked: bool) -> bool:
        self._apply_pilot_limits()
        return True

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if self._still_on_ground():
            return self._wait()
        control, estimate = aircraft.position, aircraft.estimator
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
    navigates = True

    def step(self, dt: float) -> Demand:
        aircraft = self.aircraft
        if self._still_on_ground():
            return self._wait()
        control = aircraft.position
        speed = max(aircraft.parameters["LOIT_SPEED_MS"], 0.2)
        control.limits.speed = speed
        forward, right = -aircraft.sticks.axis(2, aircraft.now) * speed, aircraft.sticks.axis(1, aircraft.now) * speed
        control.fly_at(*rotate_to_ne(forward, right, aircraft.body.yaw), dt)
        control.climb_at(-self._climb_rate(), dt)
        return Demand(self.fly(dt).thrust, self._yaw_rate())


class Brake(Mode):
    """Stop as fast as possible and stay; neither sticks nor CONDITION_YAW do anything."""

    name = "BRAKE"
    number = 17
    armable = False

    def enter(self, checked: bool) -> bool:
        limits = self.aircraft.default_limits()
        limits.acceleration = BRAKE_DECELERATION
        limits.speed = max(limits.speed, math.hypot(*self.aircraft.position.velocity[:2]))
        self.aircraft.position.limits = limits
        # Braking begins now, not after a started acceleration has run out.
        self.aircraft.position.acceleration[:2] = [0.0, 0.0]
        return True

    def step(self, dt: float) -> Demand:
        if self.aircraft.grounded:
            return self.wait_on_ground()
        return self.hold_still(dt, BRAKE_GAIN)
