"""What the vehicle does by itself when the battery runs low, the position is lost, or the fence is broken."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..failsafes import POSITION_LOST_AFTER, Failsafes
from .aircraft import Aircraft
from .modes import Brake, Land, Rtl, SmartRtl

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


class CopterFailsafes(Failsafes[Aircraft]):
    """Watches one copter."""

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
            self.enter_one_of((Land.number,) if vehicle.fence.has_failed else modes)

    def _battery_low(self) -> None:
        vehicle, action = self._vehicle, self.say_battery_low()
        self.active = True
        if action == ONLY_WARN:
            return
        vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Battery Failsafe")
        if vehicle.landed:
            vehicle.disarm_now()
        else:
            self.enter_one_of(BATTERY_ACTIONS.get(action, RETURN))
