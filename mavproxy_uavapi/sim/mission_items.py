"""MISSION_ITEM and MISSION_ITEM_INT to items and back, and which of them ArduPilot refuses.

MISSION_ITEM has a location in degrees, MISSION_ITEM_INT in 1e-7 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import DEG_E7

from .frames import AMSL_FRAMES, HIGHEST_ALTITUDE, HOME_FRAMES, TERRAIN_FRAMES
from .mavlink_names import commands, named
from .mission import LOCATED, Item

STORED_FRAMES = (
    # As in ArduPilot an item keeps one frame of each kind, and the mission frame means AMSL.
    dict.fromkeys((*AMSL_FRAMES, mavlink.MAV_FRAME_MISSION), mavlink.MAV_FRAME_GLOBAL)
    | dict.fromkeys(HOME_FRAMES, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT)
    | dict.fromkeys(TERRAIN_FRAMES, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT)
)
YAW_NOT_GIVEN = commands("NAV_WAYPOINT NAV_LOITER_UNLIM NAV_LAND NAV_TAKEOFF NAV_VTOL_TAKEOFF NAV_VTOL_LAND")
"""Commands whose param4 may be NaN."""
RADIUS_NOT_GIVEN = (mavlink.MAV_CMD_NAV_VTOL_LAND,)
"""Commands whose param3 may be NaN."""
INVALID_PARAMETERS = named("MAV_MISSION_INVALID_", "PARAM1 PARAM2 PARAM3 PARAM4")


def unreadable(message: Any) -> int | None:
    """The MAV_MISSION_RESULT for a MISSION_ITEM whose degrees are none; None for all other messages.

    It comes before anything else is looked at, and leaves an upload as it is.
    """
    if message.get_type() != "MISSION_ITEM" or message.command not in LOCATED:
        return None
    return _misplaced(message, 1.0)


def refusal(message: Any, commands: Collection[int]) -> int | None:
    """Why an item of a mission cannot be taken, a MAV_MISSION_RESULT; commands are those that the vehicle knows."""
    for number, value in enumerate(_parameters(message), start=1):
        if math.isinf(value) or (math.isnan(value) and not _may_be_nan(message.command, number)):
            return INVALID_PARAMETERS[number - 1]
    if message.command not in commands:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    if message.command not in LOCATED:
        return None
    misplaced = _misplaced(message, 1.0 if message.get_type() == "MISSION_ITEM" else DEG_E7)
    if misplaced is not None:
        return misplaced
    if not abs(message.z) < HIGHEST_ALTITUDE:
        return int(mavlink.MAV_MISSION_INVALID_PARAM7)
    return None if message.frame in STORED_FRAMES else int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)


def as_item(message: Any) -> Item:
    """The item of a message that is not refused; NaN, "not given", reads as 0."""
    located = message.command in LOCATED
    scale = 10_000_000 if located and message.get_type() == "MISSION_ITEM" else 1
    frame = STORED_FRAMES.get(message.frame, message.frame) if located else message.frame
    param1, param2, param3, param4 = map(_finite, _parameters(message))
    x, y = (round(_finite(value) * scale) for value in (message.x, message.y))
    return Item(message.command, frame, param1, param2, param3, param4, x, y, _finite(message.z))


def as_message(item: Item, request: Any) -> Any:
    """The answer to a MISSION_REQUEST_INT or MISSION_REQUEST."""
    sender = request.get_srcSystem(), request.get_srcComponent()
    is_mission = request.mission_type == mavlink.MAV_MISSION_TYPE_MISSION
    head = (*sender, request.seq, item.frame, item.command, int(is_mission and request.seq == 0), int(is_mission))
    parameters = (item.param1, item.param2, item.param3, item.param4)
    if request.get_type() == "MISSION_REQUEST_INT":
        return mavlink.MAVLink_mission_item_int_message(
            *head, *parameters, item.x, item.y, item.z, request.mission_type
        )
    scale = DEG_E7 if item.command in LOCATED else 1.0
    return mavlink.MAVLink_mission_item_message(
        *head, *parameters, item.x / scale, item.y / scale, item.z, request.mission_type
    )


def _parameters(message: Any) -> tuple[float, float, float, float]:
    return message.param1, message.param2, message.param3, message.param4


def _may_be_nan(command: int, number: int) -> bool:
    if number == 3:
        return command in RADIUS_NOT_GIVEN
    return number == 4 and command in YAW_NOT_GIVEN


def _misplaced(message: Any, scale: float) -> int | None:
    # NaN must fail too.
    if not abs(message.x) <= 90 * scale:
        return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if not abs(message.y) <= 180 * scale:
        return int(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    return None


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0
