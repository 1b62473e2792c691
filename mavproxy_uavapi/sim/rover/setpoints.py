"""SET_POSITION_TARGET_LOCAL_NED and _GLOBAL_INT to GUIDED's setpoints, as Rover reads them.

As there a mask counts for a group as soon as one of its bits is set, heights mean nothing, and what is not
understood is ignored: the rover goes on with what it does.
"""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import from_deg_e7

from ..frames import GLOBAL_FRAMES, valid_location
from ..geodesy import Location, Ned, rotate_to_ne, to_ned
from ..setpoint_masks import (
    ACCELERATION_IGNORE,
    BODY_FRAMES,
    LOCAL_FRAMES,
    OFFSET_FRAMES,
    POSITION_IGNORE,
    VELOCITY_IGNORE,
    YAW_IGNORE,
    YAW_RATE_IGNORE,
)
from .rover import SimulatedRover


def apply_local(rover: SimulatedRover, message: Any) -> None:
    """SET_POSITION_TARGET_LOCAL_NED; ignored outside GUIDED and before there is an EKF origin."""
    known = message.coordinate_frame in LOCAL_FRAMES and rover.estimator.origin is not None
    if rover.mode is not rover.guided or not known or not _readable(rover, message):
        return
    if message.type_mask & POSITION_IGNORE:
        _drive(rover, message, message.coordinate_frame in BODY_FRAMES)
    elif math.isfinite(message.x) and math.isfinite(message.y):
        rover.guided.go_to(_local_position(rover, message))


def apply_global(rover: SimulatedRover, message: Any) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT; ignored outside GUIDED. Its velocity is north and east always."""
    known = message.coordinate_frame in GLOBAL_FRAMES
    if rover.mode is not rover.guided or not known or not _readable(rover, message):
        return
    if message.type_mask & POSITION_IGNORE:
        _drive(rover, message, False)
        return
    origin = rover.estimator.origin
    if origin is not None and valid_location(message.lat_int, message.lon_int, 0.0):
        place = Location(from_deg_e7(message.lat_int), from_deg_e7(message.lon_int), origin.altitude)
        rover.guided.go_to(to_ned(origin, place))


def _readable(rover: SimulatedRover, message: Any) -> bool:
    if message.type_mask & ACCELERATION_IGNORE:
        return True
    rover.say(mavlink.MAV_SEVERITY_INFO, f"Ignoring {message.get_type()}; set ACC_IGNORE in mask")
    return False


def _local_position(rover: SimulatedRover, message: Any) -> Ned:
    north, east = message.x, message.y
    here = rover.estimator.position
    if message.coordinate_frame in BODY_FRAMES:
        north, east = rotate_to_ne(north, east, rover.body.yaw)
    if message.coordinate_frame in OFFSET_FRAMES:
        return Ned(here.north + north, here.east + east, here.down)
    return Ned(north, east, here.down)


def _drive(rover: SimulatedRover, message: Any, in_body: bool) -> None:
    mask = message.type_mask
    has_velocity, has_yaw = not mask & VELOCITY_IGNORE, not mask & YAW_IGNORE
    has_rate = not mask & YAW_RATE_IGNORE
    values = [message.vx, message.vy] if has_velocity else []
    values += [message.yaw] if has_yaw else []
    values += [message.yaw_rate] if has_rate else []
    if not values or not all(map(math.isfinite, values)):
        return
    speed, heading = 0.0, 0.0
    if has_velocity:
        speed = min(math.hypot(message.vx, message.vy), rover.parameters["WP_SPEED"])
        heading = math.atan2(message.vy, message.vx)
    if has_yaw:
        heading = message.yaw
    if has_velocity and (has_yaw or has_rate) and message.vx < 0:
        speed = -speed
    if in_body:
        heading += rover.body.yaw
    if has_rate and not has_yaw:
        rover.guided.turn_at(message.yaw_rate, speed)
    elif not has_rate:
        rover.guided.drive_towards(heading, speed)
