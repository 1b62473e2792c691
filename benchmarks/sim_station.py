"""A ground station of one simulated vehicle, ArduPilot's or the embedded one, without MAVProxy."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from typing import Any

os.environ["MAVLINK20"] = "1"  # before pymavlink chooses its dialect

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

HOME = (-35.363261, 149.165230, 584.0, 353.0)
METRES_PER_DEGREE = 111318.845
WATCHED = (
    "LOCAL_POSITION_NED",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "VFR_HUD",
    "MISSION_CURRENT",
    "EKF_STATUS_REPORT",
)
TIMEOUT = 600.0  # s of the wall clock that anything may take
NAN = math.nan
Item = tuple[int, tuple[float, ...], tuple[float, float] | None, float]
"""A mission item: the command, its first parameters, the place in m north and east of home, and the altitude in m."""


class Station:
    """A ground station of one vehicle; `at` is the vehicle's clock, s.

    Args:
        vehicle: its TCP port, or a link to it as pymavlink's.
    """

    def __init__(self, vehicle: Any) -> None:
        self._link: Any = vehicle
        if isinstance(vehicle, int):
            address = f"tcp:127.0.0.1:{vehicle}"
            self._link = mavutil.mavlink_connection(address, source_system=255, source_component=190)
            self._link.handle_eof = self._ended
        self.send = self._link.mav
        self.last: dict[str, Any] = {}
        self.texts: list[str] = []
        self.reached: list[int] = []
        self.at = 0.0
        self.listener: Callable[[list[str]], None] | None = None
        self.wait(lambda: "HEARTBEAT" in self.last)
        for name in WATCHED:
            while self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, _number(name), 100_000) != 0:
                pass
        self.wait(lambda: self._has_position and self._healthy)
        self.run(3)

    @property
    def _has_position(self) -> bool:
        """By a state, not by the text: that may have come before this station."""
        report = self.last.get("EKF_STATUS_REPORT")
        return report is not None and bool(report.flags & mavlink.EKF_POS_HORIZ_ABS)

    @property
    def _healthy(self) -> bool:
        status = self.last.get("SYS_STATUS")
        return status is not None and bool(
            status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
        )

    def close(self) -> None:
        self._link.close()

    def _ended(self) -> None:
        raise ConnectionError(f"the vehicle has ended; the last it said: {self.texts[-5:]}")

    def hear(self) -> None:
        message = self._link.recv_match(blocking=True, timeout=0.5)
        if message is None or message.get_srcSystem() != 1:
            return
        name = message.get_type()
        self.last[name] = message
        if self.listener is not None:
            self.listener([name])
        if name == "LOCAL_POSITION_NED":
            self.at = message.time_boot_ms / 1000
        elif name == "STATUSTEXT":
            self.texts.append(message.text)
        elif name == "MISSION_ITEM_REACHED":
            self.reached.append(message.seq)

    def wait(self, condition: Callable[[], bool], most: float = math.inf) -> float:
        """Until it holds, or so many seconds of the vehicle have passed; the seconds that it took."""
        started, deadline = self.at, time.monotonic() + TIMEOUT
        while not condition() and self.at - started < most:
            assert time.monotonic() < deadline, "the vehicle does not get there"
            self.hear()
        return round(self.at - started, 1)

    def run(self, seconds: float) -> None:
        self.wait(lambda: False, seconds)

    def _acknowledged(self, number: int) -> int | None:
        deadline = time.monotonic() + 5
        self.last.pop("COMMAND_ACK", None)
        while time.monotonic() < deadline:
            self.hear()
            ack = self.last.get("COMMAND_ACK")
            if ack is not None and ack.command == number:
                return int(ack.result)
        return None

    def command(self, number: int, *parameters: float) -> int | None:
        self.send.command_long_send(1, 1, number, 0, *parameters, *([0.0] * (7 - len(parameters))))
        return self._acknowledged(number)

    def reposition(
        self, north: float, east: float, z: float = 0.0, change: int = 1, radius: float = 0.0
    ) -> int | None:
        lat, lon = place(north, east)
        number = mavlink.MAV_CMD_DO_REPOSITION
        self.send.command_int_send(
            1, 1, 3, number, 0, 0, -1, change, radius, NAN, round(lat * 1e7), round(lon * 1e7), z
        )
        return self._acknowledged(number)

    def mode(self, number: int) -> int | None:
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number)

    def arm(self) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def disarm(self) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)

    def parameter(self, name: str, value: float) -> None:
        self.last.pop("PARAM_VALUE", None)
        self.send.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        self.wait(lambda: "PARAM_VALUE" in self.last)

    def drive_to(self, north: float, east: float) -> None:
        self.send.set_position_target_local_ned_send(0, 1, 1, 1, 0x0DF8, north, east, 0, 0, 0, 0, 0, 0, 0, 0, 0)

    def upload(self, items: list[Item]) -> int:
        """The MAV_MISSION_RESULT; what is late or repeated of a slow exchange does not count."""
        self.send.mission_count_send(1, 1, len(items), 0)
        deadline = time.monotonic() + 60
        late, ack, following = mavlink.MAV_MISSION_INVALID_SEQUENCE, None, 0
        while ack is None or ack.type == late:
            assert time.monotonic() < deadline, "the vehicle takes no mission"
            self.last.pop("MISSION_REQUEST", None)
            self.last.pop("MISSION_ACK", None)
            self.hear()
            ack, request = self.last.get("MISSION_ACK"), self.last.get("MISSION_REQUEST")
            if request is None or request.seq != following:
                continue
            command, parameters, where, z = items[following]
            following = min(following + 1, len(items) - 1)
            lat, lon = place(*where) if where is not None else (0.0, 0.0)
            four = (*parameters, *([0.0] * (4 - len(parameters))))
            spot = (round(lat * 1e7), round(lon * 1e7), z)
            self.send.mission_item_int_send(1, 1, request.seq, 3, command, 0, 1, *four, *spot, 0)
        return int(ack.type)

    # What the vehicle shows.

    @property
    def position(self) -> tuple[float, float]:
        return self.last["LOCAL_POSITION_NED"].x, self.last["LOCAL_POSITION_NED"].y

    @property
    def height(self) -> float:
        return -float(self.last["LOCAL_POSITION_NED"].z)

    @property
    def speed(self) -> float:
        return math.hypot(self.last["LOCAL_POSITION_NED"].vx, self.last["LOCAL_POSITION_NED"].vy)

    @property
    def armed(self) -> bool:
        return bool(self.last["HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def heartbeat(self) -> tuple[int, int, int, int]:
        """Type, base mode, mode, status."""
        self.last.pop("HEARTBEAT", None)
        self.wait(lambda: "HEARTBEAT" in self.last)
        output = self.last["HEARTBEAT"]
        return output.type, output.base_mode, output.custom_mode, output.system_status

    @property
    def landed_state(self) -> tuple[int, int]:
        output = self.last["EXTENDED_SYS_STATE"]
        return output.vtol_state, output.landed_state

    def away(self, north: float, east: float) -> float:
        return math.dist(self.position, (north, east))

    def circle(self, north: float, east: float, seconds: float = 40.0) -> tuple[float, float]:
        """Mean radius around a place, and mean speed."""
        radii, speeds, end = [], [], self.at + seconds
        while self.at < end:
            self.hear()
            radii.append(self.away(north, east))
            speeds.append(self.speed)
        return round(sum(radii) / len(radii), 1), round(sum(speeds) / len(speeds), 1)

    def streams(self) -> list[str]:
        """What comes with all streams at 4 Hz."""
        self.send.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
        self.run(1)
        self.last = {"LOCAL_POSITION_NED": self.last["LOCAL_POSITION_NED"]}
        self.run(2)
        return sorted(self.last)


def place(north: float, east: float) -> tuple[float, float]:
    """Degrees of a place so many metres from home."""
    lat, lon = HOME[:2]
    return lat + north / METRES_PER_DEGREE, lon + east / (METRES_PER_DEGREE * math.cos(math.radians(lat)))


def _number(name: str) -> int:
    return int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))
