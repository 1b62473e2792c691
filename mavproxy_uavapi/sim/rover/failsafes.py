"""What the rover does by itself: battery low, position or ground station lost on the way, fence broken."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..failsafes import POSITION_LOST_AFTER, Failsafes
from .chassis import Chassis
from .modes import Hold, Loiter, Rtl, SmartRtl

ACTIONS = {
    1: (Rtl.number, Hold.number),
    2: (Hold.number,),
    3: (SmartRtl.number, Rtl.number, Hold.number),
    4: (SmartRtl.number, Hold.number),
    6: (Loiter.number, Hold.number),
}
"""BATT_FS_LOW_ACT, FENCE_ACTION and FS_ACTION: the modes to try in turn. 0 only warns."""
TERMINATE = 5
ACTIVE_IN_HOLD = 1
"""The bit of FS_OPTIONS."""


class RoverFailsafes(Failsafes[Chassis]):
    """Watches one rover; active while its position is lost: the heartbeat does not report a low battery."""

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
        self._watch_station()
        if vehicle.fence.newly_broken(landing=False):
            self._fence_broken()

    def _watch_station(self) -> None:
        """As gcs_failsafe_check and failsafe_trigger of Rover 4.7; while it returns or holds, it does not act yet.

        The radio's check, which comes more often, finds what the ground station's began: the text names the radio,
        and AUTO is left with FS_GCS_ENABLE 2, too.
        """
        vehicle, parameters = self._vehicle, self._vehicle.parameters
        late_by = self.station_silent_for - parameters["FS_GCS_TIMEOUT"]
        if not parameters["FS_GCS_ENABLE"]:
            return
        if late_by < 0 and self._station_is_lost:
            self._station_is_lost = False
            vehicle.say(mavlink.MAV_SEVERITY_INFO, "GCS Failsafe Cleared")
        holds = isinstance(vehicle.mode, Hold) and not int(parameters["FS_OPTIONS"]) & ACTIVE_IN_HOLD
        if late_by <= parameters["FS_TIMEOUT"] or self._station_is_lost or holds or isinstance(vehicle.mode, Rtl):
            return
        self._station_is_lost = True
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Radio Failsafe")
        if parameters["FS_ACTION"] == TERMINATE:
            vehicle.disarm_now()
        else:
            self.enter_one_of(ACTIONS.get(int(parameters["FS_ACTION"]), ()))

    def _fence_broken(self) -> None:
        """Without a text, as in Rover's fence.cpp."""
        vehicle, action = self._vehicle, int(self._vehicle.parameters["FENCE_ACTION"])
        if action and vehicle.fence.has_failed:
            vehicle.set_mode(Hold.number)
        elif action == TERMINATE:
            vehicle.disarm_now()
        else:
            self.enter_one_of(ACTIONS.get(action, ()))

    def _position_lost(self) -> None:
        vehicle = self._vehicle
        self.active = True
        vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF variance")
        if vehicle.mode.needs_position:
            vehicle.set_mode(Hold.number)
            vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "EKF failsafe")

    def _battery_low(self) -> None:
        action = self.say_battery_low()
        if action == TERMINATE:
            self._vehicle.disarm_now()
        self.enter_one_of(ACTIONS.get(action, ()))
