"""The truth: a body pushed by its thrust, gravity and the wind over flat ground.

Everything is NED metres from the place the vehicle stood at boot, with down = 0 on the ground, radians and
seconds. Attitude follows from the requested thrust: a multicopter leans to accelerate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

from .geodesy import Ned, wrap_pi
from .shaping import limit_size

GRAVITY = 9.80665
MOMENTUM_DRAG, FORM_DRAG = 0.241, 0.0336
"""Deceleration per airspeed (1/s) at the thrust that hovers, and per its square (1/m).

Those of SITL's quadcopter, which leans by 45 degrees at 15.08 m/s and whose propellers take a share of 0.2 of the
momentum of the air (3 kg, 0.385 m² of discs, 593 m AMSL). With 30 degrees it does not get beyond 10.2 m/s.
"""
LEAST_THRUST = 0.01
"""Share of the thrust that hovers, below which the airframe is taken to be level."""
THRUST_LAG = 0.1
"""Time constant of thrust and lean, seconds."""
YAW_ACCELERATION = math.radians(270)
"""ATC_ACCEL_Y_MAX of a default quad, rad/s/s."""

AnyBody = TypeVar("AnyBody", bound="Body")


@dataclass
class Body:
    """Position, velocity, attitude and rates, as they truly are."""

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0
    velocity_north: float = 0.0
    velocity_east: float = 0.0
    velocity_down: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    yaw_rate: float = 0.0
    # Acceleration that the propellers give beyond holding up the weight, which is what a controller asks for.
    thrust_north: float = 0.0
    thrust_east: float = 0.0
    thrust_down: float = GRAVITY
    wind_north: float = 0.0
    wind_east: float = 0.0

    @classmethod
    def at_rest(cls: type[AnyBody], heading: float) -> AnyBody:
        """Standing at the start, heading in degrees."""
        return cls(yaw=wrap_pi(math.radians(heading)))

    @property
    def position(self) -> Ned:
        """Metres from the start."""
        return Ned(self.north, self.east, self.down)

    @property
    def velocity(self) -> Ned:
        """Metres per second over ground."""
        return Ned(self.velocity_north, self.velocity_east, self.velocity_down)

    @property
    def on_ground(self) -> bool:
        """Whether the skids touch."""
        return self.down >= 0.0

    @property
    def throttle_share(self) -> float:
        """Thrust divided by the thrust that hovers; zero with the motors off."""
        lift = GRAVITY - self.thrust_down
        return math.sqrt(lift * lift + self.thrust_north**2 + self.thrust_east**2) / GRAVITY

    def step(self, thrust: Ned, yaw_rate: float, dt: float) -> None:
        """Advance by dt seconds with the requested thrust (m/s/s beyond weight) and yaw rate (rad/s)."""
        share = min(1.0, dt / THRUST_LAG)
        self.thrust_north += (thrust.north - self.thrust_north) * share
        self.thrust_east += (thrust.east - self.thrust_east) * share
        self.thrust_down += (thrust.down - self.thrust_down) * share
        drag = self._drag()
        acceleration_down = self.thrust_down + drag.down
        if self.on_ground and acceleration_down >= 0:
            self._rest()
            return
        self.velocity_north += (self.thrust_north + drag.north) * dt
        self.velocity_east += (self.thrust_east + drag.east) * dt
        self.velocity_down += acceleration_down * dt
        self.north += self.velocity_north * dt
        self.east += self.velocity_east * dt
        self.down += self.velocity_down * dt
        if self.down > 0:
            self._rest()
            return
        self._turn(yaw_rate, dt)

    def _drag(self) -> Ned:
        """m/s/s by the air, along the propellers' axis and across it, each by the airspeed there."""
        share = self.throttle_share
        if share < LEAST_THRUST:
            axis = (0.0, 0.0, -1.0)
        else:
            weight = GRAVITY * share
            axis = (self.thrust_north / weight, self.thrust_east / weight, (self.thrust_down - GRAVITY) / weight)
        north, east = self.velocity_north - self.wind_north, self.velocity_east - self.wind_east
        along = north * axis[0] + east * axis[1] + self.velocity_down * axis[2]
        across = (north - along * axis[0], east - along * axis[1], self.velocity_down - along * axis[2])
        linear = MOMENTUM_DRAG * math.sqrt(share)
        axial = along * (linear + FORM_DRAG * abs(along))
        radial = linear + FORM_DRAG * math.hypot(*across)
        return Ned(*(-axial * unit - radial * part for unit, part in zip(axis, across, strict=True)))

    def _turn(self, yaw_rate: float, dt: float) -> None:
        change = YAW_ACCELERATION * dt
        self.yaw_rate += limit_size(yaw_rate - self.yaw_rate, change)
        self.yaw = wrap_pi(self.yaw + self.yaw_rate * dt)
        cos_yaw, sin_yaw = math.cos(self.yaw), math.sin(self.yaw)
        forward = self.thrust_north * cos_yaw + self.thrust_east * sin_yaw
        right = self.thrust_east * cos_yaw - self.thrust_north * sin_yaw
        lift = max(GRAVITY - self.thrust_down, 1.0)
        pitch, roll = math.atan2(-forward, lift), math.atan2(right, lift)
        self.roll_rate, self.pitch_rate = (roll - self.roll) / dt, (pitch - self.pitch) / dt
        self.roll, self.pitch = roll, pitch

    def _rest(self) -> None:
        """The ground stops all motion; the airframe stands level on it."""
        self.down = 0.0
        self.velocity_north = self.velocity_east = self.velocity_down = 0.0
        self.roll = self.pitch = self.roll_rate = self.pitch_rate = self.yaw_rate = 0.0
        self.thrust_north = self.thrust_east = 0.0
