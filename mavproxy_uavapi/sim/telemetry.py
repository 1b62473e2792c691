"""The vehicle's state as MAVLink messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from . import arming
from .copter import Copter
from .geodesy import Location, Ned, from_ned
from .mission import MAVLINK_STATE
from .physics import GRAVITY

SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | mavlink.MAV_SYS_STATUS_SENSOR_YAW_POSITION
    | mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
"""Without FTP: MAVProxy then loads the parameters one by one, at once."""
FIRMWARE_VERSION = (4 << 24) | (6 << 16) | (0 << 8) | mavlink.FIRMWARE_VERSION_TYPE_OFFICIAL
IGNORE_ALL_BUT_POSITION = 0x0FF8
IGNORE_ALL_BUT_VELOCITY = 0x0C07
UNKNOWN_QUATERNION = [math.nan] * 4
HOVER_THROTTLE = 0.39
GPS_EPOCH = 315964800
"""1980-01-06 in unix seconds; before it a clock has never been set."""


class Telemetry:
    """Builds messages by name; None where ArduCopter would not send one either.

    unix_epoch is the unix time in seconds at which the vehicle booted.
    """

    def __init__(self, copter: Copter, unix_epoch: float) -> None:
        self.copter = copter
        self.unix_epoch = unix_epoch
        self._frozen: tuple[float, Ned, Ned, Location] | None = None
        self._builders: dict[str, Callable[[], Any]] = {
            name.removeprefix("_build_").upper(): getattr(self, name)
            for name in dir(self)
            if name.startswith("_build_")
        }

    def knows(self, name: str) -> bool:
        """Whether the vehicle can send this message at all."""
        return name in self._builders

    def build(self, name: str) -> Any | None:
        """The message for the present state; KeyError for one that the vehicle does not know."""
        return self._builders[name]()

    def freeze_position(self, frozen: bool) -> None:
        """Keep reporting the present position and fix time, as a GPS that has hung does."""
        if not frozen:
            self._frozen = None
        elif self._frozen is None:
            copter = self.copter
            estimator = copter.estimator
            self._frozen = (copter.now, estimator.position, estimator.velocity, estimator.location)

    def _milliseconds(self) -> int:
        return int(self.copter.now * 1000 + 0.5) & 0xFFFFFFFF

    def _microseconds(self) -> int:
        return int(self.copter.now * 1e6 + 0.5)

    def _position(self) -> tuple[float, Ned, Ned, Location]:
        """Time, position, velocity and location as they are to be reported."""
        if self._frozen is not None:
            return self._frozen
        estimator = self.copter.estimator
        return self.copter.now, estimator.position, estimator.velocity, estimator.location

    def _heading(self) -> float:
        return math.degrees(self.copter.body.yaw) % 360

    def _build_heartbeat(self) -> Any:
        copter = self.copter
        base = mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        base |= mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED if copter.mode.positions else 0
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if copter.armed else 0
        if copter.failsafe:
            status = mavlink.MAV_STATE_CRITICAL
        else:
            status = mavlink.MAV_STATE_STANDBY if copter.landed else mavlink.MAV_STATE_ACTIVE
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            base,
            copter.mode.number,
            status,
            3,
        )

    def _build_sys_status(self) -> Any:
        copter = self.copter
        battery = copter.battery
        health = SENSORS
        if arming.prearm_failures(copter):
            health &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
        if not copter.estimator.aligned:
            health &= ~mavlink.MAV_SYS_STATUS_AHRS
        if not copter.estimator.has_fix:
            health &= ~mavlink.MAV_SYS_STATUS_SENSOR_GPS
        enabled = SENSORS & ~mavlink.MAV_SYS_STATUS_GEOFENCE
        if not copter.armed:
            enabled &= ~mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        return mavlink.MAVLink_sys_status_message(
            SENSORS,
            enabled,
            health,
            150,
            round(battery.voltage * 1000),
            round(battery.current * 100),
            battery.remaining,
            0,
            0,
            0,
            0,
            0,
            0,
        )

    def _build_power_status(self) -> Any:
        return mavlink.MAVLink_power_status_message(5000, 0, 0)

    def _build_meminfo(self) -> Any:
        return mavlink.MAVLink_meminfo_message(0, 0xFFFF, 0x1FFFF)

    def _build_mission_current(self) -> Any:
        return self.mission_current(self.copter.mission.current)

    def mission_current(self, seq: int) -> Any:
        """MISSION_CURRENT for a sequence number, which confirms a MISSION_SET_CURRENT."""
        copter = self.copter
        mission = copter.mission
        state = MAVLINK_STATE[mission.state] if mission.present else mavlink.MISSION_STATE_NO_MISSION
        if copter.mode.number == 3 and getattr(copter.mode, "paused", False):
            state = mavlink.MISSION_STATE_PAUSED
        total = max(len(mission.items) - 1, 0)
        return mavlink.MAVLink_mission_current_message(seq, total, state, int(copter.mode.number == 3))

    def _build_gps_raw_int(self) -> Any:
        estimator = self.copter.estimator
        time, _, velocity, place = self._position()
        fix = estimator.has_fix
        speed = math.hypot(velocity.north, velocity.east)
        course = math.degrees(math.atan2(velocity.east, velocity.north)) % 360
        return mavlink.MAVLink_gps_raw_int_message(
            int(time * 1e6),
            mavlink.GPS_FIX_TYPE_RTK_FIXED if fix else mavlink.GPS_FIX_TYPE_NO_GPS,
            round(place.latitude * 1e7) if fix else 0,
            round(place.longitude * 1e7) if fix else 0,
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

    def _build_nav_controller_output(self) -> Any:
        copter = self.copter
        target, position = copter.mode.target, copter.estimator.position
        distance, bearing = 0.0, 0.0
        if target is not None:
            distance = math.hypot(target.north - position.north, target.east - position.east)
            bearing = math.degrees(math.atan2(target.east - position.east, target.north - position.north))
        return mavlink.MAVLink_nav_controller_output_message(
            math.degrees(copter.body.roll),
            math.degrees(copter.body.pitch),
            round(math.degrees(copter.body.yaw)),
            round(bearing),
            min(round(distance), 65535),
            position.down - copter.position.position[2],
            0.0,
            0.0,
        )

    def _build_position_target_global_int(self) -> Any | None:
        copter = self.copter
        target, origin = copter.mode.target, copter.estimator.origin
        if target is None or origin is None:
            return None
        place = from_ned(origin, target)
        return mavlink.MAVLink_position_target_global_int_message(
            self._milliseconds(),
            mavlink.MAV_FRAME_GLOBAL,
            0xF000 | IGNORE_ALL_BUT_POSITION,
            round(place.latitude * 1e7),
            round(place.longitude * 1e7),
            place.altitude,
            *([0.0] * 8),
        )

    def _build_position_target_local_ned(self) -> Any | None:
        copter = self.copter
        guided = copter.guided
        if copter.mode is not guided:
            return None
        velocity_only = guided.submode.name in ("VELOCITY", "ACCELERATION")
        position = Ned(0.0, 0.0, 0.0) if velocity_only else guided.position_target
        return mavlink.MAVLink_position_target_local_ned_message(
            self._milliseconds(),
            mavlink.MAV_FRAME_LOCAL_NED,
            IGNORE_ALL_BUT_VELOCITY if velocity_only else IGNORE_ALL_BUT_POSITION,
            *position,
            *guided.velocity_target,
            *guided.acceleration_target,
            0.0,
            0.0,
        )

    def _build_servo_output_raw(self) -> Any:
        copter = self.copter
        motor = 1000 + round(1000 * min(copter.throttle * HOVER_THROTTLE, 1.0))
        pulses = copter.servos.pulses(motor)
        return mavlink.MAVLink_servo_output_raw_message(
            self._microseconds() & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
        )

    def _build_rc_channels(self) -> Any:
        copter = self.copter
        pulses = copter.sticks.pulses(copter.now)
        return mavlink.MAVLink_rc_channels_message(self._milliseconds(), 16, *pulses, 0, 0, 254)

    def _build_global_position_int(self) -> Any | None:
        copter = self.copter
        if copter.estimator.origin is None:
            return None
        time, _, velocity, place = self._position()
        return mavlink.MAVLink_global_position_int_message(
            int(time * 1000 + 0.5),
            round(place.latitude * 1e7),
            round(place.longitude * 1e7),
            round(place.altitude * 1000),
            round((place.altitude - copter.home_altitude) * 1000),
            round(velocity.north * 100),
            round(velocity.east * 100),
            round(velocity.down * 100),
            round(self._heading() * 100) % 36000,
        )

    def _build_local_position_ned(self) -> Any | None:
        if self.copter.estimator.origin is None:
            return None
        time, position, velocity, _ = self._position()
        return mavlink.MAVLink_local_position_ned_message(int(time * 1000 + 0.5), *position, *velocity)

    def _build_attitude(self) -> Any:
        body = self.copter.body
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
        copter = self.copter
        body = copter.body
        place = from_ned(copter.estimator.start, body.position)
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
            round(place.latitude * 1e7),
            round(place.longitude * 1e7),
        )

    def _build_vfr_hud(self) -> Any:
        copter = self.copter
        body = copter.body
        _, _, velocity, place = self._position()
        ground_speed = math.hypot(velocity.north, velocity.east)
        air_speed = math.hypot(velocity.north - body.wind_north, velocity.east - body.wind_east)
        throttle = round(100 * min(copter.throttle * HOVER_THROTTLE, 1.0))
        return mavlink.MAVLink_vfr_hud_message(
            air_speed, ground_speed, int(self._heading()), throttle, place.altitude, -velocity.down
        )

    def _build_ahrs(self) -> Any:
        return mavlink.MAVLink_ahrs_message(0.0, 0.0, 0.0, 0.0, 0.0, 0.001, 0.001)

    def _build_system_time(self) -> Any:
        unix = self.unix_epoch + self.copter.now
        return mavlink.MAVLink_system_time_message(
            int(unix * 1e6) if unix > GPS_EPOCH else 0, self._milliseconds()
        )

    def _build_battery_status(self) -> Any:
        battery = self.copter.battery
        return mavlink.MAVLink_battery_status_message(
            0,
            mavlink.MAV_BATTERY_FUNCTION_UNKNOWN,
            mavlink.MAV_BATTERY_TYPE_UNKNOWN,
            32767,
            [round(battery.voltage * 1000)] + [65535] * 9,
            round(battery.current * 100),
            round(battery.consumed),
            round(battery.consumed_wh * 36),
            battery.remaining,
            0,
            mavlink.MAV_BATTERY_CHARGE_STATE_LOW if battery.low else mavlink.MAV_BATTERY_CHARGE_STATE_OK,
        )

    def _build_ekf_status_report(self) -> Any:
        estimator = self.copter.estimator
        variance = 0.01 if estimator.ready else 1.0
        return mavlink.MAVLink_ekf_status_report_message(
            estimator.flags, variance, variance, 0.01, 0.01, 0.0
        )

    def _build_vibration(self) -> Any:
        return mavlink.MAVLink_vibration_message(self._microseconds(), 0.0, 0.0, 0.0, 0, 0, 0)

    def _build_raw_imu(self) -> Any:
        body = self.copter.body
        return mavlink.MAVLink_raw_imu_message(
            self._microseconds(),
            0,
            0,
            -1000,
            round(body.roll_rate * 1000),
            round(body.pitch_rate * 1000),
            round(body.yaw_rate * 1000),
            231,
            104,
            -533,
        )

    def _build_scaled_pressure(self) -> Any:
        altitude = self.copter.estimator.location.altitude
        pressure = 1013.25 * (1 - 2.25577e-5 * altitude) ** 5.25588
        return mavlink.MAVLink_scaled_pressure_message(self._milliseconds(), pressure, 0.0, 2500)

    def _build_home_position(self) -> Any | None:
        home = self.copter.home
        if home is None:
            return None
        return mavlink.MAVLink_home_position_message(
            round(home.latitude * 1e7),
            round(home.longitude * 1e7),
            round(home.altitude * 1000),
            *self.copter.home_offset,
            UNKNOWN_QUATERNION,
            0.0,
            0.0,
            0.0,
            self._microseconds(),
        )

    def _build_gps_global_origin(self) -> Any | None:
        origin = self.copter.estimator.origin
        if origin is None:
            return None
        return mavlink.MAVLink_gps_global_origin_message(
            round(origin.latitude * 1e7),
            round(origin.longitude * 1e7),
            round(origin.altitude * 1000),
            self._microseconds(),
        )

    def _build_autopilot_version(self) -> Any:
        return mavlink.MAVLink_autopilot_version_message(
            CAPABILITIES, FIRMWARE_VERSION, 0, 0, 0, list(b"embedded"), [0] * 8, [0] * 8, 0, 0, 0
        )

    def _build_extended_sys_state(self) -> Any:
        copter = self.copter
        if copter.landed:
            landed = mavlink.MAV_LANDED_STATE_ON_GROUND
        elif copter.mode.landing:
            landed = mavlink.MAV_LANDED_STATE_LANDING
        elif copter.mode.taking_off:
            landed = mavlink.MAV_LANDED_STATE_TAKEOFF
        else:
            landed = mavlink.MAV_LANDED_STATE_IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_MC, landed)
