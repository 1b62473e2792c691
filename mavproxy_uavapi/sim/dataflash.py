"""ArduPilot's binary log with texts, modes, attitude and position.

A message is two fixed bytes, its type, and its fields, little-endian. FMT messages describe all types.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from mavproxy_uavapi.core.geodesy import to_deg_e7

if TYPE_CHECKING:
    from .vehicle import EmbeddedVehicle

HEAD = b"\xa3\x95"
FORMATS: Mapping[str, tuple[int, str, str]] = {
    # Type, ArduPilot's format, names of the fields.
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "MSG": (129, "QZ", "TimeUS,Message"),
    "MODE": (130, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "ATT": (131, "Qccc", "TimeUS,Roll,Pitch,Yaw"),
    "GPS": (132, "QBIHBLLeff", "TimeUS,Status,GMS,GWk,NSats,Lat,Lng,Alt,Spd,GCrs"),
}
CODES = {"n": "4s", "N": "16s", "Z": "64s", "M": "B", "c": "h", "L": "i", "e": "i"}
"""ArduPilot's letters that `struct` spells otherwise: c is degrees * 100, L degrees * 1e7, e metres * 100."""
INTERVAL = 0.2
"""Simulated seconds between two records of attitude and position."""
KEPT = 5
"""Logs; the oldest is erased for a sixth one, and the others move up, as in ArduPilot."""
LARGEST = 4 * 1024 * 1024
"""Bytes of one log; a longer flight is not recorded to its end."""
GPS_EPOCH = 315964800
"""1980-01-06 in unix seconds."""
LEAP_SECONDS = 18
WEEK = 7 * 86400
REASON_UNKNOWN = 0


def record(name: str, *fields: int | float | bytes) -> bytes:
    """One message of the log."""
    kind, letters, _ = FORMATS[name]
    return HEAD + bytes([kind]) + struct.pack(_packing(letters), *fields)


@cache
def _packing(letters: str) -> str:
    return "<" + "".join(CODES.get(letter, letter) for letter in letters)


def formats() -> bytes:
    """The FMT messages, with which a log begins."""
    return b"".join(
        record(
            "FMT",
            kind,
            len(HEAD) + 1 + struct.calcsize(_packing(letters)),
            name.encode(),
            letters.encode(),
            columns.encode(),
        )
        for name, (kind, letters, columns) in FORMATS.items()
    )


@dataclass(frozen=True)
class StoredLog:
    """A finished log: when it began (unix seconds), and its bytes."""

    began: int
    data: bytes


class Dataflash:
    """The logs of one vehicle, from arming to disarming each; a reboot keeps them."""

    def __init__(self) -> None:
        self.logs: list[StoredLog] = []
        self._data: bytearray | None = None
        self._began = 0
        self._mode: int | None = None
        self._due = 0.0

    def step(self, vehicle: EmbeddedVehicle, epoch: float) -> None:
        """Record what there is to record; epoch is the unix time in seconds at which the vehicle booted."""
        if not vehicle.armed:
            self.close()
            return
        if self._data is None:
            self._open(vehicle, epoch)
        if vehicle.mode.number != self._mode:
            self._mode = vehicle.mode.number
            self._write("MODE", _microseconds(vehicle), self._mode, self._mode, REASON_UNKNOWN)
        if vehicle.now >= self._due:
            self._due = vehicle.now + INTERVAL
            self._sample(vehicle, epoch + vehicle.now)

    def close(self) -> None:
        """Finish the log that is being written."""
        if self._data is not None:
            self.logs = [*self.logs, StoredLog(self._began, bytes(self._data))][-KEPT:]
            self._data = None

    def erase(self) -> None:
        """Forget all finished logs."""
        self.logs = []

    def _open(self, vehicle: EmbeddedVehicle, epoch: float) -> None:
        self._data = bytearray(formats())
        self._began, self._mode, self._due = int(epoch + vehicle.now), None, 0.0
        for text in vehicle.banner:
            self._write("MSG", _microseconds(vehicle), text.encode())

    def _write(self, name: str, *fields: int | float | bytes) -> None:
        if self._data is not None and len(self._data) < LARGEST:
            self._data += record(name, *fields)

    def _sample(self, vehicle: EmbeddedVehicle, unix: float) -> None:
        now, body = _microseconds(vehicle), vehicle.body
        yaw = math.degrees(body.yaw) % 360
        attitude = (math.degrees(body.roll), math.degrees(body.pitch), yaw)
        self._write("ATT", now, *(_signed(angle) for angle in attitude))
        place, velocity = vehicle.estimator.location, vehicle.estimator.velocity
        week, seconds = divmod(max(unix - GPS_EPOCH + LEAP_SECONDS, 0.0), WEEK)
        course = math.degrees(math.atan2(velocity.east, velocity.north)) % 360
        self._write(
            "GPS",
            now,
            6,
            int(seconds * 1000),
            int(week),
            10,
            to_deg_e7(place.latitude),
            to_deg_e7(place.longitude),
            round(place.altitude * 100),
            math.hypot(velocity.north, velocity.east),
            course,
        )


def _microseconds(vehicle: EmbeddedVehicle) -> int:
    return int(vehicle.now * 1e6 + 0.5)


def _signed(angle: float) -> int:
    """Hundredths of a degree from -180 to 180, which the format can hold."""
    return round(((angle + 180.0) % 360.0 - 180.0) * 100)
