"""Whether the vehicle may arm, and why not: ArduCopter's checks, in its order and with its texts."""

from __future__ import annotations

from .aircraft import Aircraft
from .modes import Mode

REPORT_INTERVAL = 30.0
"""Seconds between reports of what keeps a disarmed vehicle from arming."""


def mandatory_failures(aircraft: Aircraft, mode: Mode) -> list[str]:
    """Checks that hold even for a forced arming or with ARMING_CHECK 0."""
    estimator = aircraft.estimator
    if not estimator.aligned:
        return ["AHRS: EKF3 still initialising"]
    if mode.needs_position and not estimator.ready:
        return ["Need Position Estimate"]
    return []


def prearm_failures(aircraft: Aircraft, mode: Mode) -> list[str]:
    """Why the pre-arm check fails now; empty when the vehicle is ready. An armed vehicle passes."""
    if aircraft.armed:
        return []
    failures = mandatory_failures(aircraft, mode)
    if aircraft.parameters["ARMING_CHECK"] == 0:
        return failures
    if not aircraft.estimator.has_fix:
        failures.append("GPS 1: Bad fix")
    if aircraft.home is None:
        failures.append("AHRS: waiting for home")
    if mode.name == "AUTO" and not aircraft.mission.present:
        failures.append("Mode requires mission")
    if aircraft.battery.low:
        failures.append("Battery 1 low voltage failsafe")
    return failures


def arm_failures(aircraft: Aircraft, mode: Mode) -> list[str]:
    """What else must hold at the moment of arming from the ground station."""
    if not mode.armable:
        return [f"{mode.name} mode not armable"]
    if aircraft.parameters["ARMING_CHECK"] == 0:
        return []
    throttle_matters = mode.name not in ("GUIDED", "AUTO")
    high = aircraft.sticks.throttle(aircraft.now) > (0.0 if mode.manual_throttle else 0.6)
    return ["Throttle too high"] if throttle_matters and high else []
