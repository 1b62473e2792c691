"""What the plane does by itself when the battery runs low. A lost position does not end an ArduPlane's mode."""

from __future__ import annotations

from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..battery import Battery
from ..fence import Fence
from ..parameters import ParameterStore
from .modes import Loiter, Mode, Rtl

DO_RTL, DO_LAND, DO_TERMINATE, DO_QLAND, DO_LOITER_QLAND = 1, 2, 3, 4, 6
"""BATT_FS_LOW_ACT; 0 only warns."""
QLAND = 20
GUIDED = 15
FENCE_RTL, FENCE_GUIDED = (1, 8), (6, 7)
"""FENCE_ACTION: those that return, as there is no AUTOLAND, and those that fly to the return point."""


class WatchedPlane(Protocol):
    """What the failsafes see of the plane that they watch, and what they can make it do."""

    now: float
    armed: bool
    battery: Battery
    parameters: ParameterStore
    fence: Fence
    mode: Mode

    @property
    def flying(self) -> bool:
        """Whether it takes it that it flies."""

    def fly_to_return_point(self) -> None:
        """In GUIDED, to the fence's return point or home."""

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
        self._recovers: Mode | None = None

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""
        vehicle = self._vehicle
        if vehicle.armed and vehicle.battery.becomes_low(vehicle.now):
            self._battery_low()
        if self.active and not vehicle.armed and not vehicle.battery.low:
            self.active = False
        self._watch_fence()

    def _watch_fence(self) -> None:
        """While it recovers from one breach in the mode of the fence, another one counts for nothing."""
        vehicle = self._vehicle
        was_broken, landing = vehicle.fence.is_broken, vehicle.mode.landing or not vehicle.flying
        broken = vehicle.fence.newly_broken(landing=landing)
        if self._recovers is not vehicle.mode:
            self._recovers = None
        if broken and self._recovers is None:
            vehicle.say(mavlink.MAV_SEVERITY_NOTICE, vehicle.fence.words(broken))
            action = int(vehicle.parameters["FENCE_ACTION"])
            if action in FENCE_RTL and not (vehicle.mode.number == AUTO and vehicle.mode.landing):
                vehicle.set_mode(Rtl.number)
                self._recovers = vehicle.mode
            elif action in FENCE_GUIDED and vehicle.set_mode(GUIDED):
                vehicle.fly_to_return_point()
                self._recovers = vehicle.mode
        elif was_broken and not vehicle.fence.is_broken:
            vehicle.say(mavlink.MAV_SEVERITY_NOTICE, "Fence breach cleared")

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
