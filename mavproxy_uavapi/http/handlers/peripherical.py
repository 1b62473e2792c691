"""/peripherical (sic): devices on the vehicle, and a camera of this machine."""

from __future__ import annotations

from aiohttp import web

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import Photo, Servo
from mavproxy_uavapi.http.contract.responses import Done
from mavproxy_uavapi.programs import cameras
from mavproxy_uavapi.programs.cameras import TOOLS, Shot

VISION = "vision"


async def servo_output(call: Call) -> Done:
    """Set a servo output."""
    vehicle, servo = call.vehicle, call.params(Servo)
    result = f"Servo {servo.channel} set to {servo.pwm} PWM"
    return await call.fly(vehicle, lambda _: vehicle.set_servo(servo.channel, servo.pwm), result)


async def take_photo(call: Call) -> web.StreamResponse:
    """Take a picture with a camera tool, or the newest frame of the vision module; answers a JPEG, geotagged."""
    p, host = call.params(Photo), call.service.host
    if p.command != VISION and p.command not in TOOLS:
        raise BadRequest(f"camera tool {p.command!r} is not allowed, but {', '.join([*TOOLS, VISION])}")
    width, height = cameras.size_of(p.resolution)
    if p.command == VISION:
        picture = await _newest_frame(call)
    else:
        shot = Shot(width, height, p.capture_time, p.focus_distance, p.exposure)
        photo = await cameras.take(p.command, shot)
        system = host.registry.resolve(call.named_system)
        picture = host.geotagged(system, photo, host.clock())  # its program has written it just now
    headers = {"Content-Disposition": 'attachment; filename="photo.jpg"', "Cache-Control": "no-store"}
    return web.Response(body=picture, content_type="image/jpeg", headers=headers)


async def _newest_frame(call: Call) -> bytes:
    """The vision module's newest frame, in the size that its camera has.

    Raises:
        BadRequest: the module is not loaded.
    """
    newest_frame = call.service.host.newest_frame
    if newest_frame is None:
        raise BadRequest("the vision module is not loaded (`module load vision`)")
    return await newest_frame()
