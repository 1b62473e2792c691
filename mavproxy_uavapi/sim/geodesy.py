"""Latitude, longitude and altitude to and from metres north, east and down of an origin.

A flat earth around the origin, with ArduPilot's scaling, so that both put a point in the same place:
one degree of latitude is LATLON_TO_M metres everywhere, a degree of longitude shrinks with the cosine
of the mean latitude (ArduPilot, Location::get_distance_NE and Location::offset).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

METRES_PER_DEGREE = 111318.84502145034
"""ArduPilot's LATLON_TO_M (0.011131884502145034 m per 1e-7 degree)."""


class Ned(NamedTuple):
    """A vector in metres (or m/s, m/s/s): north, east and down."""

    north: float
    east: float
    down: float


class Location(NamedTuple):
    """A point on the earth: latitude and longitude in degrees, altitude in metres AMSL."""

    latitude: float
    longitude: float
    altitude: float


def longitude_scale(latitude: float) -> float:
    """How much shorter a degree of longitude is than one of latitude; never below 0.01, as ArduPilot."""
    return max(math.cos(math.radians(latitude)), 0.01)


def to_ned(origin: Location, point: Location) -> Ned:
    """The vector in metres from origin to point."""
    mean_latitude = (origin.latitude + point.latitude) / 2
    delta_longitude = (point.longitude - origin.longitude + 180) % 360 - 180
    return Ned(
        (point.latitude - origin.latitude) * METRES_PER_DEGREE,
        delta_longitude * METRES_PER_DEGREE * longitude_scale(mean_latitude),
        origin.altitude - point.altitude,
    )


def from_ned(origin: Location, offset: Ned) -> Location:
    """The point that lies offset (metres) from origin."""
    latitude = origin.latitude + offset.north / METRES_PER_DEGREE
    mean_latitude = (origin.latitude + latitude) / 2
    longitude = origin.longitude + offset.east / (METRES_PER_DEGREE * longitude_scale(mean_latitude))
    return Location(latitude, (longitude + 180) % 360 - 180, origin.altitude - offset.down)


def wrap_pi(angle: float) -> float:
    """The same direction in radians within -pi..pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def rotate_to_ne(forward: float, right: float, yaw: float) -> tuple[float, float]:
    """North and east parts of a vector given in the vehicle's heading; yaw in radians."""
    cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
    return forward * cos_yaw - right * sin_yaw, forward * sin_yaw + right * cos_yaw


def metres_from(point: Sequence[float], start: Sequence[float], end: Sequence[float]) -> float:
    """Metres from the stretch between start and end."""
    along = [b - a for a, b in zip(start, end, strict=True)]
    length = sum(part * part for part in along)
    share = sum((p - a) * part for p, a, part in zip(point, start, along, strict=True)) / length if length else 0.0
    share = max(0.0, min(1.0, share))
    return math.dist(point, [a + share * part for a, part in zip(start, along, strict=True)])
