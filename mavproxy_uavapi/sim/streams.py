"""Which messages a link gets, how often: ArduCopter's stream groups and message intervals.

Times are seconds on the simulated clock. Both ways of asking write to the same table, so the later request
wins: a REQUEST_DATA_STREAM overrides the intervals of all messages in that stream.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Groups = Mapping[int, tuple[str, ...]]

GROUPS: Groups = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: ("RAW_IMU", "SCALED_PRESSURE"),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        "SYS_STATUS",
        "POWER_STATUS",
        "MEMINFO",
        "MISSION_CURRENT",
        "GPS_RAW_INT",
        "NAV_CONTROLLER_OUTPUT",
        "POSITION_TARGET_GLOBAL_INT",
    ),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    mavlink.MAV_DATA_STREAM_RAW_CONTROLLER: (),
    mavlink.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    mavlink.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE", "SIMSTATE"),
    mavlink.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD",),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        "AHRS",
        "SYSTEM_TIME",
        "BATTERY_STATUS",
        "EKF_STATUS_REPORT",
        "VIBRATION",
    ),
}
"""Stream to messages, as ArduCopter's tables, of what this vehicle can send.

EXTENDED_SYS_STATE, HOME_POSITION and POSITION_TARGET_LOCAL_NED are in no stream there either: they come by
SET_MESSAGE_INTERVAL or REQUEST_MESSAGE only.
"""

PLANE_GROUPS: Groups = {
    **GROUPS,
    mavlink.MAV_DATA_STREAM_EXTRA3: (*GROUPS[mavlink.MAV_DATA_STREAM_EXTRA3], "WIND"),
}
"""A plane reports the wind, too."""

RATE_PARAMETERS: Mapping[int, str] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: "RAW_SENS",
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: "EXT_STAT",
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: "RC_CHAN",
    mavlink.MAV_DATA_STREAM_RAW_CONTROLLER: "RAW_CTRL",
    mavlink.MAV_DATA_STREAM_POSITION: "POSITION",
    mavlink.MAV_DATA_STREAM_EXTRA1: "EXTRA1",
    mavlink.MAV_DATA_STREAM_EXTRA2: "EXTRA2",
    mavlink.MAV_DATA_STREAM_EXTRA3: "EXTRA3",
}
"""Stream to the parameter with its rate, behind a prefix."""
HEARTBEAT_INTERVAL = 1.0


class Streams:
    """The intervals of one link."""

    def __init__(self, groups: Groups | None = None) -> None:
        self._groups = GROUPS if groups is None else groups
        self._interval: dict[str, float] = {}
        self._due: dict[str, float] = {}
        self._next = math.inf
        self.set("HEARTBEAT", HEARTBEAT_INTERVAL, 0.0)

    def interval(self, name: str) -> float | None:
        """Seconds between two messages, or None when the message is not streamed."""
        return self._interval.get(name)

    def set(self, name: str, interval: float | None, now: float) -> None:
        """Stream a message each interval seconds, or no longer with None."""
        if interval is None:
            self._interval.pop(name, None)
            self._due.pop(name, None)
        elif self._interval.get(name) != interval:
            self._interval[name] = interval
            self._due[name] = now
        self._next = min(self._due.values(), default=math.inf)

    def request_group(self, stream: int, rate: float, now: float) -> list[int]:
        """REQUEST_DATA_STREAM: rate in Hz for all messages of a stream, 0 stops them; stream 0 is all.

        Returns:
            The streams that now have this rate.
        """
        groups = [group for group in self._groups if stream in (group, mavlink.MAV_DATA_STREAM_ALL)]
        for group in groups:
            for name in self._groups[group]:
                self.set(name, 1 / rate if rate > 0 else None, now)
        return groups

    def due(self, now: float) -> list[str]:
        """Messages to send now. A rate beyond the caller's own is limited to one message for each call."""
        if now < self._next:
            return []
        names = [name for name, at in self._due.items() if at <= now + 1e-9]
        for name in names:
            following = self._due[name] + self._interval[name]
            self._due[name] = following if following > now else now + self._interval[name]
        self._next = min(self._due.values(), default=math.inf)
        return names


def group_of(name: str, groups: Groups = GROUPS) -> int | None:
    """The stream a message belongs to, or None."""
    for stream, names in groups.items():
        if name in names:
            return stream
    return None
