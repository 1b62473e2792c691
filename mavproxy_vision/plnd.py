"""ArduPilot's own precision landing: its parameters, set and put back, and LANDING_TARGET."""

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
# Strict 2 hovers when the target is lost, until we take it back to GUIDED and search; no retries of its own.
# With ALT_MIN and ALT_MAX other than 0 and no rangefinder ArduPilot just descends when the target is lost.
WANTED = {
    ENABLE: 1.0,
    AT_BOOT: 1.0,
    "PLND_STRICT": 2.0,
    "PLND_RET_MAX": 0.0,
    "PLND_ALT_MIN": 0.0,
    "PLND_ALT_MAX": 0.0,
}


class PrecisionLanding:
    """PLND on one vehicle, for as long as a landing takes."""

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
            if name in told and told[name] != value:
                self.before[name] = told[name]
                await self._set(name, value)

    async def put_back(self) -> None:
        """Give every parameter the value that it had; the switch first."""
        for name in list(self.before):
            await self._set(name, self.before[name])
            del self.before[name]

    def remaining(self) -> list[Any]:
        """The PARAM_SETs that put everything back, for when nobody can wait any more."""
        return [set_parameter(self.vehicle.address, name, value) for name, value in self.before.items()]

    async def _set(self, name: str, value: float) -> None:
        vehicle = self.vehicle

        def read_back(message: Any) -> bool | None:
            same = message.param_id == name and math.isclose(message.param_value, value, abs_tol=1e-5)
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
    """
    x, y, z = (float(part) for part in attitude.matrix.T @ relative)
    distance = math.sqrt(x * x + y * y + z * z)
    return mavlink.MAVLink_landing_target_message(
        int(time * 1e6),
        0,
        mavlink.MAV_FRAME_BODY_FRD,
        math.atan2(-y, z) if z else 0.0,
        math.atan2(x, z) if z else 0.0,
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
