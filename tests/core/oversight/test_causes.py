"""Which of the autopilot's texts tell why, and whose deed it was."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.causes import AFTER, BEFORE, Author, VehicleChange, cause_of, sentence_of
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

AT = 100.0
CRITICAL, WARNING, NOTICE = mavlink.MAV_SEVERITY_CRITICAL, mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_NOTICE
INFO = mavlink.MAV_SEVERITY_INFO


def change(what: str = "mode", before: str = "GUIDED", after: str = "LAND") -> VehicleChange:
    return VehicleChange(what, 1, AT, before, after, after, "armed in GUIDED")


def state(*texts: tuple[float, int, str]) -> VehicleState:
    made = VehicleState(1, 1, mavlink.MAV_TYPE_QUADROTOR, heartbeat_at=AT)
    for ago, severity, text in texts:
        made.statustexts.take(mavlink.MAVLink_statustext_message(severity, text.encode()), AT + ago)
    return made


def switched(*texts: tuple[float, int, str]) -> str:
    return sentence_of(change(), cause_of(change(), state(*texts), -1000.0))


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (
            [(-0.5, CRITICAL, "EKF Failsafe"), (0.1, CRITICAL, "EKF Failsafe: changed to LAND Mode")],
            "by a failsafe (EKF Failsafe: changed to LAND Mode)",
        ),
        (
            [(-0.1, WARNING, "Battery 1 is low 9.90V used 312 mAh"), (0.0, WARNING, "Battery Failsafe")],
            "by a failsafe (Battery 1 is low 9.90V used 312 mAh; Battery Failsafe)",
        ),
        ([(-0.1, NOTICE, "Fence breached")], "by a failsafe (Fence breached)"),
        ([(-0.1, INFO, "EKF3 IMU0 is using GPS")], "by the pilot or another station"),
        ([(-0.1, CRITICAL, "PreArm: GPS 1: Bad fix")], "by the pilot or another station"),
        ([(-0.1, WARNING, "Something else")], "by the pilot or a failsafe (Something else)"),
        ([(-BEFORE - 0.1, WARNING, "Battery Failsafe")], "by the pilot or another station"),
        ([(AFTER + 0.1, WARNING, "Battery Failsafe")], "by the pilot or another station"),
        (
            [(-0.1, CRITICAL, "EKF Failsafe"), (-0.1, WARNING, "Battery 1 is low 9.90V used 312 mAh")],
            "by a failsafe (EKF Failsafe)",
        ),
        ([(0.0, CRITICAL, "Radio Failsafe\x1b[2J")], "by a failsafe (Radio Failsafe\\x1b[2J)"),
    ],
)
def test_sentence_quotes_what_matters(texts: list[tuple[float, int, str]], says: str) -> None:
    assert switched(*texts) == f"vehicle 1 changes from GUIDED to LAND, {says}"


@pytest.mark.parametrize("text", ["ArduCopter V4.7.0-dev (1a2b3c4d)", "ArduPilot Ready", "EKF3 IMU0 initialised"])
def test_what_an_autopilot_says_when_it_starts_is_a_reboot(text: str) -> None:
    assert cause_of(change("armed", "armed", "disarmed"), state((0.1, INFO, text)), -1000.0).author is Author.REBOOT


def test_disarming_without_a_reason_names_nobody() -> None:
    landed = VehicleChange("armed", 1, AT, "armed", "disarmed", "LAND", "armed in LAND")
    assert sentence_of(landed, cause_of(landed, state(), -1000.0)) == "vehicle 1 disarms in LAND"
