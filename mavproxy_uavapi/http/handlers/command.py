"""/command: arm, take off, land, modes, speeds, home."""

from __future__ import annotations

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.mainloop.permit import no_check
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission
from mavproxy_uavapi.core.vehicle.reboot import reboot as reboot_of
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import (
    Blocking,
    Disarm,
    LandAt,
    ModeName,
    NewSpeed,
    Reverse,
    SimFactor,
    Takeoff,
)
from mavproxy_uavapi.http.contract.responses import Done
from mavproxy_uavapi.http.contract.route import Action
from mavproxy_uavapi.http.handlers.rehearsals import require_rehearsed_mission

HEARTBEAT = 1.25  # s of the vehicle's clock within which the next one is there
LANDED = {"plane": "Landed successfully"}  # by type of vehicle; clients expect these texts
RETURNED = {"copter": "Landed at home successfully"}


async def arm(call: Call) -> Done:
    """Wait until the vehicle is ready, switch to GUIDED and arm."""
    vehicle, p = call.vehicle, call.params(Blocking)
    return await call.fly(vehicle, lambda job: vehicle.arm(job, p.timeout), "Armed vehicle")


async def disarm(call: Call) -> Done:
    """Disarm; refused in flight unless forced."""
    vehicle, p = call.vehicle, call.params(Disarm)
    return await call.fly(
        vehicle, lambda job: vehicle.disarm(job, p.force), "Disarmed vehicle", outlives_client=True, urgent=True
    )


async def takeoff(call: Call) -> Done:
    """Take off to an altitude above home."""
    vehicle, p = call.vehicle, call.params(Takeoff)
    result = f"Takeoff successful! Vehicle at {p.alt} meters"
    return await call.fly(vehicle, lambda job: vehicle.takeoff(job, p.alt, vtol=p.vtol, timeout=p.timeout), result)


async def land(call: Call) -> Done:
    """Land and disarm: a copter or QuadPlane where it is, another plane by its mission's landing."""
    vehicle, p = call.vehicle, call.params(Blocking)
    result = LANDED.get(vehicle.kind, "Landed at home successfully")
    return await call.fly(
        vehicle, lambda job: vehicle.land(job, p.timeout), result, outlives_client=True, urgent=True
    )


async def land_at(call: Call) -> Done:
    """Begin to land a plane at a place, by a mission that replaces its own; answers when the plane flies it."""
    vehicle, p = call.vehicle, call.params(LandAt)
    call.require_unheld(vehicle)  # it does more than stop: it flies to a place that the caller names
    return await call.fly(
        vehicle,
        lambda job: vehicle.land_at(job, p.lat, p.long, p.alt, vtol=p.vtol),
        f"Landing mission started for coord ({p.lat}, {p.long})",
        outlives_client=True,
        urgent=True,
    )


async def rtl(call: Call) -> Done:
    """Return to launch: a copter lands there and disarms, a plane circles there, a rover stops there."""
    vehicle, p = call.vehicle, call.params(Blocking)
    result = RETURNED.get(vehicle.kind, "Returned to launch")
    return await call.fly(vehicle, lambda job: vehicle.rtl(job, p.timeout), result, outlives_client=True, urgent=True)


async def brake(call: Call) -> Done:
    """Stop at once: a copter in BRAKE mode, a plane by circling in LOITER or hovering, a rover in HOLD."""
    vehicle = call.vehicle
    result = f"{vehicle.kind.capitalize()} braking. Use /command/guided to enable movement commands again"
    return await call.fly(vehicle, vehicle.brake, result, outlives_client=True, urgent=True)


async def reboot(call: Call) -> Done:
    """Boot the autopilot again; refused while the vehicle is armed."""
    vehicle = call.vehicle
    return await call.fly(vehicle, lambda job: reboot_of(vehicle, job), "The autopilot has booted")


async def set_reverse(call: Call) -> Done:
    """Drive a rover backwards, or forwards again."""
    vehicle, p = call.vehicle, call.params(Reverse)
    result = f"Driving {'backwards' if p.reverse else 'forwards'}"
    return await call.fly(vehicle, lambda job: vehicle.set_reverse(job, p.reverse), result)


async def guided(call: Call) -> Done:
    """Switch to GUIDED, in which movement commands work."""
    vehicle = call.vehicle
    result = f"{vehicle.kind.capitalize()} in GUIDED mode"
    return await call.fly(vehicle, lambda job: vehicle.set_mode(job, "GUIDED"), result)


async def set_mode(call: Call) -> Done:
    """Switch to any mode of the vehicle's type."""
    vehicle, mode = call.vehicle, call.params(ModeName).mode
    require_unchanged = await require_rehearsed_mission(call, vehicle) if flies_mission(mode.upper()) else no_check

    async def verb(job: Job) -> None:
        require_unchanged()
        await vehicle.set_mode(job, mode)

    return await call.fly(vehicle, verb, f"Mode {mode}")


def _speed_setter(kind: str) -> Action:
    """The handler that sets a speed of that kind."""

    async def set_speed(call: Call) -> Done:
        speed = call.params(NewSpeed).new_v
        vehicle = call.vehicle
        in_force: list[bool] = []

        async def verb(job: Job) -> None:
            in_force.append(await vehicle.set_speed(job, kind, speed))

        def result() -> str:
            condition = "" if in_force[0] else "; it takes effect when the vehicle flies in GUIDED"
            return f"{kind.capitalize()} speed set to {speed}m/s{condition}"

        return await call.fly(vehicle, verb, result)

    set_speed.__name__, set_speed.__doc__ = f"set_{kind}_speed", f"Set the {kind} speed (m/s)."
    return set_speed


set_air_speed, set_ground_speed = _speed_setter("air"), _speed_setter("ground")
set_climb_speed, set_descent_speed = _speed_setter("climb"), _speed_setter("descent")


async def set_sim_speedup(call: Call) -> Done:
    """Set how much faster than real time a simulated vehicle flies."""
    vehicle, factor = call.vehicle, call.params(SimFactor).sim_factor
    needed = HEARTBEAT / factor
    if needed > call.service.host.link_watch.timeout:
        raise Invalid(f"its heartbeats come too late: set link_timeout to {needed:g} s or more first", "sim_factor")
    result = f"Simulation speedup set to {factor}x"
    return await call.fly(vehicle, lambda _: vehicle.set_sim_speedup(factor), result)


async def set_home(call: Call) -> Done:
    """Make the current position home."""
    vehicle = call.vehicle
    return await call.fly(vehicle, vehicle.set_home, "Home location set successfully!")
