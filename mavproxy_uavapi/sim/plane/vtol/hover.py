"""Hovering on the lift motors: the position controller with the Q_ parameters, and the landing's descent."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...estimator import Estimator
from ...geodesy import Ned, wrap_pi
from ...parameters import ParameterStore
from ...physics import GRAVITY, Body
from ...position_control import MotionLimits, PositionController
from ...shaping import approach_1d
from ..demand import Demand, Throttle

YAW_P = 1.5
"""1/s."""
FASTEST_YAW = math.radians(40)
"""rad/s."""
BRAKING = 5.0
"""m/s/s with which air and lift motors stop the forward flight."""
SLOW_ABOVE_FINAL = 6.0
"""Metres above Q_LAND_FINAL_ALT within which the descent slows down."""
NO_LIFT = Ned(0.0, 0.0, GRAVITY)


@dataclass(frozen=True)
class HoverDemand(Demand):
    """The demand of a mode that hovers.

    thrust is m/s/s beyond weight, yaw_rate rad/s; idle spools the motors down.
    """

    thrust: Ned = NO_LIFT
    yaw_rate: float = 0.0
    idle: bool = False


WAIT = HoverDemand(throttle=Throttle.SUPPRESSED, idle=True)


class Hover:
    """Moves one QuadPlane as a copter moves."""

    def __init__(self, parameters: ParameterStore, estimator: Estimator, body: Body) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._body = body
        self.control = PositionController()

    def start(self) -> None:
        """Take over the vehicle as it flies."""
        parameters = self._parameters

        def within(name: str, least: float, most: float) -> float:
            return max(least, min(most, parameters[name]))

        self.control.limits = MotionLimits(
            speed=within("Q_WP_SPD", 0.5, 30.0),
            speed_up=within("Q_WP_SPD_UP", 0.1, 20.0),
            speed_down=within("Q_WP_SPD_DN", 0.1, 20.0),
            acceleration=within("Q_WP_ACC", 0.1, 10.0),
            acceleration_z=within("Q_PILOT_ACCEL_Z", 0.1, 10.0),
            lean=math.radians(within("Q_A_ANGLE_MAX", 10.0, 60.0)),
        )
        self.control.start_at(self._estimator.position, self._estimator.velocity)

    def relax(self) -> HoverDemand:
        """Motors at idle, on the ground."""
        self.control.start_at(self._estimator.position, self._estimator.velocity)
        return WAIT

    def brake(self, dt: float) -> None:
        """Bring the desired velocity to a stop, hard while the vehicle is fast."""
        control, speed = self.control, math.hypot(*self.control.velocity[:2])
        slow = control.limits.acceleration
        fast = speed > control.limits.speed
        control.limits.acceleration = BRAKING if fast else slow
        control.fly_at(0.0, 0.0, dt)
        control.limits.acceleration = slow

    def stay(self, dt: float) -> HoverDemand:
        """Brake and hold the position and the height."""
        self.brake(dt)
        self.control.climb_at(0.0, dt)
        return self.demand(dt)

    def climb_to(self, down: float, dt: float) -> HoverDemand:
        """Hold the position and change the height."""
        self.brake(dt)
        limits = self.control.limits
        error = down - self.control.position[2]
        self.control.climb_at(approach_1d(error, limits.speed_down, limits.speed_up, limits.acceleration_z), dt)
        return self.demand(dt)

    def go_to(self, target: Ned, dt: float) -> HoverDemand:
        """Fly to a place and hold there; the nose keeps its heading."""
        self.control.go_to(target, dt)
        return self.demand(dt)

    def descend(self, above_ground: float, dt: float, place: Ned | None = None) -> HoverDemand:
        """Sink towards the ground: fast above, with Q_LAND_FINAL_SPD below Q_LAND_FINAL_ALT."""
        control, parameters = self.control, self._parameters
        final, fast = max(0.1, min(2.0, parameters["Q_LAND_FINAL_SPD"])), control.limits.speed_down
        share = (above_ground - parameters["Q_LAND_FINAL_ALT"]) / SLOW_ABOVE_FINAL
        if place is None:
            self.brake(dt)
        else:
            here = control.position
            control.fly_at(0.5 * (place.north - here[0]), 0.5 * (place.east - here[1]), dt)
        control.climb_at(final + (fast - final) * max(0.0, min(1.0, share)), dt)
        return self.demand(dt)

    def demand(self, dt: float, yaw: float | None = None) -> HoverDemand:
        """The thrust that follows the desired trajectory; yaw (rad) turns the nose there."""
        estimate = self._estimator
        rate = 0.0
        if yaw is not None:
            error = wrap_pi(yaw - self._body.yaw)
            rate = max(-FASTEST_YAW, min(FASTEST_YAW, YAW_P * error))
        return HoverDemand(thrust=self.control.thrust(estimate.position, estimate.velocity, dt), yaw_rate=rate)
