"""/authority: which operator holds a vehicle; taking it and giving it back sends nothing to the vehicle."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from typing_extensions import TypedDict

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import HoldView, Success, means
from mavproxy_uavapi.http.contract.reports import report_of_authority
from mavproxy_uavapi.http.contract.requests import LONGEST_LEASE, Number, Request, Written
from mavproxy_uavapi.http.contract.responses import envelope

WhichVehicle = Annotated[int | None, Field(ge=1, le=255, description="system id; none for that of the path"), Written]


class Release(Request):
    """`vehicle`: a system id, if the path names none."""

    vehicle: WhichVehicle = None


class Take(Release):
    """`vehicle`: a system id, if the path names none; `lease`: s without a call until the hold ends."""

    lease: Annotated[Number, Field(ge=1, le=LONGEST_LEASE, description="s without a call until the hold ends")] = 30


class CallerView(TypedDict):
    """Who calls, and what the caller may do now."""

    name: Annotated[str, means("of the token, or else the address", "anna")]
    role: Annotated[str, means("watch, fly or admin; watch while the API is read only", "fly")]


class Holds(Success):
    """Who holds and who commands each vehicle."""

    caller: CallerView
    vehicles: list[HoldView]


class HoldAnswer(Success, HoldView):
    """Who holds the vehicle now."""


async def show(call: Call) -> Holds:
    """Who holds and who commands each vehicle; under /vehicles/{sysid} only that one."""
    host, role = call.service.host, Role.WATCH if call.service.settings.read_only else call.caller.role
    caller: CallerView = {"name": call.caller.operator.name, "role": role.word}
    systems = [call.named_system] if call.named_system else sorted(host.fleet.vehicles)
    reports = [report_of_authority(host, host.registry.find(system)) for system in systems]
    return {**envelope(host.registry.resolve(call.system), "success"), "caller": caller, "vehicles": reports}


async def take(call: Call) -> HoldAnswer:
    """Hold a vehicle: others of the same or a lower role do not command it, except to stop it.

    Every call of this operator renews the lease. When it runs out, the hold ends, and the vehicle does what the
    setting `on_lease_end` says, if this operator still commands it.
    """
    p = call.params(Take)
    vehicle, operator = _vehicle(call, p.vehicle), call.caller.operator
    call.service.host.leases.take_hold(vehicle, operator, p.lease)
    return _answer(call, vehicle, f"{operator.name} holds vehicle {vehicle.state.system}")


async def release(call: Call) -> HoldAnswer:
    """Give a vehicle back; what it flies goes on."""
    vehicle = _vehicle(call, call.params(Release).vehicle)
    was_held = call.service.host.leases.release_hold(vehicle, call.caller.operator)
    system = vehicle.state.system
    return _answer(call, vehicle, f"Vehicle {system} is released" if was_held else f"Nobody held vehicle {system}")


def _vehicle(call: Call, named: int | None) -> Vehicle:
    """The vehicle that is meant, if the caller may command it."""
    if named and call.named_system not in (0, named):
        raise Invalid(f"`vehicle` contradicts the path, which names vehicle {call.named_system}", "vehicle")
    vehicle = call.service.host.registry.find(named or call.system)
    call.require_right(vehicle.state.system)
    return vehicle


def _answer(call: Call, vehicle: Vehicle, result: str) -> HoldAnswer:
    return {**envelope(vehicle.state.system, result), **report_of_authority(call.service.host, vehicle)}
