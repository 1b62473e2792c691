from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

SERVO = mavutil.mavlink.MAV_CMD_DO_SET_SERVO


@pytest.mark.parametrize("slash", ["", "/"])
def test_servo_output(drone: Any, api: Any, slash: str) -> None:
    answer = api.post(f"/peripherical/servo_output{slash}", {"channel": 9, "pwm": 1700})
    assert (answer.status, answer.body["result"]) == (200, "Servo 9 set to 1700 PWM")
    assert [(command.param1, command.param2) for command in drone.commands(SERVO)] == [(9, 1700)]


@pytest.mark.parametrize(
    "body",
    [
        {"channel": 0, "pwm": 1500},
        {"channel": 17, "pwm": 1500},
        {"channel": 1, "pwm": 799},
        {"channel": 1, "pwm": 2201},
        {"channel": 1.5, "pwm": 1500},
        {"channel": 1},
    ],
)
def test_servo_out_of_range_is_422_and_nothing_is_sent(drone: Any, api: Any, body: dict[str, Any]) -> None:
    assert api.post("/peripherical/servo_output", body).status == 422
    assert drone.received == []
