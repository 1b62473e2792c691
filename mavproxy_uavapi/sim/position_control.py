"""From a target to a thrust: the desired trajectory and the controller that keeps the vehicle on it.

Positions are NED metres from the EKF origin, as the estimator gives them. The desired trajectory is shaped
within the limits (`shaping`); the controller is ArduCopter's cascade, position to velocity to acceleration,
with the default gains of PSC_POSXY_P, PSC_VELXY_P/I and their vertical counterparts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

from . import shaping
from .geodesy import Ned
from .physics import GRAVITY, MOMENTUM_DRAG

POSITION_P = 1.0
VELOCITY_P_XY = 2.0
VELOCITY_P_Z = 5.0
INTEGRATOR = 1.0
INTEGRATOR_LIMIT = 10.0
JERK = 5.0
"""PSC_JERK_XY and PSC_JERK_Z, m/s/s/s."""
LEG_JERK = 1.0
"""WP_JERK, m/s/s/s: the desired state slows down for a vehicle that cannot follow as fast as it changes speed."""
AHEAD = 0.05
"""Share of the desired speed by which the desired state may outpace the vehicle."""


class Speed(Enum):
    """Which of the speed limits."""

    HORIZONTAL = auto()
    UP = auto()
    DOWN = auto()


SPEED_KINDS = {0: Speed.HORIZONTAL, 1: Speed.HORIZONTAL, 2: Speed.UP, 3: Speed.DOWN}
"""SPEED_TYPE of MAV_CMD_DO_CHANGE_SPEED; airspeed counts as ground speed, as in ArduCopter."""


@dataclass
class MotionLimits:
    """Speeds in m/s, accelerations in m/s/s, lean in radians."""

    speed: float = 10.0
    speed_up: float = 2.5
    speed_down: float = 1.5
    acceleration: float = 2.5
    acceleration_z: float = 1.0
    lean: float = math.radians(30)

    def change(self, kind: Speed, speed: float) -> None:
        """Set one speed limit, m/s."""
        if kind is Speed.UP:
            self.speed_up = speed
        elif kind is Speed.DOWN:
            self.speed_down = speed
        else:
            self.speed = speed


class PositionController:
    """Holds the desired position, velocity and acceleration and computes the thrust that follows them."""

    def __init__(self) -> None:
        self.limits = MotionLimits()
        self.position = [0.0, 0.0, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.acceleration = [0.0, 0.0, 0.0]
        self._integral = [0.0, 0.0, 0.0]
        self._flown = (Ned(0.0, 0.0, 0.0), Ned(0.0, 0.0, 0.0))  # where the vehicle is, and its velocity
        self._pace = 1.0
        self._limited = (0.0, 0.0)  # the direction in which it leans as far as it may; nowhere if it does not

    def start_at(self, position: Ned, velocity: Ned) -> None:
        """Take the vehicle as it is for the desired state, without a jump; forget wind corrections."""
        self.position = list(position)
        self.velocity = list(velocity)
        self.acceleration = [0.0, 0.0, 0.0]
        self._integral = [0.0, 0.0, 0.0]
        self._flown = (position, velocity)
        self._pace, self._limited = 1.0, (0.0, 0.0)

    def follow_horizontally(self, position: Ned, velocity: Ned) -> None:
        """Take the horizontal state as it is: no mode commands it (manual flight, ground)."""
        self.position[:2], self.velocity[:2] = position[:2], velocity[:2]
        self.acceleration[:2] = [0.0, 0.0]
        self._integral[:2] = [0.0, 0.0]

    @property
    def stopping_point(self) -> Ned:
        """Where braking from the desired velocity ends, metres NED."""
        speed = math.hypot(self.velocity[0], self.velocity[1])
        distance = _stopping_distance(speed, self.limits.acceleration)
        scale = distance / speed if speed > 1e-6 else 0.0
        climb = _stopping_distance(abs(self.velocity[2]), self.limits.acceleration_z)
        return Ned(
            self.position[0] + self.velocity[0] * scale,
            self.position[1] + self.velocity[1] * scale,
            self.position[2] + math.copysign(climb, self.velocity[2]),
        )

    def go_to(self, target: Ned, dt: float) -> None:
        """Move the desired state straight towards target and stop there, no faster than the vehicle follows."""
        limits = self.limits
        dt *= self._followed(dt)
        error_n, error_e = target.north - self.position[0], target.east - self.position[1]
        error_d = target.down - self.position[2]
        distance = math.hypot(error_n, error_e)
        speed_xy, speed_z = shaping.speeds_along(distance, error_d, limits.speed, limits.speed_up, limits.speed_down)
        braking = shaping.BRAKING_SHARE * limits.acceleration
        speed = min(shaping.square_root_speed(distance, shaping.POSITION_GAIN, braking), speed_xy)
        scale = speed / distance if distance > 1e-9 else 0.0
        self.fly_at(error_n * scale, error_e * scale, dt)
        self.climb_at(shaping.approach_1d(error_d, speed_z, speed_z, limits.acceleration_z), dt)

    def go_to_altitude(self, down: float, dt: float) -> None:
        """Climb or descend to down (metres NED) within the vertical limits; horizontal state untouched."""
        limits = self.limits
        error = down - self.position[2]
        self.climb_at(shaping.approach_1d(error, limits.speed_down, limits.speed_up, limits.acceleration_z), dt)

    def track(self, position: Ned, velocity: Ned, acceleration: Ned, dt: float) -> None:
        """Follow a target that moves itself (position with velocity, as GUIDED takes them)."""
        limits = self.limits
        error_n, error_e = position.north - self.position[0], position.east - self.position[1]
        distance = math.hypot(error_n, error_e)
        braking = shaping.BRAKING_SHARE * limits.acceleration
        speed = shaping.square_root_speed(distance, shaping.POSITION_GAIN, braking)
        scale = speed / distance if distance > 1e-9 else 0.0
        self.fly_at(velocity.north + error_n * scale, velocity.east + error_e * scale, dt)
        climb = shaping.approach_1d(
            position.down - self.position[2], limits.speed_down, limits.speed_up, limits.acceleration_z
        )
        self.climb_at(velocity.down + climb, dt)

    def fly_at(self, north: float, east: float, dt: float, gain: float = shaping.VELOCITY_GAIN) -> None:
        """Bring the desired horizontal velocity (m/s) towards north, east and move along; gain in 1/s."""
        limits = self.limits
        north, east = shaping.limit_length(north, east, limits.speed)
        error = (north - self.velocity[0], east - self.velocity[1])
        current = (self.acceleration[0], self.acceleration[1])
        north, east = shaping.accelerate_2d(error, current, limits.acceleration, JERK, dt, gain=gain)
        self._advance_level(north, east, dt)

    def accelerate_at(self, acceleration: Ned, dt: float) -> None:
        """Apply a commanded acceleration (m/s/s) within the speed limits."""
        limits = self.limits
        north, east = shaping.limit_length(acceleration.north, acceleration.east, limits.acceleration)
        self._advance_level(north, east, dt)
        self.velocity[0], self.velocity[1] = shaping.limit_length(self.velocity[0], self.velocity[1], limits.speed)
        self._advance(2, max(-limits.acceleration_z, min(limits.acceleration_z, acceleration.down)), dt)
        self.velocity[2] = max(-limits.speed_up, min(limits.speed_down, self.velocity[2]))

    def climb_at(self, down: float, dt: float) -> None:
        """Bring the desired vertical velocity (m/s, down positive) towards down and move along."""
        limits = self.limits
        down = max(-limits.speed_up, min(limits.speed_down, down))
        error = down - self.velocity[2]
        self._advance(2, shaping.accelerate_1d(error, self.acceleration[2], limits.acceleration_z, JERK, dt), dt)

    def _followed(self, dt: float) -> float:
        """The share of its speed at which the desired state goes on, so that it does not outpace the vehicle."""
        here, moving = self._flown
        speed = math.hypot(*self.velocity)
        wanted = 1.0
        if speed > 1e-6:
            behind = sum(v * (d - h) for v, d, h in zip(self.velocity, self.position, here, strict=True)) / speed
            along = sum(v * m for v, m in zip(self.velocity, moving, strict=True)) / speed
            wanted = max(0.0, min(1.0, AHEAD + (along - POSITION_P * behind) / speed))
        self._pace += (wanted - self._pace) * min(1.0, dt * LEG_JERK / self.limits.acceleration)
        return self._pace

    def _advance_level(self, north: float, east: float, dt: float) -> None:
        """Move on over the ground, but not farther ahead of a vehicle that leans as far as it may."""
        before = self.position[:2]
        self._advance(0, north, dt)
        self._advance(1, east, dt)
        ahead, limited = self.position, self._limited
        here = self._flown[0]
        outpaces = (ahead[0] - here.north) * limited[0] + (ahead[1] - here.east) * limited[1] > 0
        if outpaces and self.velocity[0] * limited[0] + self.velocity[1] * limited[1] > 0:
            self.position[:2] = before

    def _advance(self, axis: int, acceleration: float, dt: float) -> None:
        self.acceleration[axis] = acceleration
        self.velocity[axis] += acceleration * dt
        self.position[axis] += self.velocity[axis] * dt

    def thrust(self, position: Ned, velocity: Ned, dt: float) -> Ned:
        """Acceleration (m/s/s beyond weight) that keeps the vehicle, now at position, on the trajectory."""
        self._flown = (position, velocity)
        down = self._push(2, VELOCITY_P_Z, position.down, velocity.down, dt) + MOMENTUM_DRAG * self.velocity[2]
        down = max(-GRAVITY, min(0.9 * GRAVITY, down))
        before = self._integral[:2]
        wanted = [self._push(axis, VELOCITY_P_XY, position[axis], velocity[axis], dt) for axis in (0, 1)]
        north, east = shaping.limit_along(
            (wanted[0], wanted[1]), (self.velocity[0], self.velocity[1]), GRAVITY * math.tan(self.limits.lean)
        )
        self._limited = (0.0, 0.0)
        if (north, east) != (wanted[0], wanted[1]):
            self._limited = (north, east)
            if math.hypot(*self._integral[:2]) > math.hypot(*before):
                self._integral[:2] = before
        # It leans as if its propellers gave its weight; what they give more or less pushes it, too.
        lift = (GRAVITY - down) / GRAVITY
        return Ned(north * lift, east * lift, down)

    def _push(self, axis: int, gain: float, position: float, velocity: float, dt: float) -> float:
        """The acceleration that one axis wants; its integrator finds the wind and the drag."""
        error = self.velocity[axis] + POSITION_P * (self.position[axis] - position) - velocity
        integral = shaping.limit_size(self._integral[axis] + INTEGRATOR * error * dt, INTEGRATOR_LIMIT)
        self._integral[axis] = integral
        return self.acceleration[axis] + gain * error + integral


def _stopping_distance(speed: float, acceleration: float) -> float:
    braking = shaping.BRAKING_SHARE * acceleration
    linear = braking / shaping.POSITION_GAIN
    if speed <= linear:
        return speed / shaping.POSITION_GAIN
    return speed * speed / (2 * braking) + linear / (2 * shaping.POSITION_GAIN)
