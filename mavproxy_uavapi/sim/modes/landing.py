"""LAND, and the descent that RTL and AUTO end with."""

from __future__ import annotations

from .. import shaping
from .base import Demand, Mode


def descend(mode: Mode, dt: float) -> Demand:
    """One control step of a landing where the vehicle is; disarms when it has landed.

    Down at LAND_SPEED_HIGH (or WPNAV_SPEED_DN) until LAND_ALT_LOW above home, slowing to LAND_SPEED.
    """
    copter = mode.copter
    if copter.armed and copter.landed and copter.spooled_down:
        copter.disarm_landed()
    if copter.grounded:
        return mode.wait_on_ground()
    parameters, control = copter.parameters, copter.position
    slow = abs(parameters["LAND_SPEED"]) / 100
    fast = max(parameters["LAND_SPEED_HIGH"] / 100 or control.limits.speed_down, slow)
    control.limits.speed_down = max(control.limits.speed_down, fast)
    above = copter.altitude - max(parameters["LAND_ALT_LOW"], 100) / 100
    speed = slow
    if above > 0:
        planned = shaping.square_root_speed(above, shaping.POSITION_GAIN, control.limits.acceleration_z)
        speed = max(slow, min(fast, planned))
    if copter.maybe_landed:
        control.follow_horizontally(copter.estimator.position, copter.estimator.velocity)
    target = copter.precland.target
    if target is None or copter.maybe_landed:
        control.fly_at(0.0, 0.0, dt)
    else:
        control.go_to(target, dt)
    control.climb_at(0.0 if copter.precland.must_hover else speed, dt)
    return mode.fly(dt)


class Land(Mode):
    """Land here, slower near the ground, and disarm on touchdown. Works without a position, too."""

    name = "LAND"
    number = 9
    needs_position = False
    armable = False

    def enter(self, checked: bool) -> bool:
        del checked
        self.copter.position.limits = self.copter.default_limits()
        self.copter.yaw.hold()
        return True

    def step(self, dt: float) -> Demand:
        return descend(self, dt)

    @property
    def landing(self) -> bool:
        return True
