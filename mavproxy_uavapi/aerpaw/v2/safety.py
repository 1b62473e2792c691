"""`aerpawlib.v2.safety`: checks before a flight, and the safety checker, asked without blocking."""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable
from typing import Any, Protocol

from mavproxy_uavapi.aerpaw import safety
from mavproxy_uavapi.aerpaw.constants import (
    DEFAULT_MIN_BATTERY_PERCENT,
    GPS_3D_FIX_TYPE,
    SAFETY_CHECKER_REQUEST_TIMEOUT_S,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.safety_rules import ALLOWED, Verdict
from mavproxy_uavapi.aerpaw.vehicle_telemetry import VehicleTelemetry

log = logging.getLogger("aerpawlib.v2.safety")


class SafetyChecker(Protocol):
    """Says whether a command is allowed, and if not, why."""

    async def validate_takeoff(self, takeoff_alt: float, current_lat: float, current_lon: float) -> Verdict:
        """A takeoff to an altitude, m above home."""

    async def validate_waypoint(self, current: Coordinate, next_loc: Coordinate) -> Verdict:
        """The flight between two positions."""

    async def validate_change_speed(self, new_speed: float) -> Verdict:
        """A speed, m/s."""

    async def validate_landing(self, current_lat: float, current_lon: float) -> Verdict:
        """A landing."""


class NoOpSafetyChecker:
    """A safety checker that allows everything; `reason` is logged."""

    def __init__(self, reason: str) -> None:
        log.warning("there is no safety checker: %s", reason)

    async def _allow(self, *_: Any) -> Verdict:
        return ALLOWED

    validate_takeoff = validate_waypoint = validate_change_speed = validate_landing = _allow


class SafetyCheckerClient:
    """A safety checker at an address; see `aerpaw.safety_server`. One request is asked at a time.

    Raises, in all requests:
        TimeoutError: there is no response within `timeout_s`.
        ValueError: it is malformed.
    """

    def __init__(self, addr: str, port: int, timeout_s: float = SAFETY_CHECKER_REQUEST_TIMEOUT_S) -> None:
        self._client = safety.SafetyCheckerClient(addr, port, timeout_s)
        self._asking = asyncio.Lock()

    async def _ask(self, request: Callable[..., Verdict], *values: Any) -> Verdict:
        async with self._asking:
            return await asyncio.to_thread(request, *values)

    async def check_server_status(self) -> Verdict:
        """Whether the server works."""
        return await self._ask(self._client.check_server_status)

    async def validate_takeoff(self, takeoff_alt: float, current_lat: float, current_lon: float) -> Verdict:
        """See `SafetyChecker`."""
        return await self._ask(self._client.validate_takeoff_command, takeoff_alt, current_lat, current_lon)

    async def validate_waypoint(self, current: Coordinate, next_loc: Coordinate) -> Verdict:
        """See `SafetyChecker`."""
        return await self._ask(self._client.validate_waypoint_command, current, next_loc)

    async def validate_change_speed(self, new_speed: float) -> Verdict:
        """See `SafetyChecker`."""
        return await self._ask(self._client.validate_change_speed_command, new_speed)

    async def validate_landing(self, current_lat: float, current_lon: float) -> Verdict:
        """See `SafetyChecker`."""
        return await self._ask(self._client.validate_landing_command, current_lat, current_lon)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()


class PreflightChecks:
    """Checks of a vehicle's telemetry before a flight."""

    @staticmethod
    def check_gps_fix(vehicle: VehicleTelemetry) -> bool:
        """Whether it has a 3-D fix."""
        return vehicle.gps.fix_type >= GPS_3D_FIX_TYPE

    @staticmethod
    def check_battery(vehicle: VehicleTelemetry, min_percent: float = DEFAULT_MIN_BATTERY_PERCENT) -> bool:
        """Whether its battery has at least so much left."""
        return vehicle.battery.level >= min_percent

    @staticmethod
    async def run_all(vehicle: VehicleTelemetry) -> bool:
        """Whether it passes all of them."""
        return PreflightChecks.check_gps_fix(vehicle) and PreflightChecks.check_battery(vehicle)


def setup_signal_handlers(
    loop: asyncio.AbstractEventLoop,
    on_sigint: Callable[[], object] | None = None,
    on_sigterm: Callable[[], object] | None = None,
) -> None:
    """Call these in the loop at SIGINT and SIGTERM."""
    for number, call in ((signal.SIGINT, on_sigint), (signal.SIGTERM, on_sigterm)):
        if call is not None:
            loop.add_signal_handler(number, call)
