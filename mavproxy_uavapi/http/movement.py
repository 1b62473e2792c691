"""/movement: guided flight by position, velocity and yaw."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.core.vehicle.jobs import Job
from mavproxy_uavapi.core.vehicle.messages import GlobalTarget, NedTarget, VelocityTarget
from mavproxy_uavapi.http.call import Answer, Call
from mavproxy_uavapi.http.requests import BodyOffset, GpsTarget, Heading, NedPlace, NedVelocity, YawRate


async def go_to_gps(call: Call) -> Answer:
    """Fly to a latitude, longitude and altitude above home; answer once it is on its way."""
    return await _go_to_gps(call, wait=False)


async def go_to_gps_wait(call: Call) -> Answer:
    """Fly to a latitude, longitude and altitude above home; answer on arrival."""
    return await _go_to_gps(call, wait=True)


async def _go_to_gps(call: Call, wait: bool) -> Answer:
    copter, p = call.copter, call.params(GpsTarget)
    place = f"coord ({p.lat}, {p.long}, {p.alt})"
    verb = _going(copter, lambda: GlobalTarget(p.lat, p.long, p.alt), p, wait)
    return await call.fly(copter, verb, f"Arrived at {place}" if wait else f"Going to {place}")


async def go_to_ned(call: Call) -> Answer:
    """Fly to a place in NED metres from the EKF origin; answer once it is on its way."""
    return await _go_to_ned(call, wait=False)


async def go_to_ned_wait(call: Call) -> Answer:
    """Fly to a place in NED metres from the EKF origin; answer on arrival."""
    return await _go_to_ned(call, wait=True)


async def _go_to_ned(call: Call, wait: bool) -> Answer:
    copter, p = call.copter, call.params(NedPlace)
    place = f"NED coord ({p.x}, {p.y}, {p.z})"
    verb = _going(copter, lambda: NedTarget(p.x, p.y, p.z), p, wait)
    return await call.fly(copter, verb, f"Arrived at {place}" if wait else f"Going to {place}")


def _going(
    copter: Copter, aim: Callable[[], NedTarget | GlobalTarget], p: GpsTarget | NedPlace | BodyOffset, wait: bool
) -> Callable[[Job], Awaitable[None]]:
    """The verb that goes to what `aim` gives once the job begins: a joined request must not move a target."""

    async def verb(job: Job) -> None:
        copter.require_guided_flight()
        await copter.go_to(
            job, aim(), look_at_target=p.look_at_target, wait=wait, tolerance=p.tolerance, timeout=p.timeout
        )

    return verb


async def drive(call: Call) -> Answer:
    """Fly an NED offset from here; answer once it is on its way."""
    return await _drive(call, wait=False)


async def drive_wait(call: Call) -> Answer:
    """Fly an NED offset from here; answer on arrival."""
    return await _drive(call, wait=True)


async def _drive(call: Call, wait: bool) -> Answer:
    copter, p = call.copter, call.params(NedPlace)
    return await _drive_to(call, copter, lambda: copter.ned_from_here(p.x, p.y, p.z), p, wait)


async def drive_body(call: Call) -> Answer:
    """Fly an offset in the body's frame; answer once it is on its way."""
    return await _drive_body(call, wait=False)


async def drive_body_wait(call: Call) -> Answer:
    """Fly an offset in the body's frame; answer on arrival."""
    return await _drive_body(call, wait=True)


async def _drive_body(call: Call, wait: bool) -> Answer:
    copter, p = call.copter, call.params(BodyOffset)
    return await _drive_to(call, copter, lambda: copter.body_from_here(p.front, p.right, p.down), p, wait)


async def _drive_to(
    call: Call, copter: Copter, aim: Callable[[], NedTarget], p: NedPlace | BodyOffset, wait: bool
) -> Answer:
    aimed_at: list[NedTarget] = []

    def aim_once() -> NedTarget:
        aimed_at.append(aim())
        return aimed_at[-1]

    def result() -> str:
        if not wait:
            return "Copter is driving"
        target = aimed_at[-1]
        return f"Copter arrived at ({target.x}, {target.y}, {target.z})"

    return await call.fly(copter, _going(copter, aim_once, p, wait), result)


async def travel_at_ned(call: Call) -> Answer:
    """Fly at an NED velocity until the autopilot drops it, or for a duration."""
    copter, p = call.copter, call.params(NedVelocity)
    velocity = VelocityTarget(p.vx, p.vy, p.vz)

    async def verb(job: Job) -> None:
        await copter.travel(job, velocity, look_at_target=p.look_at_target, duration=p.duration)

    return await call.fly(copter, verb, f"Travelling at NED velocity ({p.vx}, {p.vy}, {p.vz})")


async def set_heading(call: Call) -> Answer:
    """Turn to a heading, the shorter way round."""
    copter, heading = call.copter, call.params(Heading).heading
    return await call.fly(copter, lambda job: copter.set_heading(job, heading), f"Heading set to {heading} degrees")


async def set_yaw_rate(call: Call) -> Answer:
    """Turn at a rate."""
    copter, rate = call.copter, call.params(YawRate).yaw_rate
    return await call.fly(copter, lambda job: copter.set_yaw_rate(job, rate), f"Yaw rate set to {rate} deg/s")


async def stop(call: Call) -> Answer:
    """Hold the vehicle still until it is resumed; a movement under way waits, no other begins."""
    copter = call.copter
    return await call.fly(copter, copter.stop, "Copter has stopped", outlives_client=True, urgent=True)


async def resume(call: Call) -> Answer:
    """Continue the guided movement."""
    copter = call.copter
    return await call.fly(copter, copter.resume, "Copter has resumed")
