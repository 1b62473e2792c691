"""Geofences: polygons from KML files, and geometry for them. Points are `{"lat": degrees, "lon": degrees}`."""

# ruff: noqa: PLR0917 - the signatures are aerpawlib's

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from mavproxy_uavapi.core.airspace import kml
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.file_text import bytes_of, text_of, unpacked

Point = dict[str, float]
LARGEST = 4 * 1024 * 1024  # bytes


def read_geofence(file_path: str) -> list[Point]:
    """The outer boundary of the first polygon of a KML file.

    Raises:
        ValueError: the file has none.
    """
    try:
        data = unpacked(bytes_of(Path(file_path), LARGEST), file_path, LARGEST)
        polygons = kml.polygons(text_of(data, file_path))
    except UavApiError as error:
        raise ValueError(f"{file_path}: {error}") from error
    if not polygons:
        raise ValueError(f"{file_path} has no polygon")
    return [{"lon": lon, "lat": lat} for lat, lon in polygons[0].rings[0]]


def inside(lon: float, lat: float, geofence: Sequence[Point]) -> bool:
    """Whether a point is in a polygon: a ray from it to the east crosses an odd number of its sides."""
    is_inside = False
    for a, b in polygon_edges(geofence):
        if (a["lat"] > lat) != (b["lat"] > lat):
            crossing = a["lon"] + (b["lon"] - a["lon"]) * (lat - a["lat"]) / (b["lat"] - a["lat"])
            is_inside ^= lon < crossing
    return is_inside


def polygon_edges(polygon: Sequence[Point]) -> Iterator[tuple[Point, Point]]:
    """Its sides, each as two points; the last one leads back to the first point."""
    return zip(polygon, [*polygon[1:], *polygon[:1]], strict=True)


def lies_on_segment(px: float, py: float, qx: float, qy: float, rx: float, ry: float) -> bool:
    """Whether q is between p and r; q must be on the line through them."""
    return min(px, rx) <= qx <= max(px, rx) and min(py, ry) <= qy <= max(py, ry)


def orientation(px: float, py: float, qx: float, qy: float, rx: float, ry: float) -> int:
    """The turn at q on the way from p to r: 0 none, 1 clockwise, 2 counterclockwise."""
    turn = (qy - py) * (rx - qx) - (qx - px) * (ry - qy)
    return 0 if turn == 0 else 1 if turn > 0 else 2


def do_intersect(px: float, py: float, qx: float, qy: float, rx: float, ry: float, sx: float, sy: float) -> bool:
    """Whether the segments pq and rs have a point in common."""
    turns = (
        orientation(px, py, qx, qy, rx, ry),
        orientation(px, py, qx, qy, sx, sy),
        orientation(rx, ry, sx, sy, px, py),
        orientation(rx, ry, sx, sy, qx, qy),
    )
    if turns[0] != turns[1] and turns[2] != turns[3]:
        return True
    touching = (
        lies_on_segment(px, py, rx, ry, qx, qy),
        lies_on_segment(px, py, sx, sy, qx, qy),
        lies_on_segment(rx, ry, px, py, sx, sy),
        lies_on_segment(rx, ry, qx, qy, sx, sy),
    )
    return any(turn == 0 and touches for turn, touches in zip(turns, touching, strict=True))


readGeofence, liesOnSegment, doIntersect = read_geofence, lies_on_segment, do_intersect
