"""The areas of an envelope as the items of an autopilot's own fence. Pure; `formats.of_fence` reads them back."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.model import Area, Envelope, EnvelopeLimits, Place
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.geodesy import to_deg_e7
from mavproxy_uavapi.core.mission.mission_files import MissionItem

mavlink = mavutil.mavlink

# By whether it is an inclusion.
CORNER = {
    True: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
}
CIRCLE = {
    True: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
}


def items_of(fence: Envelope) -> list[MissionItem]:
    """The items, in the order of the areas.

    Raises:
        Invalid: it limits more than an autopilot's fence can.
    """
    if fence.limits != EnvelopeLimits():
        raise Invalid("a fence has areas only; its height and radius are the parameters FENCE_*", "limits")
    if fence.inclusions > 1 and not fence.every:
        sentence = 'an autopilot stays inside every inclusion of its fence, not one of them; "every": true means that'
        raise Invalid(f"it has {fence.inclusions} inclusions: {sentence}", "features")
    return [item for area in fence.areas for item in _items_of(area)]


def _items_of(area: Area) -> Iterator[MissionItem]:
    if math.isfinite(area.floor) or math.isfinite(area.ceiling):
        raise Invalid(f"{area.name}: an area of a fence has no floor and no ceiling", "features")
    if area.centre is not None:
        yield _item(CIRCLE[area.inclusion], area.radius, area.centre)
        return
    if len(area.rings) > 1:
        raise Invalid(f"{area.name}: a polygon of a fence has no holes; draw them as exclusions", "features")
    for corner in area.rings[0]:
        yield _item(CORNER[area.inclusion], len(area.rings[0]), corner)


def _item(command: int, param1: float, place: Place) -> MissionItem:
    lat, lon = map(to_deg_e7, place)
    return MissionItem(command, mavlink.MAV_FRAME_GLOBAL, (float(param1), 0.0, 0.0, 0.0), lat, lon, 0.0)
