"""What the plane does by itself when the battery runs low. A lost position does not end an ArduPlane's mode."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..failsafes import Failsafes
from ..geodesy import Ned
from ..mode import VehicleMode
from .airframe import Airframe
from .modes import Auto, Guided, Loiter, Rtl

DO_RTL, DO_LAND, DO_TERMINATE, DO_QLAND, DO_LOITER_QLAND = 1, 2, 3, 4, 6
"""BATT_FS_LOW_ACT; 0 only warns."""
QLAND = 20
FENCE_RTL, FENCE_GUIDED = (1, 8), (6, 7)
"""FENCE_ACTION: those that return, as there is no AUTOLAND, and those that fly to the return point."""


class PlaneFailsafes(Failsafes[Airframe]):
    """Watches one plane."""

    _recovers: VehicleMode | None = None
    """The mode in which it recovers from a breach of the fence."""

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
            if action in FENCE_RTL and not (vehicle.mode.number == Auto.number and vehicle.mode.landing):
                vehicle.set_mode(Rtl.number)
                self._recovers = vehicle.mode
            elif action in FENCE_GUIDED and vehicle.set_mode(Guided.number):
                assert isinstance(vehicle.mode, Guided)
                vehicle.mode.go_to(self._return_point())
                self._recovers = vehicle.mode
        elif was_broken and not vehicle.fence.is_broken:
            vehicle.say(mavlink.MAV_SEVERITY_NOTICE, "Fence breach cleared")

    def _return_point(self) -> Ned:
        """The fence's return point or home, at FENCE_RET_ALT or half way between its heights."""
        fence, parameters, home = self._vehicle.fence, self._vehicle.parameters, self._vehicle.home_offset
        height = parameters["FENCE_RET_ALT"]
        if height <= 0:
            middle = (fence.lowest + fence.highest) / 2
            height = middle if fence.lowest < fence.highest else parameters["RTL_ALTITUDE"]
        return Ned(*(fence.return_point or home[:2]), home.down - height)

    def _battery_low(self) -> None:
        vehicle, action = self._vehicle, self.say_battery_low()
        self.active = True
        if action == DO_TERMINATE:
            vehicle.disarm_now()
        elif action in (DO_QLAND, DO_LOITER_QLAND) and vehicle.set_mode(QLAND):
            return
        elif action == DO_LAND and vehicle.select_landing():
            vehicle.set_mode(Auto.number)
        elif action in (DO_RTL, DO_LAND, DO_QLAND):
            vehicle.set_mode(Rtl.number)
        elif action == DO_LOITER_QLAND:
            vehicle.set_mode(Loiter.number)
