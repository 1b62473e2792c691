"""SIM_STATE: the true state of the vehicle, which SITL sends on request. For simulated cameras."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import to_deg_e7

from .geodesy import from_ned
from .message_source import MessageSource


class TruthMessages(MessageSource):
    """The true state, which no real vehicle knows."""

    def _build_sim_state(self) -> Any:
        vehicle = self.vehicle
        body = vehicle.body
        place = from_ned(vehicle.estimator.start, body.position)
        lat, lon = to_deg_e7(place.latitude), to_deg_e7(place.longitude)
        return mavlink.MAVLink_sim_state_message(
            *_quaternion(body.roll, body.pitch, body.yaw),
            body.roll,
            body.pitch,
            body.yaw,
            0.0,
            0.0,
            -9.80665,
            body.roll_rate,
            body.pitch_rate,
            body.yaw_rate,
            lat,
            lon,
            place.altitude,
            0.0,
            0.0,
            body.velocity_north,
            body.velocity_east,
            body.velocity_down,
            lat,
            lon,
        )


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
