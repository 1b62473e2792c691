"""/vehicles: every known vehicle, and its commander."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.vehicle.readiness import status
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.telemetry_views import gps


async def list_vehicles(call: Call) -> dict[str, Any]:
    """Every vehicle that was heard; the prefix `/vehicles/{sysid}` of any path means that vehicle."""
    registry = call.service.host.registry
    return {
        "vehicles": [describe(call, registry.find(system)) for system in sorted(call.service.host.fleet.vehicles)]
    }


async def show_vehicle(call: Call) -> dict[str, Any]:
    """One vehicle."""
    system = call.names["sysid"]
    if not system.isascii() or not system.isdigit() or int(system) not in call.service.host.fleet.vehicles:
        raise NotFound(f"no vehicle {system} was heard")
    return describe(call, call.service.host.registry.find(int(system)))


def describe(call: Call, vehicle: Vehicle) -> dict[str, Any]:
    """A vehicle as an answer body."""
    host, state = call.service.host, vehicle.state
    now = host.clock()
    info = status(vehicle, host.link_watch.is_alive(state), now)
    return {
        "id": state.system,
        "type": info.pop("vehicle_type"),
        **info,
        **_position(vehicle, now),
        "current": state.system == host.registry.resolve(),
        "commanded_by": _commander(vehicle),
    }


def _position(vehicle: Vehicle, now: float) -> dict[str, Any]:
    """Position, velocity and heading as in `/telemetry/gps`, and their age (s); None while unknown."""
    received = vehicle.state.newest("GLOBAL_POSITION_INT")
    if received is None:
        return {"position": None, "velocity": None, "heading": None, "age_s": None}
    return {**gps(received.message), "age_s": round(now - received.at, 3)}


def _commander(vehicle: Vehicle) -> dict[str, Any] | None:
    """The job that flies the vehicle; None if there is none."""
    job = vehicle.authority.flies
    return None if job is None else {"job": job.id, "verb": job.verb, "client": job.client}
