"""What the rover does by itself when the battery runs low or the position is lost on the way."""

from __future__ import annotations

from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..battery import Battery
from ..estimator import Estimator
from ..fence import Fence
from ..parameters import ParameterStore
from .modes import Hold, Loiter, Mode, Rtl, SmartRtl

POSITION_LOST_AFTER = 1.0
"""Seconds without a position after which Rover's EKF failsafe acts."""
BATTERY_ACTIONS = {
    1: (Rtl.number, Hold.number),
    2: (Hold.number,),
    3: (SmartRtl.number, Rtl.number, Hold.number),
    4: (SmartRtl.number, Hold.number),
    6: (Loiter.number, Hold.number),
}
"""BATT_FS_LOW_ACT: the modes to try in turn. 0 only warns."""
TERMINATE = 5
FENCE_ACTIONS = BATTERY_ACTIONS
"""FENCE_ACTION has the same numbers."""


class WatchedRover(Protocol):
    """What the failsafes see of the rover that they watch, and what they can make it do."""

    now: float
    armed: bool
    mode: Mode
    battery: Battery
    estimator: Estimator
    parameters: ParameterStore
    fence: Fence

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT of a MAV_SEVERITY."""

    def set_mode(self, number: int) -> bool:
        """Change the mode; False with a STATUSTEXT that says why."""

    def disarm_now(self) -> None:
        """Stop the motors, whatever the vehicle is doing."""


class Failsafes:
    """Watches one rover; `active` makes its heartbeat say MAV_STATE_CRITICAL."""

    def __init__(self, vehicle: WatchedRover) -> None:
        self._vehicle = vehicle
        self._blind_for = 0.0
        self.active = False
        """Whether the position is lost; the heartbeat does not report a low battery."""

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""
        vehicle = self._vehicle
        if vehicle.armed and vehicle.battery.becomes_low(vehicle.now):
            self._battery_low()
        blind = vehicle.armed and not vehicle.estimator.ready and vehicle.estimator.origin is not None
        self._blind_for = self._blind_for + dt if blind else 0.0
        if self._blind_for >= POSITION_LOST_AFTER and not self.active:
            self._position_lost()
        elif self.active and not blind:
            self.active = False
            vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF failsafe cleared")
        if vehicle.fence.newly_broken(landing=False):
            self._fence_broken()

    def _fence_broken(self) -> None:
        """Without a text, as in Rover's fence.cpp."""
        vehicle, action = self._vehicle, int(self._vehicle.parameters["FENCE_ACTION"])
        if action and vehicle.fence.has_failed:
            vehicle.set_mode(Hold.number)
        elif action == TERMINATE:
            vehicle.disarm_now()
        else:
            any(vehicle.set_mode(number) for number in FENCE_ACTIONS.get(action, ()))

    def _position_lost(self) -> None:
        vehicle = self._vehicle
        self.active = True
        vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF variance")
        if vehicle.mode.needs_position:
            vehicle.set_mode(Hold.number)
            vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF failsafe")

    def _battery_low(self) -> None:
        vehicle = self._vehicle
        battery = vehicle.battery
        text = f"Battery 1 is low {battery.voltage:.2f}V used {battery.consumed:.0f} mAh"
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, text)
        action = int(vehicle.parameters["BATT_FS_LOW_ACT"])
        if action == TERMINATE:
            vehicle.disarm_now()
        any(vehicle.set_mode(number) for number in BATTERY_ACTIONS.get(action, ()))
