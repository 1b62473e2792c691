"""Where the vehicle is and how it moves, as MAVLink messages."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import to_deg_e7

from .geodesy import from_ned
from .message_source import MessageSource
from .physics import GRAVITY
from .setpoint_masks import ONLY_POSITION

UNUSED_MASK_BITS = 0xF000
"""ArduPilot sets them in POSITION_TARGET_GLOBAL_INT."""
UNKNOWN_QUATERNION = [math.nan] * 4


class MotionMessages(MessageSource):
    """Position, attitude and targets. Positions are the estimate, SIMSTATE and SIM_STATE are the truth."""

    def _heading(self) -> float:
        return math.degrees(self.vehicle.body.yaw) % 360

    def _build_gps_raw_int(self) -> Any:
        estimator = self.vehicle.estimator
        time, _, velocity, place = self._position()
        fix = estimator.has_fix
        speed = math.hypot(velocity.north, velocity.east)
        course = math.degrees(math.atan2(velocity.east, velocity.north)) % 360
        return mavlink.MAVLink_gps_raw_int_message(
            int(time * 1e6),
            mavlink.GPS_FIX_TYPE_RTK_FIXED if fix else mavlink.GPS_FIX_TYPE_NO_GPS,
            to_deg_e7(place.latitude) if fix else 0,
            to_deg_e7(place.longitude) if fix else 0,
            round(place.altitude * 1000) if fix else 0,
            121 if fix else 9999,
            200 if fix else 9999,
            round(speed * 100),
            round(course * 100) % 36000,
            10 if fix else 0,
            round(place.altitude * 1000) if fix else 0,
            300,
            300,
            40,
            0,
            0,
        )

    def _build_nav_controller_output(self) -> Any | None:
        navigation = self.vehicle.navigation()
        if navigation is None:
            return None
        return mavlink.MAVLink_nav_controller_output_message(
            navigation.roll,
            navigation.pitch,
            round(navigation.nav_bearing),
            round(navigation.target_bearing),
            min(round(navigation.distance), 65535),
            navigation.altitude_error,
            navigation.speed_error,
            navigation.crosstrack,
        )

    def _build_position_target_global_int(self) -> Any | None:
        vehicle = self.vehicle
        target, origin = vehicle.mode.target, vehicle.estimator.origin
        if target is None or origin is None:
            return None
        place = from_ned(origin, target)
        if abs(place.latitude) > 90:
            return None
        return mavlink.MAVLink_position_target_global_int_message(
            self._milliseconds(),
            mavlink.MAV_FRAME_GLOBAL,
            UNUSED_MASK_BITS | ONLY_POSITION,
            to_deg_e7(place.latitude),
            to_deg_e7(place.longitude),
            place.altitude,
            *([0.0] * 8),
        )

    def _build_position_target_local_ned(self) -> Any | None:
        target = self.vehicle.local_target()
        if target is None:
            return None
        return mavlink.MAVLink_position_target_local_ned_message(
            self._milliseconds(),
            mavlink.MAV_FRAME_LOCAL_NED,
            target.mask,
            *target.position,
            *target.velocity,
            *target.acceleration,
            0.0,
            0.0,
        )

    def _build_global_position_int(self) -> Any | None:
        vehicle = self.vehicle
        if vehicle.estimator.origin is None:
            return None
        _, _, velocity, place = self._position()
        return mavlink.MAVLink_global_position_int_message(
            self._milliseconds(),
            to_deg_e7(place.latitude),
            to_deg_e7(place.longitude),
            round(place.altitude * 1000),
            round((place.altitude - vehicle.home_altitude) * 1000),
            round(velocity.north * 100),
            round(velocity.east * 100),
            round(velocity.down * 100),
            round(self._heading() * 100) % 36000,
        )

    def _build_local_position_ned(self) -> Any | None:
        if self.vehicle.estimator.origin is None:
            return None
        _, position, velocity, _ = self._position()
        return mavlink.MAVLink_local_position_ned_message(self._milliseconds(), *position, *velocity)

    def _build_attitude(self) -> Any:
        body = self.vehicle.body
        return mavlink.MAVLink_attitude_message(
            self._milliseconds(),
            body.roll,
            body.pitch,
            body.yaw,
            body.roll_rate,
            body.pitch_rate,
            body.yaw_rate,
        )

    def _build_simstate(self) -> Any:
        vehicle = self.vehicle
        body = vehicle.body
        place = from_ned(vehicle.estimator.start, body.position)
        return mavlink.MAVLink_simstate_message(
            body.roll,
            body.pitch,
            body.yaw,
            body.thrust_north,
            body.thrust_east,
            body.thrust_down - GRAVITY,
            body.roll_rate,
            body.pitch_rate,
            body.yaw_rate,
            to_deg_e7(place.latitude),
            to_deg_e7(place.longitude),
        )

    def _build_vfr_hud(self) -> Any:
        vehicle = self.vehicle
        _, _, velocity, place = self._position()
        ground_speed = math.hypot(velocity.north, velocity.east)
        return mavlink.MAVLink_vfr_hud_message(
            vehicle.airspeed,
            ground_speed,
            int(self._heading()),
            vehicle.throttle_percent,
            place.altitude,
            -velocity.down,
        )

    def _build_ahrs(self) -> Any:
        return mavlink.MAVLink_ahrs_message(0.0, 0.0, 0.0, 0.0, 0.0, 0.001, 0.001)

    def _build_raw_imu(self) -> Any:
        body = self.vehicle.body
        rates = (body.roll_rate, body.pitch_rate, body.yaw_rate)
        return mavlink.MAVLink_raw_imu_message(
            self._microseconds(),
            0,
            0,
            -1000,
            *(max(-32768, min(32767, round(rate * 1000))) for rate in rates),
            231,
            104,
            -533,
        )

    def _build_scaled_pressure(self) -> Any:
        altitude = self.vehicle.estimator.location.altitude
        pressure = 1013.25 * max(1 - 2.25577e-5 * altitude, 0.01) ** 5.25588
        return mavlink.MAVLink_scaled_pressure_message(self._milliseconds(), pressure, 0.0, 2500)

    def _build_home_position(self) -> Any | None:
        home = self.vehicle.home
        if home is None:
            return None
        return mavlink.MAVLink_home_position_message(
            to_deg_e7(home.latitude),
            to_deg_e7(home.longitude),
            round(home.altitude * 1000),
            *self.vehicle.home_offset,
            UNKNOWN_QUATERNION,
            0.0,
            0.0,
            0.0,
            self._microseconds(),
        )

    def _build_gps_global_origin(self) -> Any | None:
        origin = self.vehicle.estimator.origin
        if origin is None:
            return None
        return mavlink.MAVLink_gps_global_origin_message(
            to_deg_e7(origin.latitude),
            to_deg_e7(origin.longitude),
            round(origin.altitude * 1000),
            self._microseconds(),
        )

    def _build_wind(self) -> Any:
        body = self.vehicle.body
        speed = math.hypot(body.wind_north, body.wind_east)
        direction = math.degrees(math.atan2(-body.wind_east, -body.wind_north)) if speed > 0 else 180.0
        return mavlink.MAVLink_wind_message(direction, speed, 0.0)

    def _build_sim_state(self) -> Any:
        """The true state, which SITL sends on request: for simulated cameras."""
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
