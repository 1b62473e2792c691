"""SET_POSITION_TARGET_LOCAL_NED and _GLOBAL_INT to GUIDED's setpoints, as ArduCopter reads them.

A mask counts for a group of three: as soon as one axis of position, velocity or acceleration is ignored,
the whole group is. A setpoint that cannot be used stops the vehicle.
"""

from __future__ import annotations

import math
from typing import Any

from ..frames import TERRAIN_FRAMES, global_target
from ..geodesy import Ned, rotate_to_ne
from ..setpoint_masks import (
    ACCELERATION_IGNORE,
    BODY_FRAMES,
    FORCE,
    LOCAL_FRAMES,
    OFFSET_FRAMES,
    POSITION_IGNORE,
    VELOCITY_IGNORE,
    YAW_IGNORE,
    YAW_RATE_IGNORE,
)
from .copter import SimulatedCopter
from .modes.guided import ZERO, YawSetpoint

HIGHEST_SPEED = 1000.0
"""m/s; a faster velocity cannot be used."""


class InvalidSetpoint(Exception):
    """A setpoint that ArduCopter answers by stopping."""


def apply_local(copter: SimulatedCopter, message: Any) -> None:
    """SET_POSITION_TARGET_LOCAL_NED; ignored outside GUIDED."""
    _apply(copter, message, _local_position, message.coordinate_frame in LOCAL_FRAMES)


def apply_global(copter: SimulatedCopter, message: Any) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT; ignored outside GUIDED."""
    _apply(copter, message, _global_position, True)


def _apply(copter: SimulatedCopter, message: Any, read_position: Any, frame_known: bool) -> None:
    guided = copter.guided
    if copter.mode is not guided:
        return
    try:
        if not frame_known:
            raise InvalidSetpoint
        _dispatch(copter, message, read_position)
    except InvalidSetpoint:
        guided.stop()


def _dispatch(copter: SimulatedCopter, message: Any, read_position: Any) -> None:
    guided, mask = copter.guided, message.type_mask
    if mask & FORCE and not mask & ACCELERATION_IGNORE:
        raise InvalidSetpoint
    position = None if mask & POSITION_IGNORE else read_position(copter, message)
    velocity = None if mask & VELOCITY_IGNORE else _velocity(copter, message)
    acceleration = None if mask & ACCELERATION_IGNORE else _acceleration(copter, message)
    yaw = _yaw(message)
    if position is not None and velocity is not None:
        if message.coordinate_frame in TERRAIN_FRAMES:
            raise InvalidSetpoint
        guided.track(position, velocity, acceleration or ZERO, yaw)
    elif velocity is not None:
        guided.fly_at(velocity, acceleration or ZERO, yaw)
    elif position is not None and acceleration is None:
        guided.go_to(position, yaw)
    elif position is None and acceleration is not None:
        guided.accelerate_at(acceleration, yaw)
    else:
        # Nothing but yaw, or a position with an acceleration only.
        raise InvalidSetpoint


def _local_position(copter: SimulatedCopter, message: Any) -> Ned:
    north, east, down = message.x, message.y, message.z
    if not all(map(math.isfinite, (north, east, down))):
        raise InvalidSetpoint
    if message.coordinate_frame in BODY_FRAMES:
        north, east = rotate_to_ne(north, east, copter.body.yaw)
    if message.coordinate_frame in OFFSET_FRAMES:
        if not copter.estimator.ready:
            raise InvalidSetpoint
        here = copter.estimator.position
        return Ned(here.north + north, here.east + east, here.down + down)
    return Ned(north, east, down)


def _global_position(copter: SimulatedCopter, message: Any) -> Ned:
    if abs(message.lat_int) > 900000000 or abs(message.lon_int) > 1800000000 or not math.isfinite(message.alt):
        raise InvalidSetpoint
    target = global_target(copter, message.coordinate_frame, message.lat_int, message.lon_int, message.alt)
    if target is None:
        raise InvalidSetpoint
    return target


def _velocity(copter: SimulatedCopter, message: Any) -> Ned:
    velocity = (message.vx, message.vy, message.vz)
    if not all(math.isfinite(part) and abs(part) <= HIGHEST_SPEED for part in velocity):
        raise InvalidSetpoint
    return _rotated(copter, message, velocity)


def _acceleration(copter: SimulatedCopter, message: Any) -> Ned:
    acceleration = (message.afx, message.afy, message.afz)
    if not all(map(math.isfinite, acceleration)):
        raise InvalidSetpoint
    return _rotated(copter, message, acceleration)


def _rotated(copter: SimulatedCopter, message: Any, vector: tuple[float, float, float]) -> Ned:
    """In the body frames of a local setpoint x is forward and y right."""
    local = message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    if local and message.coordinate_frame in BODY_FRAMES:
        return Ned(*rotate_to_ne(vector[0], vector[1], copter.body.yaw), vector[2])
    return Ned(*vector)


def _yaw(message: Any) -> YawSetpoint:
    yaw = None if message.type_mask & YAW_IGNORE else message.yaw
    rate = None if message.type_mask & YAW_RATE_IGNORE else message.yaw_rate
    if not all(value is None or math.isfinite(value) for value in (yaw, rate)):
        raise InvalidSetpoint
    local = message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    return YawSetpoint(yaw, rate, local and message.coordinate_frame in BODY_FRAMES)
