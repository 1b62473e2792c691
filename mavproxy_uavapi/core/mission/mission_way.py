"""The ways that a mission leads along, as places. Pure.

Between two places an autopilot flies straight. Items that it flies otherwise (splines, scripts, follow me) cannot be
checked; the error names them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.geodesy import moved
from mavproxy_uavapi.core.mission.mission_files import DEGREES, MissionItem

mavlink = mavutil.mavlink

LAST_NAV = mavlink.MAV_CMD_NAV_LAST  # commands below it fly the vehicle; of those above only what is called NAV_…
STRAIGHT = {
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_VTOL_TAKEOFF,
    mavlink.MAV_CMD_NAV_PAYLOAD_PLACE,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_LOITER_TURNS,
    mavlink.MAV_CMD_NAV_LOITER_TO_ALT,
}
LANDINGS = {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_DO_LAND_START}
CLIMBS = {mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF}
ON_THE_SPOT = {mavlink.MAV_CMD_NAV_DELAY}
HOMEWARD = {mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}  # never refused, as `rtl`
REFUSED = {mavlink.MAV_CMD_DO_SET_HOME, mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_GUIDED_LIMITS}
AMSL = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
TERRAIN = (mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT)
CORNERS = 12  # of the polygon around a circle


class Stop(NamedTuple):
    """A place on a way: latitude and longitude in degrees, and m above home."""

    lat: float
    lon: float
    up: float


@dataclass(frozen=True)
class Setting:
    """What a mission is flown with.

    Attributes:
        start: where it begins; None where that is not known yet, as before an upload.
        home_amsl: m; None where it is not known.
        radius: m, of circles whose item has no radius; 0 for a vehicle that stands still there.
        heights_matter: whether the check fails if a height is not known.
    """

    start: Stop | None
    home_amsl: float | None
    radius: float
    heights_matter: bool


def ways(items: Sequence[MissionItem], setting: Setting) -> Iterator[list[Stop]]:
    """The straight ways, each with the points in their order.

    Raises:
        OutsideEnvelope: the target of an item is not known.
    """
    places = [_place(seq, item, setting) for seq, item in enumerate(items, 1)]
    here = setting.start
    for seq, item in enumerate(items, 1):
        place = places[seq - 1]
        if item.command == mavlink.MAV_CMD_DO_JUMP:
            target = int(item.params[0])
            jumped_to = next((stop for stop in places[max(target, 1) - 1 :] if stop is not None), None)
            if here is not None and jumped_to is not None:
                yield [here, jumped_to._replace(up=_height(jumped_to, here))]
        if place is None:
            continue
        if here is None and math.isnan(place.lat):
            continue  # from wherever it will stand
        place = _completed(place, here)
        if here is not None:
            is_climb = item.command in CLIMBS
            above = Stop(here.lat, here.lon, place.up)
            yield [here, above, place] if is_climb else [here, place]
        else:
            yield [place]
        radius = _radius(item, setting)
        if radius:
            yield _circle(place, radius)
        here = place


def landing_items(items: Sequence[MissionItem]) -> frozenset[int]:
    """The numbers of the items that land or return the vehicle: landings, and all from DO_LAND_START on."""
    numbered = [(seq, item.command) for seq, item in enumerate(items, 1)]
    begins = min((seq for seq, command in numbered if command == mavlink.MAV_CMD_DO_LAND_START), default=math.inf)
    return frozenset(seq for seq, command in numbered if seq >= begins or command in LANDINGS | HOMEWARD)


def _place(seq: int, item: MissionItem, setting: Setting) -> Stop | None:
    """Where an item leads, NaN for values that do not change; None for an item that moves nothing."""
    command = item.command
    if command in REFUSED or (_may_fly(item) and command not in STRAIGHT | LANDINGS | ON_THE_SPOT | HOMEWARD):
        raise OutsideEnvelope(f"mission item {seq} ({item.name}): nobody can say whether it stays in the envelope")
    if command not in STRAIGHT | LANDINGS:
        return None
    nowhere = item.x == 0 and item.y == 0  # ArduPilot takes 0, 0 as the present position
    lat, lon = (math.nan, math.nan) if nowhere else (item.x / DEGREES, item.y / DEGREES)
    if command in LANDINGS:
        return None if nowhere else Stop(lat, lon, math.nan)
    if item.frame in TERRAIN and setting.heights_matter:
        raise OutsideEnvelope(f"mission item {seq} ({item.name}): its height is above the terrain, not above home")
    if item.frame in TERRAIN:
        return Stop(lat, lon, 0.0)
    if item.frame in AMSL and setting.home_amsl is None and setting.heights_matter:
        raise OutsideEnvelope(f"mission item {seq} ({item.name}): its height is AMSL, and that of home is not known")
    keeps_height = item.z == 0 and command not in CLIMBS and item.frame not in AMSL
    up = math.nan if keeps_height else item.z - (setting.home_amsl or 0.0 if item.frame in AMSL else 0.0)
    return Stop(lat, lon, up)


def _may_fly(item: MissionItem) -> bool:
    """Whether the command flies the vehicle, or is unknown."""
    return item.command < LAST_NAV or item.name.startswith("NAV_") or item.name.isdecimal()


def _completed(place: Stop, here: Stop | None) -> Stop:
    """The place, with the values that do not change filled in."""
    if here is None:
        return Stop(place.lat, place.lon, 0.0) if math.isnan(place.up) else place
    lat, lon = (here.lat, here.lon) if math.isnan(place.lat) else (place.lat, place.lon)
    return Stop(lat, lon, _height(place, here))


def _height(place: Stop, here: Stop) -> float:
    return here.up if math.isnan(place.up) else place.up


def _radius(item: MissionItem, setting: Setting) -> float:
    """The radius (m) of the circles of an item; 0 for none."""
    circles = item.name.startswith("NAV_LOITER")
    if item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS or (circles and setting.radius):
        named = abs(item.params[1 if item.command == mavlink.MAV_CMD_NAV_LOITER_TO_ALT else 2])
        return named or setting.radius or 10.0
    return 0.0


def _circle(centre: Stop, radius: float) -> list[Stop]:
    """A polygon around the circle."""
    wide = radius / math.cos(math.pi / CORNERS)
    angles = [2 * math.pi * number / CORNERS for number in range(CORNERS + 1)]
    places = [moved(centre.lat, centre.lon, wide * math.cos(angle), wide * math.sin(angle)) for angle in angles]
    return [Stop(lat, lon, centre.up) for lat, lon in places]
