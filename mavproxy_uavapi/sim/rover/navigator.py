"""The way to a point: speed and turn rate, by WP_SPEED, WP_RADIUS, WP_ACCEL, WP_JERK and the ATC parameters."""

from __future__ import annotations

import math

from .. import shaping
from ..estimator import Estimator
from ..geodesy import Ned, wrap_pi
from ..parameters import ParameterStore
from ..physics import GRAVITY
from .body import CarBody, Grip
from .drive import STOP, Drive

FASTEST = 30.0
"""m/s; more is not believed."""
SLOWEST = 0.05
"""m/s; ArduPilot refuses a lower speed."""
HEADING_P = 2.0
"""ATC_STR_ANG_P."""
APPROACH = 0.5
"""1/s; the speed close by, per metre that is left."""
BRAKING_SHARE = 0.7
"""Of the acceleration limit; the rest makes up for the lag of jerk-limited braking."""
ARRIVED = 0.25
"""Metres left at which a stop at the point is complete."""
CORNER_SHARE = 0.35
"""Of WP_RADIUS; how tight the arc is that rounds a corner."""
SLOWEST_TURN = 0.3
"""Share of the speed that is left while the point lies behind."""


def grip(parameters: ParameterStore) -> Grip:
    """What the vehicle can do by its parameters."""

    def positive(name: str, most: float, otherwise: float) -> float:
        value = parameters[name]
        return min(value, most) if value > 0 else otherwise

    acceleration = positive("ATC_ACCEL_MAX", 20.0, 5.0)
    return Grip(
        acceleration,
        positive("ATC_DECEL_MAX", 20.0, acceleration),
        positive("ATC_TURN_MAX_G", 10.0, 0.1) * GRAVITY,
        max(positive("TURN_RADIUS", 1000.0, 0.1), 0.1),
        math.radians(positive("ATC_STR_RAT_MAX", 1000.0, 180.0)),
        math.radians(positive("ATC_STR_ACC_MAX", 1000.0, 180.0)),
    )


class Navigator:
    """Drives to one point after the other; positions are NED metres from the EKF origin."""

    def __init__(self, parameters: ParameterStore, estimator: Estimator, body: CarBody) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._body = body
        self.target: Ned | None = None
        self.reached = False
        self.reversed = False
        self.speed_limit = 0.0
        self._origin = Ned(0.0, 0.0, 0.0)
        self._following: Ned | None = None
        self._acceleration = 0.0

    def start(self, speed: float = 0.0) -> None:
        """Forget the target; speed is the limit in m/s, WP_SPEED with 0."""
        self.speed_limit = min(speed if speed > 0 else self._parameters["WP_SPEED"], FASTEST)
        self.target, self.reached, self.reversed, self._following = None, False, False, None
        self._acceleration = 0.0

    def limit_speed(self, speed: float) -> bool:
        """Change the limit in m/s; False for one that is too low."""
        if not speed >= SLOWEST:
            return False
        self.speed_limit = min(speed, FASTEST)
        return True

    def go_to(self, target: Ned, following: Ned | None = None) -> None:
        """Drive to target and stop there, or pass it on the way to the following one."""
        here = self._estimator.position
        self._origin = self.target if self.target is not None and self.reached else here
        self.target, self._following, self.reached = target, following, False

    @property
    def distance(self) -> float:
        """Metres to the target; 0 without one."""
        if self.target is None:
            return 0.0
        return math.dist(self.target[:2], self._estimator.position[:2])

    @property
    def bearing(self) -> float:
        """Degrees to the target, -180 to 180; 0 without one."""
        if self.target is None:
            return 0.0
        here = self._estimator.position
        return math.degrees(math.atan2(self.target.east - here.east, self.target.north - here.north))

    @property
    def crosstrack(self) -> float:
        """Metres right of the line to the target."""
        if self.target is None:
            return 0.0
        along_n, along_e = self.target.north - self._origin.north, self.target.east - self._origin.east
        length = math.hypot(along_n, along_e)
        here = self._estimator.position
        off_n, off_e = here.north - self._origin.north, here.east - self._origin.east
        return (along_n * off_e - along_e * off_n) / length if length > 0.1 else math.hypot(off_n, off_e)

    def step(self, dt: float) -> Drive:
        """One control step towards the target; notices the arrival."""
        if self.target is None:
            return STOP
        distance = self.distance
        self._notice_arrival(distance)
        if self.reached and self._following is None:
            return STOP
        error = self._heading_error()
        speed = self._speed(distance, error, dt)
        return Drive(-speed if self.reversed else speed, HEADING_P * error)

    def _heading_error(self) -> float:
        nose = self._body.yaw + (math.pi if self.reversed else 0.0)
        return wrap_pi(math.radians(self.bearing) - nose)

    def _speed(self, distance: float, error: float, dt: float) -> float:
        limit = grip(self._parameters)
        jerk = self._parameters["WP_JERK"] if 0 < self._parameters["WP_JERK"] < 100 else limit.acceleration
        now = abs(self._body.speed)
        rest = self._corner_speed() if self._following is not None else 0.0
        braking = shaping.square_root_speed(distance, APPROACH, BRAKING_SHARE * limit.acceleration)
        desired = min(self.speed_limit, math.hypot(braking, rest))
        desired *= max(SLOWEST_TURN, math.cos(min(abs(error), math.pi / 2)))
        self._acceleration = shaping.accelerate_1d(desired - now, self._acceleration, limit.acceleration, jerk, dt)
        return max(0.0, now + self._acceleration * dt)

    def _corner_speed(self) -> float:
        """The speed at which the corner at the target can be driven within WP_RADIUS."""
        assert self.target is not None and self._following is not None
        target, origin, following = self.target, self._origin, self._following
        before = math.atan2(target.east - origin.east, target.north - origin.north)
        after = math.atan2(following.east - target.east, following.north - target.north)
        corner = abs(wrap_pi(after - before))
        if corner < 0.01:
            return self.speed_limit
        radius = CORNER_SHARE * self._parameters["WP_RADIUS"] / math.tan(min(corner, 3.0) / 2)
        return min(self.speed_limit, math.sqrt(grip(self._parameters).acceleration * max(radius, 0.1)))

    def _notice_arrival(self, distance: float) -> None:
        assert self.target is not None
        along_n, along_e = self.target.north - self._origin.north, self.target.east - self._origin.east
        here = self._estimator.position
        ahead = along_n * (self.target.north - here.north) + along_e * (self.target.east - here.east)
        near = distance <= self._parameters["WP_RADIUS"]
        if self._following is not None:
            self.reached = near and (distance <= CORNER_SHARE * self._parameters["WP_RADIUS"] or ahead <= 0)
        elif near and (distance <= ARRIVED or ahead <= 0):
            self.reached = True
