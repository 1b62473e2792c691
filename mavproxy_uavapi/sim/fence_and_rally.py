"""Which items of a fence and of rally points ArduPilot takes, and how it stores them.

From MissionItemProtocol_Fence.cpp, MissionItemProtocol_Rally.cpp and AC_PolyFence_loader.cpp.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import DEG_E7

from .fence import CIRCLES, POLYGONS, RETURN_POINT
from .frames import AMSL_FRAMES, HOME_FRAMES, TERRAIN_FRAMES
from .mission import Item

FRAMES = (*AMSL_FRAMES, *HOME_FRAMES, *TERRAIN_FRAMES)
MOST_CORNERS = 255
HIGHEST = 32_767
"""m, either way, of a rally point."""
BYTES = {**dict.fromkeys(POLYGONS, 8), **dict.fromkeys(CIRCLES, 1 + 8 + 4), RETURN_POINT: 1 + 8}
BYTES_OF_POLYGON = 2
"""Stored before its corners."""


def refusal_of_fence(message: Any) -> int | None:
    """Why an item of a fence is not taken, a MAV_MISSION_RESULT."""
    if message.frame not in FRAMES:
        return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    if message.command in POLYGONS:
        return int(mavlink.MAV_MISSION_INVALID_PARAM1) if message.param1 > MOST_CORNERS else None
    return None if message.command in (*CIRCLES, RETURN_POINT) else int(mavlink.MAV_MISSION_UNSUPPORTED)


def refusal_of_rally(message: Any) -> int | None:
    """Why a rally point is not taken, a MAV_MISSION_RESULT."""
    if message.command != mavlink.MAV_CMD_NAV_RALLY_POINT:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    scale = DEG_E7 if message.get_type() == "MISSION_ITEM_INT" else 1.0
    if not abs(message.x) <= 90 * scale:
        return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if not abs(message.y) <= 180 * scale:
        return int(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    if not abs(message.z) <= HIGHEST:
        return int(mavlink.MAV_MISSION_INVALID_PARAM7)
    return None if message.frame in FRAMES else int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)


def as_stored(item: Item) -> Item:
    """What is kept of an item: of a rally point whole metres, of a fence no height."""
    if item.command == mavlink.MAV_CMD_NAV_RALLY_POINT:
        return Item(item.command, item.frame, 0.0, 0.0, 0.0, 0.0, item.x, item.y, float(int(item.z)))
    size = float(int(item.param1)) if item.command in POLYGONS else item.param1
    size = 0.0 if item.command == RETURN_POINT else size
    return Item(item.command, mavlink.MAV_FRAME_GLOBAL, size, 0.0, 0.0, 0.0, item.x, item.y, 0.0)


def total_of(items: Sequence[Item]) -> int:
    """What the parameter FENCE_TOTAL or RALLY_TOTAL says of a list."""
    if all(item.command == mavlink.MAV_CMD_NAV_RALLY_POINT for item in items):
        return len(items)
    count = sum(item.command != RETURN_POINT for item in items)
    return count + 2 if count >= 3 else 0


def problem_of(fence: Sequence[Item], storage: int) -> str | None:
    """What ArduPilot says of a fence that makes no sense, or is too long for its storage (bytes); None for others."""
    return next(_problems(fence, storage), None)


def _problems(fence: Sequence[Item], storage: int) -> Iterator[str]:
    missing, size = 0, 4 + 1  # corners of the polygon that has begun; bytes: the head and the end
    polygon: Item | None = None
    for item in fence:
        size += BYTES[item.command]
        if item.command in POLYGONS:
            if item.param1 < 3:
                yield f"Invalid vertex count ({item.param1:.0f})"
            if not missing:
                missing, polygon, size = int(item.param1), item, size + BYTES_OF_POLYGON
            elif polygon is not None and item.command != polygon.command:
                yield "Received incorrect vertex type"
            elif polygon is not None and item.param1 != polygon.param1:
                yield f"Unexpected vertex count want={polygon.param1:.0f} got={item.param1:.0f}"
            missing -= 1
        elif missing:
            yield "Received incorrect type"
        elif item.command in CIRCLES and not item.param1 > 0:
            yield "Non-positive circle radius"
        if not (abs(item.x) <= 90e7 and abs(item.y) <= 180e7):
            yield "Bad lat or lon"
    if missing:
        yield "Incorrect item count"
    if sum(item.command == RETURN_POINT for item in fence) > 1:
        yield "Multiple return points"
    if size > storage:
        yield "Fence exceeds storage size"
