"""The telemetry types of aerpawlib's scripts: attributes, and texts that loggers parse."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Battery:
    """Voltage in V, current in A, level in %."""

    voltage: float = 0.0
    current: float = 0.0
    level: int = 0

    def __str__(self) -> str:
        return f"Battery:voltage={self.voltage},current={self.current},level={self.level}"


@dataclass(frozen=True)
class GPSInfo:
    """The fix (0, 1: none; 2: 2-D; 3: 3-D and better) and the number of satellites."""

    fix_type: int = 0
    satellites_visible: int = 0

    def __str__(self) -> str:
        return f"GPSInfo:fix={self.fix_type},num_sat={self.satellites_visible}"


@dataclass(frozen=True)
class Attitude:
    """Pitch, yaw and roll in rad; yaw clockwise from north."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def __str__(self) -> str:
        return f"Attitude:pitch={self.pitch},yaw={self.yaw},roll={self.roll}"


@dataclass(frozen=True)
class Version:
    """The autopilot's version; always empty, because the API does not report it."""

    major: int | None = None
    minor: int | None = None
    patch: int | None = None
    release: str | None = None

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"
