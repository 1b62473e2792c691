"""Velocity setpoints. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymavlink import mavutil

from mavproxy_uavapi.host.link import Address
from mavproxy_vision.geometry import Vector, heading_frame

mavlink = mavutil.mavlink

VELOCITY_ONLY = 3527  # SET_POSITION_TARGET_LOCAL_NED: velocity alone, the heading as it is


def setpoint(address: Address, velocity: Vector, yaw: float | None) -> Any:
    """SET_POSITION_TARGET_LOCAL_NED with a velocity (m/s NED), in BODY_NED where the heading (rad) is known.

    Raises:
        ValueError: the velocity or the heading is not finite.
    """
    if not np.isfinite([*velocity, yaw or 0.0]).all():
        raise ValueError(f"no velocity: {velocity}, heading {yaw}")
    if yaw is None:
        frame, (x, y, z) = mavlink.MAV_FRAME_LOCAL_NED, (float(part) for part in velocity)
    else:
        frame, (x, y, z) = mavlink.MAV_FRAME_BODY_NED, heading_frame(velocity, yaw)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, *address, frame, VELOCITY_ONLY, 0.0, 0.0, 0.0, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0
    )
