"""What `uavapi` shows in MAVProxy's windows: who commands, and the targets that were commanded."""

from __future__ import annotations

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.guided import GuidedVehicle
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.core.windows import View


def view(host: Host) -> View:
    """A part of the line for each vehicle, and a place for each that flies to a target of ours."""
    vehicles = [host.registry.find(system) for system in sorted(host.fleet.vehicles)]
    parts = [f"{vehicle.state.system}: {commander(host, vehicle)}" for vehicle in vehicles]
    places = {
        f"target {vehicle.state.system}": vehicle.target_place
        for vehicle in vehicles
        if isinstance(vehicle, GuidedVehicle) and vehicle.target_place is not None
    }
    return View(f"Commands {'; '.join(parts)}" if parts else "", places)


def commander(host: Host, vehicle: Vehicle) -> str:
    """Who commands a vehicle, and who holds it."""
    job, hold = vehicle.authority.flies, host.leases.hold(vehicle)
    if job is not None:
        who = f"{job.client} {job.verb}"
    elif vehicle.has_foreign_target and vehicle.state.armed:
        who = "another station"
    else:
        who = "nobody"
    return who if hold is None else f"{who} (held by {hold.holder})"
