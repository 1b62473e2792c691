"""What the vehicle does by itself when the battery runs low or the position is lost in flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

if TYPE_CHECKING:
    from .copter import Copter

POSITION_LOST_AFTER = 1.0
"""Seconds without a position after which ArduCopter's EKF failsafe acts."""
RTL, LAND = 6, 9
ONLY_WARN, DO_LAND = 0, 1
"""BATT_FS_LOW_ACT; higher numbers return. SmartRTL is not flown here, so it counts as RTL."""


class Failsafes:
    """Watches one copter; `active` makes its heartbeat say MAV_STATE_CRITICAL."""

    def __init__(self, copter: Copter) -> None:
        self._copter = copter
        self._blind_for = 0.0
        self.active = False

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""
        copter = self._copter
        if copter.armed and copter.battery.becomes_low(copter.now):
            self._battery_low()
        self._blind_for = 0.0 if copter.estimator.ready else self._blind_for + dt
        lost = self._blind_for >= POSITION_LOST_AFTER and copter.estimator.origin is not None
        if lost and copter.armed and not copter.landed and copter.mode.needs_position:
            self._position_lost()
        if self.active and not copter.armed and copter.estimator.ready and not copter.battery.low:
            self.active = False

    def _position_lost(self) -> None:
        copter = self._copter
        self.active = True
        copter.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF Failsafe")
        copter.set_mode(LAND)
        copter.say(mavlink.MAV_SEVERITY_CRITICAL, f"EKF Failsafe: changed to {copter.mode.name} Mode")

    def _battery_low(self) -> None:
        copter = self._copter
        battery = copter.battery
        self.active = True
        text = f"Battery 1 is low {battery.voltage:.2f}V used {battery.consumed:.0f} mAh"
        copter.say(mavlink.MAV_SEVERITY_WARNING, text)
        action = int(copter.parameters["BATT_FS_LOW_ACT"])
        if action == ONLY_WARN:
            return
        copter.say(mavlink.MAV_SEVERITY_WARNING, "Battery Failsafe")
        if copter.landed:
            copter.disarm_landed()
        elif action == DO_LAND or not copter.set_mode(RTL):
            copter.set_mode(LAND)
