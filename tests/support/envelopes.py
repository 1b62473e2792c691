"""Envelopes for tests, in metres from where the simulator stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot
from tests.support.world import PLACE

METRES = LocalFrame(PLACE)


def place(north: float, east: float) -> tuple[float, float]:
    """Latitude and longitude so many metres north and east of the simulator's home."""
    return METRES.degrees(Spot(north, east, 0.0))


def feature(
    name: str, corners: Sequence[tuple[float, float]], kind: str = "inclusion", **properties: Any
) -> dict[str, Any]:
    """A polygon as GeoJSON."""
    ring = [list(place(*corner)[::-1]) for corner in (*corners, corners[0])]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {"type": "Feature", "properties": {"kind": kind, "name": name, **properties}, "geometry": geometry}


def square(half: float, north: float = 0.0, east: float = 0.0) -> list[tuple[float, float]]:
    """The corners of a square."""
    return [(north + n * half, east + e * half) for n, e in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def field(half: float, mast_north: float, **limits: float) -> dict[str, Any]:
    """A square field with a mast north of home."""
    features = [
        feature("field", square(half), ceiling=60),
        feature("mast", square(10, mast_north), "exclusion", ceiling=40),
    ]
    return {"type": "FeatureCollection", "features": features, "limits": limits}


FIELD = field(100, 50, speed=12, climb=4)
