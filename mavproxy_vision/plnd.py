"""ArduPilot's own precision landing: its parameters, lent and given back, and LANDING_TARGET."""

from __future__ import annotations

import math
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.errors import NotSupported, Rejected, TimedOut
from mavproxy_uavapi.vehicle.messages import set_parameter
from mavproxy_uavapi.vehicle.vehicle import Vehicle
from mavproxy_vision.geometry import Attitude, Vector

mavlink = mavutil.mavlink

READ_BACK = 2.0  # s
TRIES = 3
AT_BOOT = "PLND_TYPE"
ENABLE = "PLND_ENABLED"
DOWNWARDS = 25.0  # MAV_SENSOR_ROTATION_PITCH_270
# We take it back to GUIDED and search when the target is lost: no retries of its own. Should nobody be there to take
# it back, strict 1 holds for a while, then lands; 2 would hover until the battery is empty.
# With ALT_MIN and ALT_MAX other than 0 and no rangefinder ArduPilot just descends when the target is lost.
# Alignment, orientation and offset of the sensor are in what we tell: it is the vehicle's frame already.
WANTED = {
    AT_BOOT: 1.0,
    "PLND_STRICT": 1.0,
    "PLND_RET_MAX": 0.0,
    "PLND_ALT_MIN": 0.0,
    "PLND_ALT_MAX": 0.0,
    "PLND_YAW_ALIGN": 0.0,
    "PLND_ORIENT": DOWNWARDS,
    "PLND_CAM_POS_X": 0.0,
    "PLND_CAM_POS_Y": 0.0,
    "PLND_CAM_POS_Z": 0.0,
    ENABLE: 1.0,
}


class PrecisionLanding:
    """PLND on one vehicle: what it was set to before our landings, until it is that again.

    Attributes:
        vehicle: whose it is.
        before: the values that are not given back yet, by name.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.before: dict[str, float] = {}

    async def set_up(self) -> None:
        """Set the parameters and read them back.

        Raises:
            NotSupported: the autopilot has no precision landing.
            Rejected: a parameter did not take its value, or the type was another one at boot.
        """
        if not mavutil.mavlink20():
            raise NotSupported("LANDING_TARGET has a position in MAVLink 2 only: start MAVProxy without --mav10")
        told = await self.vehicle.parameters(WANTED)
        if ENABLE not in told:
            raise NotSupported("the autopilot has no precision landing (no PLND_ENABLED)")
        if told.get(AT_BOOT, WANTED[AT_BOOT]) != WANTED[AT_BOOT]:
            await self._set(AT_BOOT, WANTED[AT_BOOT])
            raise Rejected("PLND_TYPE is 1 now, but the autopilot reads it at boot: reboot it, then try again")
        for name, value in WANTED.items():
            if name not in told or (told[name] == value and name not in self.before):
                continue
            self.before.setdefault(name, told[name])  # of a landing that was cut short it is still the first value
            await self._set(name, value)

    async def switch_off(self) -> None:
        """Give the switch back, without which the others mean nothing: LAND and RTL heed no target then.

        Raises:
            Rejected: it did not take its value.
        """
        if ENABLE in self.before:
            await self._give_back(ENABLE)

    async def give_back(self) -> None:
        """Give every parameter the value that it had, the switch first.

        Raises:
            Rejected: some did not take it; the others were given back all the same.
        """
        refused = []
        for name in sorted(self.before, key=lambda name: name != ENABLE):
            try:
                await self._give_back(name)
            except Rejected:
                refused.append(f"{name} = {self.before[name]:g}")
        if refused:
            raise Rejected(f"the autopilot does not take {', '.join(refused)}, which it had before the landing")

    async def _give_back(self, name: str) -> None:
        await self._set(name, self.before[name])
        del self.before[name]

    def remaining(self) -> list[Any]:
        """The PARAM_SETs that give everything back, for when nobody can wait."""
        return [set_parameter(self.vehicle.address, name, value) for name, value in self.before.items()]

    async def _set(self, name: str, value: float) -> None:
        vehicle = self.vehicle

        def read_back(message: Any) -> bool | None:
            same = message.param_id == name and math.isclose(message.param_value, value, rel_tol=1e-5, abs_tol=1e-5)
            return True if same else None

        for _ in range(TRIES):
            with vehicle.waiting.expecting({"PARAM_VALUE"}, read_back) as told:
                await vehicle.link.send(set_parameter(vehicle.address, name, value), vehicle.state.system)
                try:
                    await told.within(READ_BACK, f"take {name} = {value:g}")
                except TimedOut:
                    continue
                return
        raise Rejected(f"the autopilot does not take {name} = {value:g}")


def landing_target(time: float, relative: Vector, attitude: Attitude) -> Any:
    """LANDING_TARGET in MAV_FRAME_BODY_FRD.

    Args:
        time: s, for the message's time stamp.
        relative: from the vehicle to the target, m NED.
        attitude: of the vehicle when the message is sent.

    Raises:
        ValueError: a number is not finite.
    """
    x, y, z = (float(part) for part in attitude.matrix.T @ relative)
    distance = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(distance):
        raise ValueError(f"no place of a target: {relative}")
    return mavlink.MAVLink_landing_target_message(
        int(time * 1e6),
        0,
        mavlink.MAV_FRAME_BODY_FRD,
        math.atan2(y, z) if z else 0.0,  # as ArduPilot reads them where it does not read the position:
        math.atan2(-x, z) if z else 0.0,  # forward is -tan(angle_y), right is tan(angle_x)
        max(distance, 0.01),
        0.0,
        0.0,
        x,
        y,
        z,
        (1.0, 0.0, 0.0, 0.0),
        mavlink.LANDING_TARGET_TYPE_VISION_FIDUCIAL,
        1,
    )
