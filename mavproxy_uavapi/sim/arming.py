"""May the vehicle arm, and if not, why: the checks in ArduCopter's order with its texts."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .copter import Copter

FORCE_ARM = 2989.0
FORCE = 21196.0
"""The magic in param2 of MAV_CMD_COMPONENT_ARM_DISARM that skips checks (the other one only arms)."""
REPORT_INTERVAL = 30.0
"""Seconds between reports of what keeps a disarmed vehicle from arming."""


def mandatory_failures(copter: Copter) -> list[str]:
    """Checks that hold even for a forced arming or with ARMING_CHECK 0."""
    estimator = copter.estimator
    if not estimator.aligned:
        return ["AHRS: EKF3 still initialising"]
    if copter.mode.needs_position and not estimator.ready:
        return ["Need Position Estimate"]
    return []


def prearm_failures(copter: Copter) -> list[str]:
    """Why the pre-arm check fails now; empty when the vehicle is ready. An armed vehicle passes."""
    if copter.armed:
        return []
    failures = mandatory_failures(copter)
    if copter.parameters["ARMING_CHECK"] == 0:
        return failures
    if not copter.estimator.has_fix:
        failures.append("GPS 1: Bad fix")
    if copter.home is None:
        failures.append("AHRS: waiting for home")
    if copter.mode.name == "AUTO" and not copter.mission.present:
        failures.append("Mode requires mission")
    if copter.battery.low:
        failures.append("Battery 1 low voltage failsafe")
    return failures


def arm_failures(copter: Copter) -> list[str]:
    """What else must hold at the moment of arming from the ground station."""
    if not copter.mode.armable:
        return [f"{copter.mode.name} mode not armable"]
    if copter.parameters["ARMING_CHECK"] == 0:
        return []
    throttle_matters = copter.mode.name not in ("GUIDED", "AUTO")
    high = copter.sticks.throttle(copter.now) > (0.0 if copter.mode.manual_throttle else 0.6)
    return ["Throttle too high"] if throttle_matters and high else []
