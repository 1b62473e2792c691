"""The truth about a car: it goes where its nose points, or backwards, over flat ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..geodesy import wrap_pi
from ..physics import Body

COAST_TIME = 1.92
"""Seconds in which a car without throttle loses all but a third of its speed, as SITL's."""
STANDSTILL = 0.02
"""m/s below which it stands."""


@dataclass(frozen=True)
class Grip:
    """What wheels and steering can do: m/s/s, metres, rad/s, rad/s/s."""

    acceleration: float
    deceleration: float
    lateral: float
    radius: float
    turn_rate: float
    turn_acceleration: float


@dataclass
class CarBody(Body):
    """speed is m/s forward, negative backwards."""

    speed: float = 0.0

    def drive(self, speed: float, turn_rate: float, grip: Grip, dt: float) -> None:
        """Move for dt seconds with the requested speed (m/s) and turn rate (rad/s), within its limits."""
        faster = abs(speed) > abs(self.speed) and speed * self.speed >= 0
        change = (grip.acceleration if faster else grip.deceleration) * dt
        self._move(self.speed + max(-change, min(change, speed - self.speed)), turn_rate, grip, dt)

    def throttle(self, top_speed: float, turn_rate: float, grip: Grip, dt: float) -> None:
        """Move for dt seconds with a throttle that ends at top_speed (m/s); 0 lets it roll."""
        self._move(self.speed + (top_speed - self.speed) * min(1.0, dt / COAST_TIME), turn_rate, grip, dt)

    def _move(self, speed: float, turn_rate: float, grip: Grip, dt: float) -> None:
        self.speed = 0.0 if abs(speed) < STANDSTILL and abs(speed) <= abs(self.speed) else speed
        self._turn_wheels(turn_rate, grip, dt)
        self.yaw = wrap_pi(self.yaw + self.yaw_rate * dt)
        self.velocity_north = self.speed * math.cos(self.yaw)
        self.velocity_east = self.speed * math.sin(self.yaw)
        self.north += self.velocity_north * dt
        self.east += self.velocity_east * dt

    def _turn_wheels(self, turn_rate: float, grip: Grip, dt: float) -> None:
        size = abs(self.speed)
        most = min(grip.turn_rate, size / grip.radius, grip.lateral / size if size > 0 else math.inf)
        rate = max(-most, min(most, turn_rate))
        change = grip.turn_acceleration * dt
        self.yaw_rate += max(-change, min(change, rate - self.yaw_rate))
        self.yaw_rate = max(-most, min(most, self.yaw_rate))
