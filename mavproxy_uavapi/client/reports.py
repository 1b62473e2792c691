"""What a vehicle reports of itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Attitude:
    """Roll, pitch and yaw in rad; yaw clockwise from north."""

    roll: float
    pitch: float
    yaw: float


@dataclass(frozen=True)
class Battery:
    """Voltage in V, current in A, level in %; None if unknown."""

    voltage: float | None
    current: float | None
    level: int | None


@dataclass(frozen=True)
class Gps:
    """The receiver's fix (3: 3-D and better) and its number of satellites; None if unknown."""

    fix_type: int
    satellites: int | None


@dataclass(frozen=True)
class Status:
    """The vehicle's status by the API; see /telemetry/status."""

    kind: str
    mode: str
    armed: bool | None
    landed_state: str
    link_alive: bool
    ekf_ok: bool
    ready_to_arm: bool
    why_not: tuple[str, ...]
