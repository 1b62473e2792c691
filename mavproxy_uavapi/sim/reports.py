"""What a vehicle reports about its navigation, before it becomes a message."""

from __future__ import annotations

from dataclasses import dataclass

from .geodesy import Ned

ZERO = Ned(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Navigation:
    """NAV_CONTROLLER_OUTPUT: angles and bearings in degrees, distances in metres, speeds in m/s."""

    roll: float = 0.0
    pitch: float = 0.0
    nav_bearing: float = 0.0
    target_bearing: float = 0.0
    distance: float = 0.0
    altitude_error: float = 0.0
    speed_error: float = 0.0
    crosstrack: float = 0.0


@dataclass(frozen=True)
class LocalTarget:
    """POSITION_TARGET_LOCAL_NED: its type mask, and NED metres from the EKF origin, m/s and m/s/s."""

    mask: int
    position: Ned = ZERO
    velocity: Ned = ZERO
    acceleration: Ned = ZERO
