"""LAND, and the descent that RTL and AUTO end with."""

from __future__ import annotations

from ... import shaping
from ..demand import Demand
from .base import Mode


def descend(mode: Mode, dt: float) -> Demand:
    """One control step of a landing where the vehicle is; disarms when it has landed.

    Down at LAND_SPD_HIGH_MS (or WP_SPD_DN) until LAND_ALT_LOW_M above home, slowing to LAND_SPD_MS.
    """
    aircraft = mode.aircraft
    if aircraft.armed and aircraft.landed and aircraft.spooled_down:
        aircraft.disarm_now()
    if aircraft.grounded:
        return mode.wait_on_ground()
    parameters, control = aircraft.parameters, aircraft.position
    slow = abs(parameters["LAND_SPD_MS"])
    fast = max(parameters["LAND_SPD_HIGH_MS"] or control.limits.speed_down, slow)
    control.limits.speed_down = max(control.limits.speed_down, fast)
    above = aircraft.altitude - max(parameters["LAND_ALT_LOW_M"], 1.0)
    speed = slow
    if above > 0:
        planned = shaping.square_root_speed(above, shaping.POSITION_GAIN, control.limits.acceleration_z)
        speed = max(slow, min(fast, planned))
    if aircraft.maybe_landed:
        control.follow_horizontally(aircraft.estimator.position, aircraft.estimator.velocity)
    target = aircraft.precland.target(aircraft.now)
    if target is None or aircraft.maybe_landed:
        control.fly_at(0.0, 0.0, dt)
    else:
        control.go_to(target, dt)
    hover = aircraft.precland.must_hover(aircraft.now, aircraft.altitude)
    control.climb_at(0.0 if hover else speed, dt)
    return mode.fly(dt)


class Land(Mode):
    """Land here, slower near the ground, and disarm on touchdown. Works without a position, too."""

    name = "LAND"
    number = 9
    needs_position = False
    armable = False

    def enter(self, checked: bool) -> bool:
        self.aircraft.position.limits = self.aircraft.default_limits()
        self.aircraft.yaw.hold()
        return True

    def step(self, dt: float) -> Demand:
        return descend(self, dt)

    @property
    def landing(self) -> bool:
        return True
