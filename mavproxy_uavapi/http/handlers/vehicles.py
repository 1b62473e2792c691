"""/vehicles: every known vehicle, and its commander."""

from __future__ import annotations

import re

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract import answers
from mavproxy_uavapi.http.contract.reports import report_of_vehicle


async def list_vehicles(call: Call) -> answers.VehiclesView:
    """Every vehicle that was heard; the prefix `/vehicles/{sysid}` of any path means that vehicle."""
    host = call.service.host
    return {
        "vehicles": [report_of_vehicle(host, host.registry.find(system)) for system in sorted(host.fleet.vehicles)]
    }


async def show_vehicle(call: Call) -> answers.VehicleView:
    """One vehicle."""
    system, host = call.names["sysid"], call.service.host
    if not re.fullmatch(r"[0-9]{1,3}", system) or int(system) not in host.fleet.vehicles:
        raise NotFound(f"no vehicle {system[:32]} was heard")
    host.registry.use(int(system))
    return report_of_vehicle(host, host.registry.find(int(system)))
