"""The truth about a plane: it rolls along the ground, and flies where its nose points and the wind carries it.

It is a point with the thrust, the drag and the side force of SITL's plane. Bank and climb rate follow what is
demanded within limits, the speed follows from throttle, drag and climb, the turn from the bank and what the wings
carry. There is no stall and no crash.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..geodesy import wrap_pi
from ..physics import GRAVITY, Body

ROLL_TIME = 0.25
"""RLL2SRV_TCONST of SITL's plane, s: the roll rate is the error of the bank divided by it."""
ROLL_RATE = math.radians(90)
"""RLL2SRV_RMAX of SITL's plane, rad/s."""
ROLL_LAG = 0.17
"""Time constant with which the roll rate follows, s."""
CLIMB_TIME = 0.3
"""Time constant of the climb rate with level wings, s; in a bank its pitch turns the plane as well."""
VERTICAL_ACCELERATION = 16.0
"""m/s/s."""
SLIP_TIME = 0.25
"""Time constant with which the nose follows a turn, s."""
MASS = 2.0
"""kg."""
THRUST = MASS * GRAVITY / 0.7
"""N with full throttle, at any speed: 0.7 of it would carry the plane."""
WING = 0.45
"""m²."""
DRAG = 0.1
"""Drag coefficient; that of the lift is little beside it."""
SIDE_AREA = 1.264
"""m³: a turn at a rate r slips, and the air then pushes outwards with 0.5 * density * airspeed * r * this.

The fin turns the nose until its moment (0.25 for each rad of slip, with the centre of gravity's 0.15 m 0.33) is the
damping's (1, by half the span of 1.88 m); what is left of the turn is 0.75 of a coordinated one's rate at 600 m AMSL.
"""
ROTATION = 0.75
"""Share of the climb rate that it has at once when it leaves the ground."""
FRICTION = 0.3
"""m/s/s for each m/s over ground, of the wheels."""
STANDSTILL = 0.1
"""m/s over ground below which it stands."""
GROUND_TURN_RATE = math.radians(30)
"""rad/s of the nose wheel."""
STEEPEST = 0.7
"""Sine of the steepest path."""
SLOWEST = 8.0
"""m/s of airspeed below which it sinks, whatever is demanded."""


@dataclass
class PlaneBody(Body):
    """A plane's motion.

    airspeed is the true one, m/s along the nose; airborne says whether the wheels have left the ground; mass is in
    kg, density that of the air in kg/m³.
    """

    airspeed: float = 0.0
    airborne: bool = False
    mass: float = MASS
    density: float = 1.1
    _met: tuple[float, float] = (0.0, 0.0)
    """The wind of the step before, m/s to the north and to the east."""

    @property
    def slip_share(self) -> float:
        """The share of a turn's rate that slipping takes back."""
        return 0.5 * self.density * SIDE_AREA / self.mass

    @property
    def drag(self) -> float:
        """m/s/s of the air."""
        return 0.5 * self.density * WING * DRAG / self.mass * self.airspeed * self.airspeed

    def fly(self, bank: float, climb: float, throttle: float, dt: float) -> None:
        """Fly for dt seconds towards a bank (rad) and a climb rate (m/s) with a throttle of 0..1."""
        self._meet_wind()
        rate = max(-ROLL_RATE, min(ROLL_RATE, (bank - self.roll) / ROLL_TIME))
        self.roll_rate += (rate - self.roll_rate) * min(1.0, dt / ROLL_LAG)
        self.roll += self.roll_rate * dt
        speed, now = max(self.airspeed, 5.0), -self.velocity_down
        steepest = STEEPEST * self.airspeed
        wanted = min(climb, self.airspeed - SLOWEST)
        lift = (wanted - now) / CLIMB_TIME * max(math.cos(self.roll), 0.2)
        lift = max(-VERTICAL_ACCELERATION, min(VERTICAL_ACCELERATION, lift))
        then = max(-steepest, min(steepest, now + lift * dt))
        turn = max(GRAVITY + lift, 0.0) * math.tan(self.roll) / speed - self.slip_share * self.yaw_rate
        self.yaw_rate += (turn - self.yaw_rate) * min(1.0, dt / SLIP_TIME)
        self.yaw = wrap_pi(self.yaw + turn * dt)
        self.airspeed += (throttle * THRUST / self.mass - self.drag - GRAVITY * now / speed) * dt
        self._move(then, dt)

    def run(self, throttle: float, course: float | None, dt: float) -> None:
        """Run along the ground for dt seconds with a throttle of 0..1, steering to a course in rad."""
        self.roll = self.roll_rate = 0.0
        self._met = self.wind_north, self.wind_east
        headwind = -(self.wind_north * math.cos(self.yaw) + self.wind_east * math.sin(self.yaw))
        ground_speed = self.airspeed - headwind
        faster = throttle * THRUST / self.mass - self.drag - FRICTION * ground_speed
        ground_speed = max(0.0, ground_speed + faster * dt)
        if throttle <= 0.0 and ground_speed <= STANDSTILL:
            ground_speed = 0.0
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

    def take_off(self, climb: float) -> None:
        """Leave the ground now, with the nose up for a climb rate in m/s."""
        self.airborne, self.velocity_down = True, -ROTATION * climb

    def rest_on_ground(self) -> None:
        """Stand on the ground without moving through the air but for the wind."""
        self.airborne = False
        self.down = self.velocity_down = self.roll = self.roll_rate = self.pitch = 0.0

    def _meet_wind(self) -> None:
        """When the wind changes the airspeed does, and the nose turns into the air before it is carried along."""
        north, east = self.wind_north - self._met[0], self.wind_east - self._met[1]
        self._met = self.wind_north, self.wind_east
        ahead, right = math.cos(self.yaw), math.sin(self.yaw)
        self.airspeed -= north * ahead + east * right
        turn = (north * right - east * ahead) / max(self.airspeed, 5.0)
        self.yaw += turn / (1 + self.slip_share)

    def _move(self, climb: float, dt: float) -> None:
        pitch = math.asin(max(-1.0, min(1.0, climb / max(self.airspeed, 1.0))))
        self.pitch_rate, self.pitch = (pitch - self.pitch) / dt, pitch
        level = self.airspeed * math.cos(pitch)
        self.velocity_north = level * math.cos(self.yaw) + self.wind_north
        self.velocity_east = level * math.sin(self.yaw) + self.wind_east
        self.velocity_down = -climb
        self.north += self.velocity_north * dt
        self.east += self.velocity_east * dt
        self.down += self.velocity_down * dt
        if self.down >= 0.0:
            self.rest_on_ground()
