"""What a vehicle reports: its newest telemetry as properties, and its status."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.client.places import Ned, Position
from mavproxy_uavapi.client.telemetry import Telemetry
from mavproxy_uavapi.core.errors import Stale
from mavproxy_uavapi.core.geodesy import from_deg_e7
from mavproxy_uavapi.core.telemetry.flight_modes import mode_name

ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
UNKNOWN_HEADING = 65535


@dataclass(frozen=True)
class AttitudeReading:
    """Roll, pitch and yaw in rad; yaw clockwise from north."""

    roll: float
    pitch: float
    yaw: float


@dataclass(frozen=True)
class BatteryReading:
    """Voltage in V, current in A, level in %; None if unknown."""

    voltage: float | None
    current: float | None
    level: int | None


@dataclass(frozen=True)
class Gps:
    """The receiver's fix (3: 3-D and better) and its number of satellites; None if unknown."""

    fix_type: int
    satellites: int | None


@dataclass(frozen=True)
class Status:
    """The vehicle's status by the API; see /telemetry/status."""

    kind: str
    mode: str
    armed: bool | None
    landed_state: str
    link_alive: bool
    ekf_ok: bool
    ready_to_arm: bool
    why_not: tuple[str, ...]


@dataclass(frozen=True)
class CommandingJob:
    """The job that commands a vehicle.

    Attributes:
        job: its number at `/jobs`.
        verb: the path of the API that began it.
        request: its parameters, by name.
    """

    job: str
    verb: str
    request: Mapping[str, Any]


def _scaled(value: float | None, divisor: float) -> float | None:
    return None if value is None else value / divisor


class VehicleReadings:
    """The newest telemetry of a vehicle. Its properties raise `Stale` if it is too old.

    Attributes:
        telemetry: all messages from the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self.telemetry = telemetry

    @property
    def position(self) -> Position:
        """Its position."""
        here = self.telemetry.fields("GLOBAL_POSITION_INT")
        return Position(from_deg_e7(here["lat"]), from_deg_e7(here["lon"]), here["relative_alt"] / 1000.0)

    @property
    def velocity(self) -> Ned:
        """Its velocity, m/s north, east, down."""
        here = self.telemetry.fields("GLOBAL_POSITION_INT")
        return Ned(here["vx"] / 100.0, here["vy"] / 100.0, here["vz"] / 100.0)

    @property
    def ned(self) -> Ned:
        """Its position, m from its EKF origin."""
        here = self.telemetry.fields("LOCAL_POSITION_NED")
        return Ned(here["x"], here["y"], here["z"])

    @property
    def heading(self) -> float:
        """Its heading, degrees clockwise from north, from 0 to less than 360."""
        heading = self.telemetry.fields("GLOBAL_POSITION_INT")["hdg"]
        if heading in (None, UNKNOWN_HEADING):
            return math.degrees(self.attitude.yaw) % 360.0
        return float(heading) / 100.0 % 360.0

    @property
    def attitude(self) -> AttitudeReading:
        """Its attitude."""
        fields = self.telemetry.fields("ATTITUDE")
        return AttitudeReading(fields["roll"], fields["pitch"], fields["yaw"])

    @property
    def armed(self) -> bool:
        """Whether it is armed."""
        return bool(self.telemetry.fields("HEARTBEAT")["base_mode"] & ARMED)

    @property
    def mode(self) -> str:
        """The name of its flight mode."""
        heartbeat = self.telemetry.fields("HEARTBEAT")
        return mode_name(heartbeat["type"], heartbeat["custom_mode"])

    @property
    def battery(self) -> BatteryReading:
        """The battery that its autopilot monitors."""
        fields = self.telemetry.fields("SYS_STATUS")
        voltage, current = _scaled(fields["voltage_battery"], 1000.0), _scaled(fields["current_battery"], 100.0)
        return BatteryReading(voltage, current, fields["battery_remaining"])

    @property
    def gps(self) -> Gps:
        """Its first GPS receiver."""
        fields = self.telemetry.fields("GPS_RAW_INT")
        return Gps(fields["fix_type"], fields["satellites_visible"])

    @property
    def is_connected(self) -> bool:
        """Whether its heartbeats arrive."""
        try:
            self.telemetry.fields("HEARTBEAT")
        except Stale:
            return False
        return True
