"""The truth about a plane: it rolls along the ground, and flies where its nose points and the wind carries it.

The flight is kinematic: bank, climb rate and airspeed follow what is demanded within limits; there is no stall and
no crash. The figures are those of SITL's plane, as measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..geodesy import wrap_pi
from ..physics import GRAVITY, Body

ROLL_TIME = 0.35
"""Time constant of the bank, seconds."""
ROLL_RATE = math.radians(90)
"""RLL2SRV_RMAX of SITL's plane, rad/s."""
CLIMB_TIME = 0.7
"""Time constant of the climb rate, seconds."""
VERTICAL_ACCELERATION = 7.0
"""TECS_VERT_ACC, m/s/s."""
SPEED_TIME = 2.5
"""Time constant of the airspeed, seconds."""
ACCELERATION = 2.0
"""m/s/s of the airspeed in flight."""
IDLE_DRAG = 0.0125
"""1/m: m/s/s of the airspeed without throttle, by its square, in a flare."""
FULL_THRUST = 11.0
"""m/s/s at a stand with full throttle."""
TOP_SPEED = 31.0
"""m/s at which full throttle no longer accelerates."""
FRICTION = 0.32
"""m/s/s for each m/s over ground, of the wheels (0.3) and the air without throttle."""
STANDSTILL = 0.1
"""m/s over ground below which it stands."""
GROUND_TURN_RATE = math.radians(30)
"""rad/s of the nose wheel."""
STEEPEST = 0.7
"""Sine of the steepest path."""


@dataclass
class PlaneBody(Body):
    """A plane's motion.

    airspeed is the true one, m/s along the nose; airborne says whether the wheels have left the ground. turn_share is
    the share of a coordinated turn's rate that a bank gives; SITL's planes slip.
    """

    airspeed: float = 0.0
    airborne: bool = False
    turn_share: float = 0.74

    def fly(self, bank: float, climb: float, airspeed: float, dt: float, *, idle: bool = False) -> None:
        """Fly for dt seconds towards a bank (rad), a climb rate and a true airspeed (m/s), or idle without that."""
        rate = max(-ROLL_RATE, min(ROLL_RATE, (bank - self.roll) / ROLL_TIME))
        self.roll_rate = rate
        self.roll += rate * dt
        falls = GRAVITY * max(self.velocity_down, 0.0) / max(self.airspeed, 5.0)  # what a descent gives it
        faster = max(falls - ACCELERATION, min(ACCELERATION, (airspeed - self.airspeed) / SPEED_TIME))
        if idle:
            faster = falls - IDLE_DRAG * self.airspeed * self.airspeed
        self.airspeed += faster * dt
        now = -self.velocity_down
        lift = max(-VERTICAL_ACCELERATION, min(VERTICAL_ACCELERATION, (climb - now) / CLIMB_TIME))
        steepest = STEEPEST * self.airspeed
        self.yaw_rate = self.turn_share * GRAVITY * math.tan(self.roll) / max(self.airspeed, 5.0)
        self._move(max(-steepest, min(steepest, now + lift * dt)), dt)

    def run(self, throttle: float, course: float | None, dt: float) -> None:
        """Run along the ground for dt seconds with a throttle of 0..1, steering to a course in rad."""
        self.roll = self.roll_rate = 0.0
        thrust = throttle * FULL_THRUST * (1 - self.airspeed / TOP_SPEED)
        headwind = -(self.wind_north * math.cos(self.yaw) + self.wind_east * math.sin(self.yaw))
        ground_speed = self.airspeed - headwind
        if throttle <= 0.0:
            ground_speed -= FRICTION * max(ground_speed, 0.0) * dt
            ground_speed = ground_speed if ground_speed > STANDSTILL else 0.0
        else:
            ground_speed = max(0.0, ground_speed + thrust * dt)
        self.airspeed = ground_speed + headwind
        error = 0.0 if course is None else wrap_pi(course - self.yaw)
        self.yaw_rate = max(-GROUND_TURN_RATE, min(GROUND_TURN_RATE, error)) if ground_speed > 0 else 0.0
        self.yaw = wrap_pi(self.yaw + self.yaw_rate * dt)
        self.pitch = self.pitch_rate = 0.0
        self.velocity_north = ground_speed * math.cos(self.yaw)
        self.velocity_east = ground_speed * math.sin(self.yaw)
        self.velocity_down = self.down = 0.0
        self.north += self.velocity_north * dt
        self.east += self.velocity_east * dt

    def take_off(self) -> None:
        """Leave the ground now."""
        self.airborne = True

    def rest_on_ground(self) -> None:
        """Stand on the ground without moving through the air but for the wind."""
        self.airborne = False
        self.down = self.velocity_down = self.roll = self.roll_rate = self.pitch = 0.0

    def _move(self, climb: float, dt: float) -> None:
        pitch = math.asin(max(-1.0, min(1.0, climb / max(self.airspeed, 1.0))))
        self.pitch_rate, self.pitch = (pitch - self.pitch) / dt, pitch
        self.yaw = wrap_pi(self.yaw + self.yaw_rate * dt)
        level = self.airspeed * math.cos(pitch)
        self.velocity_north = level * math.cos(self.yaw) + self.wind_north
        self.velocity_east = level * math.sin(self.yaw) + self.wind_east
        self.velocity_down = -climb
        self.north += self.velocity_north * dt
        self.east += self.velocity_east * dt
        self.down += self.velocity_down * dt
        if self.down >= 0.0:
            self.rest_on_ground()
