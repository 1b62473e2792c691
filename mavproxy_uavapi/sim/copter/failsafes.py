"""What the vehicle does by itself: battery low, position, radio or ground station lost, fence broken."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..failsafes import POSITION_LOST_AFTER, Failsafes
from .aircraft import Aircraft
from .modes import Brake, Land, Rtl, SmartRtl
from .modes.auto import AUTO_RTL
from .modes.manual import PilotMode

ONLY_WARN, TERMINATE = 0, 5
GUIDED = 4
BATTERY_ACTIONS = {
    1: (Land.number,),
    3: (SmartRtl.number, Rtl.number, Land.number),
    4: (SmartRtl.number, Land.number),
    6: (AUTO_RTL, Rtl.number, Land.number),
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
STATION_ACTIONS = {
    3: (SmartRtl.number, Rtl.number, Land.number),
    4: (SmartRtl.number, Land.number),
    5: (Land.number,),
    6: (AUTO_RTL, Rtl.number, Land.number),
    7: (Brake.number, Land.number),
}
"""FS_GCS_ENABLE, likewise; 0 is off."""
RADIO_ACTIONS = {
    1: (Rtl.number, Land.number),
    2: (Rtl.number, Land.number),
    4: STATION_ACTIONS[3],
    5: STATION_ACTIONS[4],
    6: STATION_ACTIONS[6],
    7: STATION_ACTIONS[7],
}
"""FS_THR_ENABLE, likewise; 0 is off, any other value lands."""
RETURN = (Rtl.number, Land.number)
WITHOUT_RADIO_IN_AUTO, WITHOUT_RADIO_IN_GUIDED = 1 << 0, 1 << 2
CONTINUES_IN_AUTO, CONTINUES_LANDING, CONTINUES_WITH_PILOT = 1 << 1, 1 << 3, 1 << 4
"""Bits of FS_OPTIONS."""


class CopterFailsafes(Failsafes[Aircraft]):
    """Watches one copter."""

    _radio_is_lost = False

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""
        vehicle = self._vehicle
        if vehicle.armed and vehicle.battery.becomes_low(vehicle.now):
            self._battery_low()
        self._blind_for = 0.0 if vehicle.estimator.ready else self._blind_for + dt
        lost = self._blind_for >= POSITION_LOST_AFTER and vehicle.estimator.origin is not None
        if lost and vehicle.armed and not vehicle.landed and vehicle.mode.needs_position:
            self._position_lost()
        self._watch_radio()
        self._watch_station()
        broken = vehicle.fence.newly_broken(landing=vehicle.landed or vehicle.mode.landing)
        if broken:
            self._fence_broken(broken)
        if self.active and not vehicle.armed and vehicle.estimator.ready and not vehicle.battery.low:
            self.active = False

    def _watch_radio(self) -> None:
        """As failsafe_radio_on_event of ArduCopter's events.cpp."""
        vehicle = self._vehicle
        action, was_lost = int(vehicle.parameters["FS_THR_ENABLE"]), self._radio_is_lost
        self._radio_is_lost = bool(action) and vehicle.now < vehicle.radio_lost_until
        if was_lost and not self._radio_is_lost:
            vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Radio Failsafe Cleared")
        if not self._radio_is_lost or was_lost:
            return
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Radio Failsafe")
        if vehicle.armed and vehicle.landed:
            vehicle.disarm_now()
        elif vehicle.armed and not self._continues_without_radio():
            self.active = True
            self.enter_one_of(RADIO_ACTIONS.get(action, (Land.number,)))

    def _continues_without_radio(self) -> bool:
        """Whether FS_OPTIONS has it go on without the pilot's radio."""
        options, mode = int(self._vehicle.parameters["FS_OPTIONS"]), self._vehicle.mode
        return bool(
            (mode.landing and options & CONTINUES_LANDING)
            or (mode is self._vehicle.mission_mode and options & WITHOUT_RADIO_IN_AUTO)
            or (mode.number == GUIDED and options & WITHOUT_RADIO_IN_GUIDED)
        )

    def _watch_station(self) -> None:
        """As failsafe_gcs_check and failsafe_gcs_on_event of ArduCopter's events.cpp."""
        vehicle = self._vehicle
        action = int(vehicle.parameters["FS_GCS_ENABLE"])
        if not action:
            return
        was_lost = self._station_is_lost
        self._station_is_lost = self.station_silent_for > vehicle.parameters["FS_GCS_TIMEOUT"]
        if was_lost and not self._station_is_lost:
            vehicle.say(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe Cleared")
        if not self._station_is_lost or was_lost:
            return
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe")
        if vehicle.armed and vehicle.landed:
            vehicle.disarm_now()
        elif vehicle.armed and not self._continues():
            self.active = True
            self.enter_one_of(STATION_ACTIONS.get(action, RETURN))

    def _continues(self) -> bool:
        """Whether FS_OPTIONS has it go on without a ground station."""
        options, mode = int(self._vehicle.parameters["FS_OPTIONS"]), self._vehicle.mode
        return bool(
            (mode.landing and options & CONTINUES_LANDING)
            or (mode is self._vehicle.mission_mode and options & CONTINUES_IN_AUTO)
            or (isinstance(mode, PilotMode | Brake) and options & CONTINUES_WITH_PILOT)
        )

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
            self.enter_one_of((Land.number,) if vehicle.fence.has_failed else modes)

    def _battery_low(self) -> None:
        vehicle, action = self._vehicle, self.say_battery_low()
        self.active = True
        if action == ONLY_WARN:
            return
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Battery Failsafe")
        if vehicle.landed or action == TERMINATE:
            vehicle.disarm_now()
        else:
            self.enter_one_of(BATTERY_ACTIONS.get(action, RETURN))
