"""SET_POSITION_TARGET_… as ArduPlane reads them in GUIDED: heights, and no positions."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..frames import AMSL_FRAMES, GLOBAL_FRAMES
from .plane import SimulatedPlane

Z_IGNORE: int = mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE


def apply_local(plane: SimulatedPlane, message: Any) -> None:
    """SET_POSITION_TARGET_LOCAL_NED: in MAV_FRAME_LOCAL_OFFSET_NED z changes the height of the target, down."""
    offset = message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_OFFSET_NED
    if plane.mode is not plane.guided or not offset or not math.isfinite(message.z):
        return
    down = plane.navigator.target.down + message.z
    plane.navigator.change_altitude(down)
    plane.say(mavlink.MAV_SEVERITY_INFO, f"Change alt to {plane.home_offset.down - down:.1f}")


def apply_global(plane: SimulatedPlane, message: Any) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT: the height is that of the target, unless the mask ignores it."""
    if plane.mode is not plane.guided:
        return
    if message.coordinate_frame not in GLOBAL_FRAMES:
        text = "Invalid coord frame in SET_POSTION_TARGET_GLOBAL_INT"
        plane.say(mavlink.MAV_SEVERITY_WARNING, text)
        return
    origin = plane.estimator.origin
    if message.type_mask & Z_IGNORE or origin is None or not math.isfinite(message.alt):
        return
    amsl = message.alt if message.coordinate_frame in AMSL_FRAMES else message.alt + plane.home_altitude
    plane.navigator.change_altitude(origin.altitude - amsl)
