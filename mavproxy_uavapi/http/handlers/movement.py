"""/movement: guided flight by position, velocity and yaw."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget, VelocityTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import (
    BodyOffset,
    BodyVelocity,
    GpsTarget,
    Heading,
    NedPlace,
    NedVelocity,
    YawRate,
)
from mavproxy_uavapi.http.contract.responses import Done
from mavproxy_uavapi.http.contract.route import Action

STOPPED = {"plane": "Plane is loitering"}


def _both(what: str, move: Callable[[Call, bool], Awaitable[Done]]) -> tuple[Action, Action]:
    """The handlers of a movement: one answers once the vehicle is on its way, the other on its arrival."""

    async def on_its_way(call: Call) -> Done:
        return await move(call, False)

    async def on_arrival(call: Call) -> Done:
        return await move(call, True)

    on_its_way.__name__, on_arrival.__name__ = move.__name__.lstrip("_"), f"{move.__name__.lstrip('_')}_wait"
    on_its_way.__doc__, on_arrival.__doc__ = f"{what}; answer once it is on its way.", f"{what}; answer on arrival."
    return on_its_way, on_arrival


async def _go_to_gps(call: Call, wait: bool) -> Done:
    vehicle, p = call.vehicle, call.params(GpsTarget)
    place = f"coord ({p.lat}, {p.long}, {p.alt})"
    verb = _going(vehicle, lambda: GlobalTarget(p.lat, p.long, p.alt), p, wait)
    return await call.fly(vehicle, verb, f"Arrived at {place}" if wait else f"Going to {place}")


async def _go_to_ned(call: Call, wait: bool) -> Done:
    vehicle, p = call.vehicle, call.params(NedPlace)
    place = f"NED coord ({p.x}, {p.y}, {p.z})"
    verb = _going(vehicle, lambda: NedTarget(p.x, p.y, p.z), p, wait)
    return await call.fly(vehicle, verb, f"Arrived at {place}" if wait else f"Going to {place}")


def _going(
    vehicle: Vehicle, aim: Callable[[], NedTarget | GlobalTarget], p: GpsTarget | NedPlace | BodyOffset, wait: bool
) -> Callable[[Job], Awaitable[None]]:
    """The verb that goes to the target that `aim` computes when the job begins: a joined request must not move it."""

    async def verb(job: Job) -> None:
        vehicle.require_guided_flight()
        await vehicle.go_to(
            job,
            aim(),
            look_at_target=p.look_at_target,
            heading=p.heading,
            wait=wait,
            tolerance=p.tolerance,
            timeout=p.timeout,
        )

    return verb


async def _drive(call: Call, wait: bool) -> Done:
    vehicle, p = call.vehicle, call.params(NedPlace)
    return await _drive_to(call, vehicle, lambda: vehicle.ned_from_here(p.x, p.y, p.z), p, wait)


async def _drive_body(call: Call, wait: bool) -> Done:
    vehicle, p = call.vehicle, call.params(BodyOffset)
    return await _drive_to(call, vehicle, lambda: vehicle.body_from_here(p.front, p.right, p.down), p, wait)


async def _drive_to(
    call: Call, vehicle: Vehicle, aim: Callable[[], NedTarget], p: NedPlace | BodyOffset, wait: bool
) -> Done:
    kind = vehicle.kind.capitalize()
    aimed_at: list[NedTarget] = []

    def aim_once() -> NedTarget:
        aimed_at.append(aim())
        return aimed_at[-1]

    def result() -> str:
        if not wait:
            return f"{kind} is driving"
        target = aimed_at[-1]
        return f"{kind} arrived at ({target.x}, {target.y}, {target.z})"

    return await call.fly(vehicle, _going(vehicle, aim_once, p, wait), result)


go_to_gps, go_to_gps_wait = _both("Fly to a latitude, longitude and altitude above home", _go_to_gps)
go_to_ned, go_to_ned_wait = _both("Fly to a place in NED metres from the EKF origin", _go_to_ned)
drive, drive_wait = _both("Fly an NED offset from the present position", _drive)
drive_body, drive_body_wait = _both("Fly an offset in the body frame", _drive_body)


async def travel_at_ned(call: Call) -> Done:
    """Fly at an NED velocity for a duration, or until the autopilot's own timeout."""
    vehicle, p = call.vehicle, call.params(NedVelocity)
    velocity = VelocityTarget(p.vx, p.vy, p.vz)

    async def verb(job: Job) -> None:
        await vehicle.travel(job, velocity, look_at_target=p.look_at_target, heading=p.heading, duration=p.duration)

    return await call.fly(vehicle, verb, f"Travelling at NED velocity ({p.vx}, {p.vy}, {p.vz})")


async def travel_at_body(call: Call) -> Done:
    """Fly at a velocity in the body frame for a duration, or until the autopilot's own timeout."""
    vehicle, p = call.vehicle, call.params(BodyVelocity)

    async def verb(job: Job) -> None:
        vehicle.require_guided_flight()
        velocity = vehicle.velocity_by_heading(p.front, p.right, p.down)
        await vehicle.travel(job, velocity, look_at_target=p.look_at_target, heading=p.heading, duration=p.duration)

    return await call.fly(vehicle, verb, f"Travelling at body velocity ({p.front}, {p.right}, {p.down})")


async def set_heading(call: Call) -> Done:
    """Turn to a heading by the shorter way."""
    vehicle, heading = call.vehicle, call.params(Heading).heading
    return await call.fly(vehicle, lambda job: vehicle.set_heading(job, heading), f"Heading set to {heading} degrees")


async def set_yaw_rate(call: Call) -> Done:
    """Turn at a yaw rate."""
    vehicle, rate = call.vehicle, call.params(YawRate).yaw_rate
    return await call.fly(vehicle, lambda job: vehicle.set_yaw_rate(job, rate), f"Yaw rate set to {rate} deg/s")


async def stop(call: Call) -> Done:
    """Hold a copter still until it is resumed; its movement waits, and no other begins.

    A plane circles in LOITER, or hovers, and a rover stops in HOLD; their movement ends.
    """
    vehicle = call.vehicle
    result = STOPPED.get(vehicle.kind, f"{vehicle.kind.capitalize()} has stopped")
    return await call.fly(vehicle, vehicle.stop, result, outlives_client=True, urgent=True)


async def resume(call: Call) -> Done:
    """Continue the paused guided movement."""
    vehicle = call.vehicle
    return await call.fly(vehicle, vehicle.resume, f"{vehicle.kind.capitalize()} has resumed", outlives_client=True)
