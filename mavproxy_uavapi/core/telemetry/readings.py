"""What a vehicle reports of itself, in degrees and SI units. MAVLink's scaled integers are decoded here. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.core.geodesy import from_deg_e7

UNKNOWN_HEADING = 36000  # 1e-2 degrees; from here on MAVLink's 65535 and others that are no heading


@dataclass(frozen=True)
class GlobalPosition:
    """GLOBAL_POSITION_INT.

    Attributes:
        lat, lon: degrees.
        alt: m above home.
        msl: m above sea level.
        velocity: m/s north, east, down.
        heading: degrees clockwise from north; None where it is unknown.
        boot_time: s of the vehicle's own clock.
    """

    lat: float
    lon: float
    alt: float
    msl: float
    velocity: tuple[float, float, float]
    heading: float | None
    boot_time: float

    @classmethod
    def of(cls, message: Any) -> GlobalPosition:
        """What such a message says."""
        return cls(
            from_deg_e7(message.lat),
            from_deg_e7(message.lon),
            message.relative_alt / 1000.0,
            message.alt / 1000.0,
            (message.vx / 100.0, message.vy / 100.0, message.vz / 100.0),
            message.hdg / 100.0 if message.hdg < UNKNOWN_HEADING else None,
            message.time_boot_ms / 1000.0,
        )

    @property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude, degrees."""
        return self.lat, self.lon

    @property
    def home_msl(self) -> float:
        """The height of home, m above sea level."""
        return self.msl - self.alt

    @property
    def speed(self) -> float:
        """m/s, of all three axes."""
        return math.hypot(*self.velocity)


@dataclass(frozen=True)
class LocalPosition:
    """LOCAL_POSITION_NED: m and m/s north, east, down of the EKF's origin; s of the vehicle's own clock."""

    north: float
    east: float
    down: float
    velocity: tuple[float, float, float]
    boot_time: float

    @classmethod
    def of(cls, message: Any) -> LocalPosition:
        """What such a message says."""
        return cls(
            message.x, message.y, message.z, (message.vx, message.vy, message.vz), message.time_boot_ms / 1000.0
        )

    @property
    def speed(self) -> float:
        """m/s, of all three axes."""
        return math.hypot(*self.velocity)


@dataclass(frozen=True)
class VehicleAttitude:
    """ATTITUDE: rad, and rad/s of the body's axes; yaw clockwise from north."""

    roll: float
    pitch: float
    yaw: float
    rates: tuple[float, float, float]

    @classmethod
    def of(cls, message: Any) -> VehicleAttitude:
        """What such a message says."""
        rates = message.rollspeed, message.pitchspeed, message.yawspeed
        return cls(message.roll, message.pitch, message.yaw, rates)


@dataclass(frozen=True)
class HomePlace:
    """HOME_POSITION: degrees, and m above sea level."""

    lat: float
    lon: float
    msl: float

    @classmethod
    def of(cls, message: Any) -> HomePlace:
        """What such a message says."""
        return cls(from_deg_e7(message.latitude), from_deg_e7(message.longitude), message.altitude / 1000.0)

    @property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude, degrees."""
        return self.lat, self.lon
