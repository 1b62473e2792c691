"""Velocity setpoints. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.link.messages import VelocityTarget, Yaw
from mavproxy_vision.geometry.frames import Vector, heading_frame, vector

mavlink = mavutil.mavlink


@dataclass(frozen=True)
class HeadedVelocity(VelocityTarget):
    """A velocity setpoint, m/s NED, sent in BODY_NED, because an observed offset turns with the vehicle.

    Attributes:
        heading: the vehicle's heading, rad.
    """

    heading: float

    def to(self, address: Address, yaw: Yaw) -> Any:
        """SET_POSITION_TARGET_LOCAL_NED to `address`."""
        message = super().to(address, yaw)
        message.coordinate_frame = mavlink.MAV_FRAME_BODY_NED
        message.vx, message.vy, message.vz = heading_frame(vector(self.vx, self.vy, self.vz), self.heading)
        return message


def setpoint(velocity: Vector, heading: float | None) -> VelocityTarget:
    """A velocity (m/s NED), in BODY_NED if the heading (rad) is known."""
    x, y, z = (float(part) for part in velocity)
    return VelocityTarget(x, y, z) if heading is None else HeadedVelocity(x, y, z, heading)
