"""The state of the vehicle's systems as MAVLink messages."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .mavlink_names import named
from .message_source import MessageSource
from .mission import MAVLINK_STATE

SENSORS = sum(
    named(
        "MAV_SYS_STATUS_",
        """
        SENSOR_3D_GYRO SENSOR_3D_ACCEL SENSOR_3D_MAG SENSOR_ABSOLUTE_PRESSURE SENSOR_GPS SENSOR_ANGULAR_RATE_CONTROL
        SENSOR_ATTITUDE_STABILIZATION SENSOR_YAW_POSITION SENSOR_Z_ALTITUDE_CONTROL SENSOR_XY_POSITION_CONTROL
        SENSOR_MOTOR_OUTPUTS SENSOR_RC_RECEIVER AHRS SENSOR_BATTERY GEOFENCE PREARM_CHECK
        """,
    )
)
CAPABILITIES = sum(
    named(
        "MAV_PROTOCOL_CAPABILITY_",
        "MISSION_FLOAT PARAM_FLOAT MISSION_INT COMMAND_INT SET_POSITION_TARGET_LOCAL_NED "
        "SET_POSITION_TARGET_GLOBAL_INT MAVLINK2",
    )
)
"""Without FTP: MAVProxy then loads the parameters one by one, at once."""
GPS_EPOCH = 315964800
"""1980-01-06 in unix seconds; before it a clock has never been set."""


class SystemMessages(MessageSource):
    """Mode, health, battery, mission progress, sticks and outputs."""

    def _build_heartbeat(self) -> Any:
        vehicle = self.vehicle
        return mavlink.MAVLink_heartbeat_message(
            vehicle.mav_type,
            mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            vehicle.base_mode,
            vehicle.mode.reported,
            vehicle.system_status,
            3,
        )

    def _build_sys_status(self) -> Any:
        vehicle = self.vehicle
        battery = vehicle.battery
        health = SENSORS
        if vehicle.prearm_failures():
            health &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
        if not vehicle.estimator.aligned:
            health &= ~mavlink.MAV_SYS_STATUS_AHRS
        if not vehicle.estimator.has_fix:
            health &= ~mavlink.MAV_SYS_STATUS_SENSOR_GPS
        enabled = SENSORS & ~mavlink.MAV_SYS_STATUS_GEOFENCE
        if not vehicle.armed:
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
        return self.mission_current(self.vehicle.mission.current)

    def mission_current(self, seq: int) -> Any:
        """MISSION_CURRENT for a sequence number, which confirms a MISSION_SET_CURRENT."""
        vehicle = self.vehicle
        mission = vehicle.mission
        state = MAVLINK_STATE[mission.state] if mission.present else mavlink.MISSION_STATE_NO_MISSION
        auto = vehicle.mission_mode
        if vehicle.mode is auto and auto.holding_mission:
            state = mavlink.MISSION_STATE_PAUSED
        total = max(len(mission.items) - 1, 0)
        return mavlink.MAVLink_mission_current_message(seq, total, state, int(vehicle.mode is auto))

    def _build_servo_output_raw(self) -> Any:
        vehicle = self.vehicle
        pulses = vehicle.servo_pulses()
        return mavlink.MAVLink_servo_output_raw_message(
            self._microseconds() & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
        )

    def _build_rc_channels(self) -> Any:
        vehicle = self.vehicle
        pulses = vehicle.sticks.pulses(vehicle.now)
        return mavlink.MAVLink_rc_channels_message(self._milliseconds(), 16, *pulses, 0, 0, 254)

    def _build_system_time(self) -> Any:
        unix = self.unix_epoch + self.vehicle.now
        return mavlink.MAVLink_system_time_message(int(unix * 1e6) if unix > GPS_EPOCH else 0, self._milliseconds())

    def _build_battery_status(self) -> Any:
        battery = self.vehicle.battery
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
        estimator = self.vehicle.estimator
        variance = 0.01 if estimator.ready else 1.0
        return mavlink.MAVLink_ekf_status_report_message(estimator.flags, variance, variance, 0.01, 0.01, 0.0)

    def _build_vibration(self) -> Any:
        return mavlink.MAVLink_vibration_message(self._microseconds(), 0.0, 0.0, 0.0, 0, 0, 0)

    def _build_autopilot_version(self) -> Any:
        major, minor, patch, kind = self.vehicle.version
        version = major << 24 | minor << 16 | patch << 8 | kind
        return mavlink.MAVLink_autopilot_version_message(
            CAPABILITIES, version, 0, 0, 0, list(b"embedded"), [0] * 8, [0] * 8, 0, 0, 0
        )

    def _build_extended_sys_state(self) -> Any:
        vehicle = self.vehicle
        return mavlink.MAVLink_extended_sys_state_message(vehicle.vtol_state, vehicle.landed_state)
