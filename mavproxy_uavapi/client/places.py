"""Positions and offsets, with the flat-Earth approximation that ArduPilot uses. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import overload

from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE, offset


@dataclass(frozen=True)
class Ned:
    """North, east, down: m for an offset, m/s for a velocity."""

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0

    def __add__(self, other: Ned) -> Ned:
        return Ned(self.north + other.north, self.east + other.east, self.down + other.down)

    def __sub__(self, other: Ned) -> Ned:
        return Ned(self.north - other.north, self.east - other.east, self.down - other.down)

    def __neg__(self) -> Ned:
        return Ned(-self.north, -self.east, -self.down)

    def __mul__(self, factor: float) -> Ned:
        return Ned(self.north * factor, self.east * factor, self.down * factor)

    __rmul__ = __mul__

    @property
    def horizontal(self) -> float:
        """Its horizontal length."""
        return math.hypot(self.north, self.east)

    @property
    def length(self) -> float:
        """Its length in three dimensions."""
        return math.hypot(self.north, self.east, self.down)

    @property
    def bearing(self) -> float:
        """Its direction, degrees clockwise from north, from 0 to less than 360."""
        return math.degrees(math.atan2(self.east, self.north)) % 360.0


@dataclass(frozen=True)
class Position:
    """Latitude and longitude in degrees, `alt` in m above home."""

    lat: float
    lon: float
    alt: float = 0.0

    def __add__(self, by: Ned) -> Position:
        lat = self.lat + by.north / METRES_PER_DEGREE
        middle = math.radians((self.lat + lat) / 2)
        lon = self.lon + by.east / (METRES_PER_DEGREE * math.cos(middle))
        return Position(lat, (lon + 180.0) % 360.0 - 180.0, self.alt - by.down)

    @overload
    def __sub__(self, other: Position) -> Ned: ...

    @overload
    def __sub__(self, other: Ned) -> Position: ...

    def __sub__(self, other: Position | Ned) -> Ned | Position:
        if isinstance(other, Ned):
            return self + -other
        north, east = offset(other.lat, other.lon, self.lat, self.lon)
        return Ned(north, east, other.alt - self.alt)

    def distance(self, other: Position) -> float:
        """Metres in three dimensions."""
        return (other - self).length

    def bearing(self, other: Position) -> float:
        """The direction to `other`, degrees clockwise from north."""
        return (other - self).bearing
