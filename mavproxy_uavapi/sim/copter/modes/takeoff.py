"""The automatic takeoff that GUIDED and AUTO share."""

from __future__ import annotations

from ..aircraft import Aircraft
from ..demand import IDLE, SPOOLING, Demand
from .base import Mode

DONE_SPEED_SHARE = 0.1
"""A takeoff is complete below this share of the climb speed limit, as in ArduCopter."""


class TakeoffClimb:
    """Spools up, raises the throttle until the vehicle lifts, climbs straight up to the altitude."""

    def __init__(self, aircraft: Aircraft) -> None:
        self.aircraft = aircraft
        self.target_down = 0.0
        self.complete = False
        self._throttle = 0.0

    def start(self, target_down: float) -> None:
        """Climb to target_down metres NED from the EKF origin."""
        self.target_down = target_down
        self.complete = False
        self._throttle = 0.0
        self.aircraft.yaw.hold()

    def step(self, mode: Mode, dt: float) -> Demand:
        """One control step on behalf of mode."""
        aircraft = self.aircraft
        if not aircraft.armed or not aircraft.auto_armed:
            mode.wait_on_ground()
            return IDLE
        if aircraft.landed:
            aircraft.relax()
            if not aircraft.spooled_up:
                self._throttle = 0.0
                return SPOOLING
            self._throttle += dt / max(aircraft.parameters["TKOFF_SLEW_TIME"], 0.1)
            if self._throttle < aircraft.hover_throttle:
                return SPOOLING
            aircraft.lift_off()
        control = aircraft.position
        control.fly_at(0.0, 0.0, dt)
        control.go_to_altitude(self.target_down, dt)
        self.complete = self._arrived()
        return mode.fly(dt)

    def _arrived(self) -> bool:
        control = self.aircraft.position
        slow = DONE_SPEED_SHARE * control.limits.speed_up
        margin = 0.5 * slow * slow / control.limits.acceleration_z
        return control.position[2] <= self.target_down + margin and -control.velocity[2] < slow
