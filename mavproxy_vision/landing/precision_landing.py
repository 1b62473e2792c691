"""ArduPilot's own precision landing: its parameters, set and restored, and LANDING_TARGET."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import NotSupported, Rejected, TimedOut
from mavproxy_uavapi.core.link.messages import read_parameter, set_parameter
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_vision.geometry.frames import Attitude, Vector

mavlink = mavutil.mavlink

READ_BACK = 2.0  # s
TRIES = 3
AT_BOOT = "PLND_TYPE"
ENABLE = "PLND_ENABLED"
DOWNWARDS = 25.0  # MAV_SENSOR_ROTATION_PITCH_270
# When the target is lost we go back to GUIDED and search, so the autopilot needs no retries. If nobody takes the
# vehicle back, strict 1 holds for a while, then lands; 2 would hover until the battery is empty.
# With ALT_MIN and ALT_MAX other than 0 and no rangefinder ArduPilot just descends when the target is lost.
# Our targets are already in the vehicle's frame, with alignment, orientation and offset of the sensor.
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
    """The PLND parameters of one vehicle, and their values from before our landings.

    Attributes:
        vehicle: the vehicle.
        before: the values that are not restored yet, by name.
        in_use: whether a landing needs them; nothing is restored then.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.before: dict[str, float] = {}
        self.in_use = False
        self._unread: int | None = None  # number of the reboots before which PLND_TYPE was set
        self._lock = asyncio.Lock()

    async def check(self) -> None:
        """Check whether the autopilot supports it, before anything is flown.

        Raises:
            NotSupported: the autopilot has no precision landing.
            Rejected: PLND_TYPE had another value at boot, as far as we know.
        """
        if not mavutil.mavlink20():
            raise NotSupported("LANDING_TARGET has a position in MAVLink 2 only: start MAVProxy without --mav10")
        values = await self.vehicle.parameters.read((name,) for name in WANTED)
        if ENABLE not in values:
            raise NotSupported("the autopilot has no precision landing (no PLND_ENABLED)")
        if values.get(AT_BOOT, WANTED[AT_BOOT]) != WANTED[AT_BOOT]:
            await self._set(AT_BOOT, WANTED[AT_BOOT])
            self._unread = self.vehicle.state.reboots
        if self._unread == self.vehicle.state.reboots:
            raise Rejected("PLND_TYPE is 1 now, but the autopilot reads it at boot: reboot it, then try again")

    async def set_up(self, check: Callable[[], None]) -> None:
        """Set the parameters and read them back.

        Args:
            check: called before each message and with each heartbeat; an error that it raises ends this.

        Raises:
            Rejected: a parameter did not take its value. Also any error of `check`.
        """
        self.in_use = True
        async with self._lock:
            values = await self.vehicle.parameters.read((name,) for name in WANTED)
            for name, value in WANTED.items():
                if name not in values or (values[name] == value and name not in self.before):
                    continue
                self.before.setdefault(name, values[name])  # after an aborted landing the first value stays
                await self._set(name, value, check)

    async def switch_off(self) -> None:
        """Restore the switch, without which the other parameters have no effect: LAND and RTL ignore targets then.

        Raises:
            Rejected: the switch did not take its value.
        """
        async with self._lock:
            await self._give_back(ENABLE)

    async def give_back(self) -> None:
        """Restore every parameter, the switch first, unless a landing begins that needs them.

        A value that was changed meanwhile stays.

        Raises:
            Rejected: some were refused; the others are restored.
        """
        refused = []
        async with self._lock:
            for name in self._in_order():
                try:
                    if not self.in_use:
                        await self._give_back(name)
                except Rejected:
                    refused.append(f"{name} = {self.before[name]:g}")
        if refused:
            raise Rejected(f"the autopilot does not take {', '.join(refused)}, which it had before the landing")

    def _in_order(self) -> list[str]:
        return sorted(self.before, key=lambda name: name != ENABLE)

    async def _give_back(self, name: str) -> None:
        if name in self.before and await self._current_value(name) == WANTED[name]:
            await self._set(name, self.before[name])
        self.before.pop(name, None)

    def remaining(self) -> list[Any]:
        """The PARAM_SETs that restore everything, for an end without waiting."""
        return [set_parameter(self.vehicle.address, name, self.before[name]) for name in self._in_order()]

    async def _current_value(self, name: str) -> float:
        """Request the parameter's present value: it may have been changed while the link was silent."""
        message = await self._request(name, read_parameter(self.vehicle.address, name), None)
        if message is None:
            raise Rejected(f"the autopilot does not report {name}")
        return float(message.param_value)

    async def _set(self, name: str, value: float, check: Callable[[], None] = lambda: None) -> None:
        if await self._request(name, set_parameter(self.vehicle.address, name, value), value, check) is None:
            raise Rejected(f"the autopilot does not take {name} = {value:g}")

    async def _request(
        self, name: str, request: Any, value: float | None, check: Callable[[], None] = lambda: None
    ) -> Any:
        """The PARAM_VALUE that answers a request, sent up to TRIES times; with `value` only one with that value."""
        vehicle = self.vehicle

        def answer(message: Any) -> Any:
            if message.get_type() == "HEARTBEAT":
                check()
                return None
            same = value is None or math.isclose(message.param_value, value, rel_tol=1e-5, abs_tol=1e-5)
            return message if message.param_id == name and same else None

        for _ in range(TRIES):
            check()
            with vehicle.waiting.expecting({"PARAM_VALUE", "HEARTBEAT"}, answer) as reply:
                await vehicle.post(request, check)
                with contextlib.suppress(TimedOut):
                    return await reply.within(READ_BACK, f"answer for {name}")
        return None


def landing_target(time: float, relative: Vector, attitude: Attitude) -> Any:
    """LANDING_TARGET in MAV_FRAME_BODY_FRD.

    Args:
        time: s, for the message's timestamp.
        relative: from the vehicle to the target, m NED.
        attitude: of the vehicle when the message is sent.
    """
    x, y, z = (float(part) for part in attitude.matrix.T @ relative)
    distance = math.sqrt(x * x + y * y + z * z)
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
