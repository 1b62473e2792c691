"""A flat frame in metres around a place. Pure.

North, east and up, east by the cosine of the latitude there. A straight line in it is straight in degrees, so inside
or outside of a polygon is exact at any distance. Metres are those of `geodesy.py`, the autopilot's own. East of the
middle they err by the share tan(latitude) n + n^2 / 2, with n = (metres north of the middle) / 6378 km: at 45 degrees
and 5 km by 0.08 %, at 60 degrees and 50 km by 1.4 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from mavproxy_uavapi.core.airspace.model import Place
from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE


class Spot(NamedTuple):
    """A point of the flat frame: metres north and east, and above home."""

    north: float
    east: float
    up: float


class LocalFrame:
    """A flat frame around a place.

    Args:
        origin: latitude and longitude, degrees.
    """

    def __init__(self, origin: Place) -> None:
        self.origin = origin
        self._east = METRES_PER_DEGREE * math.cos(math.radians(origin[0]))

    def metres(self, place: Place) -> tuple[float, float]:
        """Metres north and east of the origin."""
        delta = (place[1] - self.origin[1] + 180.0) % 360.0 - 180.0
        return (place[0] - self.origin[0]) * METRES_PER_DEGREE, delta * self._east

    def spot(self, place: Place, up: float) -> Spot:
        """The point at a place, `up` m above home."""
        return Spot(*self.metres(place), up)

    def spots(self, places: Any) -> Any:
        """The points of many places: an array of metres from one of degrees, each row with m above home."""
        east = places[:, 1] - self.origin[1]
        east -= 360.0 * np.rint(east / 360.0)
        north = (places[:, 0] - self.origin[0]) * METRES_PER_DEGREE
        return np.stack([north, east * self._east, places[:, 2]], axis=1)

    def degrees(self, spot: Spot) -> Place:
        """Latitude and longitude of a point."""
        lon = self.origin[1] + spot.east / self._east
        return self.origin[0] + spot.north / METRES_PER_DEGREE, (lon + 180.0) % 360.0 - 180.0


def rows(points: Sequence[tuple[float, float, float]]) -> Any:
    """An array with a row for each point. `np.array` would keep all other threads waiting for thousands of them."""
    return np.fromiter(chain.from_iterable(points), dtype=float, count=3 * len(points)).reshape(-1, 3)


def to_leg(spot: Spot, a: Spot, b: Spot) -> float:
    """Metres from a point to the straight way from `a` to `b`."""
    leg = [q - p for p, q in zip(a, b, strict=True)]
    square = sum(part * part for part in leg)
    along = sum((p - q) * part for p, q, part in zip(spot, a, leg, strict=True)) / square if square else 0.0
    share = min(max(along, 0.0), 1.0)
    return math.dist(spot, [p + share * part for p, part in zip(a, leg, strict=True)])
