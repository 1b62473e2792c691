"""What all flight modes of a copter have in common."""

from __future__ import annotations

from typing import ClassVar

from ... import mode
from ...position_control import Speed
from ...shaping import VELOCITY_GAIN
from ..aircraft import Aircraft
from ..demand import IDLE, Demand


class Mode(mode.VehicleMode):
    """A flight mode; `step` is called at the control rate while it is the current one."""

    manual_throttle: ClassVar[bool] = False
    navigates = True

    def __init__(self, aircraft: Aircraft) -> None:
        self.aircraft = aircraft

    def step(self, dt: float) -> Demand:
        """One control step of dt seconds."""
        raise NotImplementedError

    def take_off(self, altitude: float) -> bool:
        """MAV_CMD_NAV_TAKEOFF to altitude metres above home; False where the mode cannot."""
        return False

    def set_speed(self, kind: Speed, speed: float) -> bool:
        """MAV_CMD_DO_CHANGE_SPEED in m/s; False where the mode has no speed of its own."""
        return False

    def pause(self) -> bool:
        """Stop and wait; False where there is nothing to pause."""
        return False

    def resume(self) -> bool:
        """Go on after a pause; False where there is nothing to resume."""
        return False

    def hold_still(self, dt: float, gain: float = VELOCITY_GAIN) -> Demand:
        """Brake to a stop and stay there, without turning; gain (1/s) of the velocity."""
        control, estimate = self.aircraft.position, self.aircraft.estimator
        control.fly_at(0.0, 0.0, dt, gain)
        control.climb_at(0.0, dt)
        return Demand(control.thrust(estimate.position, estimate.velocity, dt))

    def fly(self, dt: float) -> Demand:
        """Follow the position controller's trajectory and the automatic yaw."""
        aircraft = self.aircraft
        control, estimate = aircraft.position, aircraft.estimator
        course = (control.velocity[0], control.velocity[1])
        rate = aircraft.yaw.rate(
            aircraft.body.yaw, course, control.limits.speed, (estimate.position.north, estimate.position.east), dt
        )
        return Demand(control.thrust(estimate.position, estimate.velocity, dt), rate)

    def wait_on_ground(self) -> Demand:
        """Motors at ground idle, targets where the vehicle stands."""
        self.aircraft.relax()
        return IDLE
