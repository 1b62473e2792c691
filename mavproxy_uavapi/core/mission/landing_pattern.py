"""A plane's landing as a mission. Pure.

It has no DO_LAND_START: after that item ArduPlane does not arm again, unless RTL_AUTOLAND allows it.
"""

from __future__ import annotations

import math

from pymavlink import mavutil

from mavproxy_uavapi.core.geodesy import moved, offset, to_deg_e7
from mavproxy_uavapi.core.link.messages import GlobalTarget
from mavproxy_uavapi.core.mission.mission_files import MissionItem

mavlink = mavutil.mavlink

APPROACH = 400.0  # m before the landing place at which the descent begins
APPROACH_HEIGHT = 40.0  # m above that place: a slope of 10 %, as ArduPilot's documentation advises
NEAR = 50.0  # m; below this distance the direction of the approach does not matter


def pattern(place: GlobalTarget, here: tuple[float, float], *, vtol: bool) -> list[MissionItem]:
    """A landing at `place`: straight in from `here`, or from the north if that is too near.

    Args:
        place: the touchdown; m above home.
        here: the vehicle's latitude and longitude, degrees.
        vtol: whether it lands vertically.
    """
    if vtol:
        return [_item(mavlink.MAV_CMD_NAV_VTOL_LAND, place)]
    north, east = offset(place.lat, place.lon, *here)
    distance = math.hypot(north, east)
    if distance < NEAR:
        north, east, distance = 1.0, 0.0, 1.0
    scale = APPROACH / distance
    approach = GlobalTarget(*moved(place.lat, place.lon, north * scale, east * scale), place.alt + APPROACH_HEIGHT)
    return [
        _item(mavlink.MAV_CMD_NAV_LOITER_TO_ALT, approach),
        _item(mavlink.MAV_CMD_NAV_LAND, place),
    ]


def _item(command: int, place: GlobalTarget) -> MissionItem:
    lat, lon, frame = to_deg_e7(place.lat), to_deg_e7(place.lon), mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return MissionItem(command, frame, (0.0, 0.0, 0.0, 0.0), lat, lon, place.alt)
