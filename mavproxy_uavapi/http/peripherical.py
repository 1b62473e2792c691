"""/peripherical (sic): what hangs on the vehicle."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import Servo


async def servo_output(call: Call) -> dict[str, Any]:
    """Set a servo output."""
    servo = call.params(Servo)
    await call.vehicle.set_servo(servo.channel, servo.pwm)
    return call.answer(f"Servo {servo.channel} set to {servo.pwm} PWM")
