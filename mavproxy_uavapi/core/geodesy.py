"""Short distances on the Earth, computed as ArduPilot does: flat around the vehicle. Pure."""

from __future__ import annotations

import math

# One degree of latitude in metres on a sphere of the WGS 84 equatorial radius, 6378100 m: ArduPilot's
# LATITUDE_SCALE (Location.h), so that our distances agree with the autopilot's.
METRES_PER_DEGREE = 111318.84502145034
DEG_E7 = 1e7  # MAVLink's unit degE7 has so many in a degree


def from_deg_e7(value: float) -> float:
    """Degrees, of MAVLink's degE7."""
    return value / DEG_E7


def to_deg_e7(degrees: float) -> int:
    """MAVLink's degE7, of degrees."""
    return round(degrees * DEG_E7)


def offset(from_lat: float, from_lon: float, to_lat: float, to_lon: float) -> tuple[float, float]:
    """Metres north and east from one place to another, both in degrees; accurate within some kilometres."""
    north = (to_lat - from_lat) * METRES_PER_DEGREE
    delta_lon = (to_lon - from_lon + 180.0) % 360.0 - 180.0
    east = delta_lon * METRES_PER_DEGREE * math.cos(math.radians((from_lat + to_lat) / 2))
    return north, east


def moved(lat: float, lon: float, north: float, east: float) -> tuple[float, float]:
    """The place (degrees) so many metres north and east of one."""
    to_lat = lat + north / METRES_PER_DEGREE
    to_lon = lon + east / (METRES_PER_DEGREE * max(math.cos(math.radians((lat + to_lat) / 2)), 1e-6))
    return to_lat, (to_lon + 180.0) % 360.0 - 180.0


def rotate(front: float, right: float, heading: float) -> tuple[float, float]:
    """North and east of a body-frame offset, for a `heading` in rad clockwise from north."""
    north = front * math.cos(heading) - right * math.sin(heading)
    east = front * math.sin(heading) + right * math.cos(heading)
    return north, east
