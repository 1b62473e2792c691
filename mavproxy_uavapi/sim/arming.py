"""Whether a vehicle may arm, and why not: ArduPilot's checks, in its order and with its texts."""

from __future__ import annotations

from typing import Protocol

from .battery import Battery
from .estimator import Estimator
from .geodesy import Location
from .mission import Mission
from .mode import VehicleMode
from .parameter_tables.names import ALL_CHECKS
from .parameters import ParameterStore

REPORT_INTERVAL = 30.0
"""Seconds between reports of what keeps a disarmed vehicle from arming."""

TEXT_LENGTH = 50
"""Characters of a text; ArduPilot cuts these, and sends longer ones of other kinds in pieces."""


class Candidate(Protocol):
    """What the checks look at."""

    armed: bool
    home: Location | None
    mode: VehicleMode
    mission: Mission
    battery: Battery
    estimator: Estimator
    parameters: ParameterStore


def skips_all(parameters: ParameterStore) -> bool:
    """Whether no check is done before arming but the mandatory ones."""
    return int(parameters["ARMING_SKIPCHK"]) & ALL_CHECKS == ALL_CHECKS


def mandatory_failures(vehicle: Candidate) -> list[str]:
    """Checks that hold even for a forced arming or with ARMING_SKIPCHK -1."""
    if not vehicle.estimator.aligned:
        return ["AHRS: EKF3 still initialising"]
    if vehicle.mode.needs_position and not vehicle.estimator.ready:
        return ["Need Position Estimate"]
    return []


def prearm_failures(vehicle: Candidate) -> list[str]:
    """Why the pre-arm check fails now; empty when the vehicle is ready. An armed vehicle passes."""
    if vehicle.armed:
        return []
    failures = mandatory_failures(vehicle)
    if skips_all(vehicle.parameters):
        return failures
    if not vehicle.estimator.has_fix:
        failures.append("GPS 1: Bad fix")
    if vehicle.home is None:
        failures.append("AHRS: waiting for home")
    if vehicle.mode.name == "AUTO" and not vehicle.mission.present:
        failures.append("Mode requires mission")
    if vehicle.battery.low:
        failures.append("Battery 1 low voltage failsafe")
    return failures
