"""What the plane does by itself when the battery runs low. A lost position does not end an ArduPlane's mode."""

from __future__ import annotations

from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..battery import Battery
from ..parameters import ParameterStore
from .modes import Loiter, Rtl

DO_RTL, DO_LAND, DO_TERMINATE, DO_QLAND, DO_LOITER_QLAND = 1, 2, 3, 4, 6
"""BATT_FS_LOW_ACT; 0 only warns."""
QLAND = 20


class WatchedPlane(Protocol):
    """What the failsafes see of the plane that they watch, and what they can make it do."""

    now: float
    armed: bool
    battery: Battery
    parameters: ParameterStore

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT of a MAV_SEVERITY."""

    def set_mode(self, number: int) -> bool:
        """Change the mode; False with a STATUSTEXT that says why."""

    def select_landing(self) -> bool:
        """Make the mission's landing the current item."""

    def disarm_now(self) -> None:
        """Stop the motors, whatever the vehicle is doing."""


class Failsafes:
    """Watches one plane; `active` makes its heartbeat say MAV_STATE_CRITICAL."""

    def __init__(self, vehicle: WatchedPlane) -> None:
        self._vehicle = vehicle
        self.active = False

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""
        del dt
        vehicle = self._vehicle
        if vehicle.armed and vehicle.battery.becomes_low(vehicle.now):
            self._battery_low()
        if self.active and not vehicle.armed and not vehicle.battery.low:
            self.active = False

    def _battery_low(self) -> None:
        vehicle = self._vehicle
        battery = vehicle.battery
        text = f"Battery 1 is low {battery.voltage:.2f}V used {battery.consumed:.0f} mAh"
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, text)
        self.active = True
        action = int(vehicle.parameters["BATT_FS_LOW_ACT"])
        if action == DO_TERMINATE:
            vehicle.disarm_now()
        elif action in (DO_QLAND, DO_LOITER_QLAND) and vehicle.set_mode(QLAND):
            return
        elif action == DO_LAND and vehicle.select_landing():
            vehicle.set_mode(AUTO)
        elif action in (DO_RTL, DO_LAND, DO_QLAND):
            vehicle.set_mode(Rtl.number)
        elif action == DO_LOITER_QLAND:
            vehicle.set_mode(Loiter.number)


AUTO = 10
