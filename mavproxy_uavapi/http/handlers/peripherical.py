"""/peripherical (sic): devices on the vehicle."""

from __future__ import annotations

from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import Servo
from mavproxy_uavapi.http.contract.responses import Done


async def servo_output(call: Call) -> Done:
    """Set a servo output."""
    vehicle, servo = call.vehicle, call.params(Servo)
    result = f"Servo {servo.channel} set to {servo.pwm} PWM"
    return await call.fly(vehicle, lambda _: vehicle.set_servo(servo.channel, servo.pwm), result)
