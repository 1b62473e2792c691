"""The places that mission items lead to, and the circles around them. Pure."""

from __future__ import annotations

import math

from pymavlink import mavutil

from mavproxy_uavapi.core.geodesy import DEG_E7, moved, offset
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import PathPoint

mavlink = mavutil.mavlink

CORNERS = 12  # of the polygon around a circle
ON_CIRCLE = 3.0  # m beside a circle at which a copter is on it


def polygon(centre: PathPoint, radius: float) -> list[PathPoint]:
    """The corners of a polygon around a circle, the first one again at the end."""
    wide = radius / math.cos(math.pi / CORNERS)
    angles = [2 * math.pi * number / CORNERS for number in range(CORNERS + 1)]
    return [centre._replace(**on_circle(centre, wide, angle)) for angle in angles]


def place_of(item: MissionItem) -> tuple[float, float] | None:
    """The place of an item; None where it has none: ArduPilot takes 0, 0 as the present position."""
    return None if item.x == 0 and item.y == 0 else (item.x / DEG_E7, item.y / DEG_E7)


def stored_radius(radius: float) -> float:
    """A radius (m) as ArduPilot stores it in a LOITER_TURNS: a byte, of metres or of tens of them."""
    wide = abs(radius)
    return float(int(wide)) if wide <= 255 else 10.0 * min(255, int(wide / 10))


def radius_of_plane(item: MissionItem, own: float) -> float:
    if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME:
        return own
    if item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
        return stored_radius(item.params[2]) or own
    named = item.params[1 if item.command == mavlink.MAV_CMD_NAV_LOITER_TO_ALT else 2]
    return float(int(abs(named))) or own


def on_circle(centre: PathPoint, radius: float, angle: float) -> dict[str, float]:
    lat, lon = moved(centre.lat, centre.lon, radius * math.cos(angle), radius * math.sin(angle))
    return {"lat": lat, "lon": lon}


def beyond(before: PathPoint, place: PathPoint, metres: float) -> PathPoint | None:
    """The place so far behind `place`, on the way from `before`."""
    north, east = offset(before.lat, before.lon, place.lat, place.lon)
    distance = math.hypot(north, east)
    if not distance > 0:
        return None
    scale = metres / distance
    return place._replace(
        **dict(zip(("lat", "lon"), moved(place.lat, place.lon, north * scale, east * scale), strict=True))
    )


def is_near(a: PathPoint, b: PathPoint) -> bool:
    return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon)) < ON_CIRCLE
