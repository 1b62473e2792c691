"""What the failsafes of all types have in common."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .vehicle import EmbeddedVehicle

POSITION_LOST_AFTER = 1.0
"""Seconds without a position after which an EKF failsafe acts."""
V = TypeVar("V", bound=EmbeddedVehicle)


class Failsafes(Generic[V]):
    """Watches one vehicle; `active` makes its heartbeat say MAV_STATE_CRITICAL."""

    def __init__(self, vehicle: V) -> None:
        self._vehicle = vehicle
        self._blind_for = 0.0
        self._station_is_lost = False
        self.active = False

    @property
    def station_silent_for(self) -> float:
        """Seconds since the ground station of MAV_GCS_SYSID was heard; 0 before the first time: nobody misses it."""
        heard_at = self._vehicle.station_heard_at
        return 0.0 if heard_at is None else self._vehicle.now - heard_at

    def say_battery_low(self) -> int:
        """Report a low battery; returns BATT_FS_LOW_ACT."""
        battery = self._vehicle.battery
        text = f"Battery 1 is low {battery.voltage:.2f}V used {battery.consumed:.0f} mAh"
        self._vehicle.say(mavlink.MAV_SEVERITY_WARNING, text)
        return int(self._vehicle.parameters["BATT_FS_LOW_ACT"])

    def enter_one_of(self, modes: Iterable[int]) -> None:
        """Enter the first of these modes that the vehicle does not refuse."""
        any(self._vehicle.set_mode(number) for number in modes)
