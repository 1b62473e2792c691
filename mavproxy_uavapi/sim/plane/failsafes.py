"""What the plane does by itself: battery low, ground station lost, fence broken.

A lost position does not end an ArduPlane's mode.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..failsafes import Failsafes
from ..geodesy import Ned
from ..mode import VehicleMode
from .airframe import Airframe
from .modes import Auto, Guided, Loiter, Rtl, Takeoff
from .modes.circling import AvoidAdsb

DO_RTL, DO_LAND, DO_TERMINATE, DO_QLAND, DO_LOITER_QLAND = 1, 2, 3, 4, 6
"""BATT_FS_LOW_ACT; 0 only warns."""
FS_QRTL, FS_RTL = 1 << 5, 1 << 20
"""Bits of Q_OPTIONS."""
HOVERS = (17, 18, 19)
"""QSTABILIZE, QHOVER, QLOITER."""
QLAND, QRTL = KEEPS_ON = 20, 21
"""They go on without a ground station."""
SHORT_IS_OFF, ONLY_IN_AUTO = 3, 3
"""FS_SHORT_ACTN; FS_GCS_ENABL."""
LONG_NONE, LONG_GLIDE, LONG_AUTO = 0, 2, 4
"""FS_LONG_ACTN; its other values return, as there is neither a parachute nor AUTOLAND."""
GLIDES = 5
"""FBWA."""
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
        self._watch_station()
        self._watch_fence()

    def _watch_station(self) -> None:
        """As check_long_failsafe and failsafe_long_on_event of ArduPlane 4.7, for the ground station."""
        vehicle, parameters = self._vehicle, self._vehicle.parameters
        if self._station_is_lost:
            short = "FS_LONG_TIMEOUT" if parameters["FS_SHORT_ACTN"] == SHORT_IS_OFF else "FS_SHORT_TIMEOUT"
            if self.station_silent_for < parameters[short]:
                self._station_is_lost = False
                vehicle.say(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe Off")
            return
        watches = int(parameters["FS_GCS_ENABL"])
        if not watches or (watches == ONLY_IN_AUTO and vehicle.mode is not vehicle.mission_mode):
            return
        climbs = isinstance(vehicle.mode, Takeoff) and vehicle.mode.taking_off
        if self.station_silent_for > parameters["FS_LONG_TIMEOUT"] and not vehicle.mode.landing and not climbs:
            self._station_is_lost = True
            vehicle.set_mode(self._without_station())
            vehicle.say(mavlink.MAV_SEVERITY_WARNING, f"GCS Failsafe On: {vehicle.mode.name}")

    def _without_station(self) -> int:
        """The mode in which it goes on."""
        vehicle, mode = self._vehicle, self._vehicle.mode
        in_auto, mission = mode is vehicle.mission_mode, vehicle.mission
        if mode.number in HOVERS:
            options = int(vehicle.parameters["Q_OPTIONS"])
            return Rtl.number if options & FS_RTL else QRTL if options & FS_QRTL else QLAND
        if mode.number in KEEPS_ON or (in_auto and mission.in_landing_sequence):
            return mode.number
        if in_auto and mission.items[mission.current].command == mavlink.MAV_CMD_NAV_VTOL_TAKEOFF:
            return QLAND
        action = int(vehicle.parameters["FS_LONG_ACTN"])
        if action == LONG_AUTO:
            return Auto.number
        if isinstance(mode, Rtl) or (action == LONG_NONE and isinstance(mode, Auto | AvoidAdsb | Guided)):
            return mode.number
        return GLIDES if action == LONG_GLIDE else Rtl.number

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
