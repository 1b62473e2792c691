"""Whether a vehicle may arm, and why not: ArduPilot's checks, in its order and with its texts."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

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


class Arming:
    """What of a vehicle is armed and disarmed."""

    armed: bool
    home: Location | None
    mode: VehicleMode
    mission: Mission
    battery: Battery
    estimator: Estimator
    parameters: ParameterStore

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT of a MAV_SEVERITY."""
        raise NotImplementedError

    def skips_checks(self) -> bool:
        """Whether no check is done before arming but the mandatory ones."""
        return int(self.parameters["ARMING_SKIPCHK"]) & ALL_CHECKS == ALL_CHECKS

    def mandatory_failures(self) -> list[str]:
        """Checks that hold even for a forced arming or with ARMING_SKIPCHK -1."""
        if not self.estimator.aligned:
            return ["AHRS: EKF3 still initialising"]
        if self.mode.needs_position and not self.estimator.ready:
            return ["Need Position Estimate"]
        return []

    def prearm_failures(self) -> list[str]:
        """Why the pre-arm check fails now; empty when the vehicle is ready. An armed vehicle passes."""
        if self.armed:
            return []
        failures = self.mandatory_failures()
        if self.skips_checks():
            return failures
        if not self.estimator.has_fix:
            failures.append("GPS 1: Bad fix")
        if self.home is None:
            failures.append("AHRS: waiting for home")
        if self.mode.name == "AUTO" and not self.mission.present:
            failures.append("Mode requires mission")
        if self.battery.low:
            failures.append("Battery 1 low voltage failsafe")
        return failures

    def report_prearm(self) -> None:
        """Tell the ground what keeps the vehicle from arming."""
        for failure in self.prearm_failures():
            self.say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {failure}"[:TEXT_LENGTH])

    def arm_failures(self) -> list[str]:
        """What else must hold at the moment of arming from the ground station."""
        return []

    def arm(self, *, forced: bool) -> bool:
        """Arm the motors; False with STATUSTEXTs that say why not."""
        if self.armed:
            return True
        if not (forced and not self.mandatory_failures()):
            failures = self.prearm_failures() or self.arm_failures()
            for failure in failures:
                self.say(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {failure}"[:TEXT_LENGTH])
            if failures:
                return False
        self.arm_motors()
        return True

    def arm_motors(self) -> None:
        """Arm without any check."""
        raise NotImplementedError

    def may_disarm(self) -> bool:
        """Whether the ground station may disarm now without force."""
        return True

    def disarm(self, *, forced: bool) -> bool:
        """Disarm for the ground station; refused (False) where it would be a crash, unless forced."""
        if self.armed and not forced and not self.may_disarm():
            return False
        self.disarm_now()
        return True

    def disarm_now(self) -> None:
        """Stop the motors, whatever the vehicle is doing."""
        raise NotImplementedError
