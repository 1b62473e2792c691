"""aerpawlib's coordinates and vectors. Unlike aerpawlib's, they are consistent with the autopilot's metres."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from mavproxy_uavapi.client.places import Ned, Position

EARTH_RADIUS = 6378100.0  # m; the sphere that ArduPilot uses for distances

Waypoint = tuple[int, float, float, float, int, float]  # command, latitude, longitude, altitude, id, speed


@dataclass(unsafe_hash=True, repr=False)
class VectorNED:
    """North, east, down: m for a displacement, m/s for a velocity."""

    north: float
    east: float
    down: float = 0

    def rotate_by_angle(self, angle: float) -> VectorNED:
        """Turned in the horizontal plane by `angle` degrees, counterclockwise seen from above."""
        cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        return VectorNED(self.north * cos + self.east * sin, self.east * cos - self.north * sin, self.down)

    def cross_product(self, o: VectorNED) -> VectorNED:
        """The cross product."""
        o = _vector(o)
        return VectorNED(
            self.east * o.down - self.down * o.east,
            self.down * o.north - self.north * o.down,
            self.north * o.east - self.east * o.north,
        )

    def hypot(self, ignore_down: bool = False) -> float:
        """Its length, in three dimensions or horizontally."""
        return math.hypot(self.north, self.east, 0 if ignore_down else self.down)

    def magnitude(self) -> float:
        """Its length in three dimensions."""
        return self.hypot()

    def norm(self) -> VectorNED:
        """Its direction as a vector of length 1; the zero vector stays zero."""
        length = self.hypot()
        return self * (1 / length) if length else VectorNED(0, 0, 0)

    def __add__(self, o: VectorNED) -> VectorNED:
        o = _vector(o)
        return VectorNED(self.north + o.north, self.east + o.east, self.down + o.down)

    def __sub__(self, o: VectorNED) -> VectorNED:
        o = _vector(o)
        return VectorNED(self.north - o.north, self.east - o.east, self.down - o.down)

    def __mul__(self, o: float) -> VectorNED:
        if not isinstance(o, int | float):
            raise TypeError(f"a VectorNED is multiplied by a number, not by {o!r}")
        return VectorNED(self.north * o, self.east * o, self.down * o)

    __rmul__ = __mul__

    def __str__(self) -> str:
        return f"({self.north},{self.east},{self.down})"

    def __repr__(self) -> str:
        return f"VectorNED{self}"


@dataclass(unsafe_hash=True, repr=False)
class Coordinate:
    """Latitude and longitude in degrees, altitude in m above home."""

    lat: float
    lon: float
    alt: float = 0

    def ground_distance(self, other: Coordinate) -> float:
        """Horizontal metres."""
        lat, other_lat = math.radians(self.lat), math.radians(_coordinate(other).lat)
        half_lat, half_lon = (other_lat - lat) / 2, math.radians(other.lon - self.lon) / 2
        haversine = math.sin(half_lat) ** 2 + math.cos(lat) * math.cos(other_lat) * math.sin(half_lon) ** 2
        return 2 * EARTH_RADIUS * math.asin(min(math.sqrt(haversine), 1.0))

    def distance(self, other: Coordinate) -> float:
        """Metres in three dimensions."""
        return math.hypot(self.ground_distance(other), other.alt - self.alt)

    def bearing(self, other: Coordinate, wrap_360: bool = True) -> float:
        """The direction to `other`, degrees clockwise from north: 0 to 360; without `wrap_360` -90 to 270."""
        way = _position(_coordinate(other)) - _position(self)
        if not wrap_360 and way.bearing > 270:
            return way.bearing - 360
        return way.bearing

    def __add__(self, o: VectorNED) -> Coordinate:
        o = _vector(o)
        moved = _position(self) + Ned(o.north, o.east, o.down)
        return Coordinate(moved.lat, moved.lon, moved.alt)

    def __sub__(self, o: VectorNED | Coordinate) -> Coordinate | VectorNED:
        if isinstance(o, VectorNED):
            return self + -1 * o
        way = _position(self) - _position(_coordinate(o))
        return VectorNED(way.north, way.east, way.down)

    def __str__(self) -> str:
        return f"({self.lat},{self.lon},{self.alt})"

    def __repr__(self) -> str:
        return f"Coordinate{self}"

    def to_json(self) -> str:
        """A JSON object with lat, lon and alt."""
        return json.dumps({"lat": self.lat, "lon": self.lon, "alt": self.alt})

    toJson = to_json


def _position(of: Coordinate) -> Position:
    return Position(of.lat, of.lon, of.alt)


def _vector(value: VectorNED) -> VectorNED:
    if not isinstance(value, VectorNED):
        raise TypeError(f"{value!r} is not a VectorNED")
    return value


def _coordinate(value: Coordinate) -> Coordinate:
    if not isinstance(value, Coordinate):
        raise TypeError(f"{value!r} is not a Coordinate")
    return value


def pickle_as_of(module: str) -> None:
    """Pickle them under the name of that module: peers with the real aerpawlib exchange them by ZMQ."""
    for kind in (VectorNED, Coordinate):
        kind.__module__ = module


pickle_as_of("aerpawlib.v1.util.geometry")
