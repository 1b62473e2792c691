"""What the vehicle does by itself when the battery runs low, the position is lost, or the fence is broken."""

from __future__ import annotations

from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..battery import Battery
from ..estimator import Estimator
from ..fence import Fence
from ..parameters import ParameterStore
from .modes import Brake, Land, Mode, Rtl, SmartRtl

POSITION_LOST_AFTER = 1.0
"""Seconds without a position after which ArduCopter's EKF failsafe acts."""
ONLY_WARN = 0
BATTERY_ACTIONS = {
    1: (Land.number,),
    3: (SmartRtl.number, Rtl.number, Land.number),
    4: (SmartRtl.number, Land.number),
    7: (Brake.number, Land.number),
}
"""BATT_FS_LOW_ACT: the modes that are tried one after the other; any other value but ONLY_WARN returns."""
FENCE_ACTIONS = {
    0: (),
    2: (Land.number,),
    3: (SmartRtl.number, Rtl.number, Land.number),
    4: (Brake.number, Land.number),
    5: (SmartRtl.number, Land.number),
}
"""FENCE_ACTION, likewise."""
RETURN = (Rtl.number, Land.number)


class WatchedVehicle(Protocol):
    """What the failsafes need of the vehicle: what they watch, and what they can make it do."""

    now: float
    armed: bool
    landed: bool
    mode: Mode
    battery: Battery
    estimator: Estimator
    parameters: ParameterStore
    fence: Fence

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT of a MAV_SEVERITY."""

    def set_mode(self, number: int) -> bool:
        """Change the flight mode; False with a STATUSTEXT that says why."""

    def disarm_now(self) -> None:
        """Stop the motors, whatever the vehicle is doing."""


class Failsafes:
    """Watches one vehicle; `active` makes its heartbeat say MAV_STATE_CRITICAL."""

    def __init__(self, vehicle: WatchedVehicle) -> None:
        self._vehicle = vehicle
        self._blind_for = 0.0
        self.active = False

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""
        vehicle = self._vehicle
        if vehicle.armed and vehicle.battery.becomes_low(vehicle.now):
            self._battery_low()
        self._blind_for = 0.0 if vehicle.estimator.ready else self._blind_for + dt
        lost = self._blind_for >= POSITION_LOST_AFTER and vehicle.estimator.origin is not None
        if lost and vehicle.armed and not vehicle.landed and vehicle.mode.needs_position:
            self._position_lost()
        broken = vehicle.fence.newly_broken(landing=vehicle.landed or vehicle.mode.landing)
        if broken:
            self._fence_broken(broken)
        if self.active and not vehicle.armed and vehicle.estimator.ready and not vehicle.battery.low:
            self.active = False

    def _position_lost(self) -> None:
        vehicle = self._vehicle
        self.active = True
        vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF Failsafe")
        vehicle.set_mode(Land.number)
        vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, f"EKF Failsafe: changed to {vehicle.mode.name} Mode")

    def _fence_broken(self, kinds: int) -> None:
        vehicle = self._vehicle
        if not vehicle.landed:
            vehicle.say(mavlink.MAV_SEVERITY_NOTICE, vehicle.fence.words(kinds))
        modes = FENCE_ACTIONS.get(int(vehicle.parameters["FENCE_ACTION"]), RETURN)
        if modes and vehicle.landed:
            vehicle.disarm_now()
        elif modes:
            any(vehicle.set_mode(number) for number in ((Land.number,) if vehicle.fence.has_failed else modes))

    def _battery_low(self) -> None:
        vehicle = self._vehicle
        battery = vehicle.battery
        self.active = True
        text = f"Battery 1 is low {battery.voltage:.2f}V used {battery.consumed:.0f} mAh"
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, text)
        action = int(vehicle.parameters["BATT_FS_LOW_ACT"])
        if action == ONLY_WARN:
            return
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Battery Failsafe")
        if vehicle.landed:
            vehicle.disarm_now()
        else:
            any(vehicle.set_mode(number) for number in BATTERY_ACTIONS.get(action, RETURN))
