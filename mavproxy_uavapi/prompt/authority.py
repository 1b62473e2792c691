"""`uavapi authority [take|release [SYSID …]]` at the prompt: who holds the vehicles."""

from __future__ import annotations

from collections.abc import Sequence

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.roles import THE_PROMPT
from mavproxy_uavapi.core.text import joined
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

USAGE = "authority takes `take` or `release` and, for some vehicles only, their system ids"


async def command(host: Host, args: Sequence[str]) -> str:
    """Run the command, for every known vehicle if none is named; a line for each.

    Raises:
        BadRequest: no such command, or a word is no system id.
        NoVehicle: none such was heard.
    """
    word, numbers = (args[0] if args else ""), args[1:]
    if word not in ("", "take", "release") or not all(number.isdecimal() for number in numbers):
        raise BadRequest(USAGE)
    vehicles = [host.registry.find(system) for system in [int(n) for n in numbers] or sorted(host.fleet.vehicles)]
    for vehicle in vehicles:
        if word == "take":
            host.leases.take_hold(vehicle, THE_PROMPT, 0)
        elif word == "release":
            host.leases.release_hold(vehicle, THE_PROMPT)
    return joined(["authority", *(_line(host, vehicle) for vehicle in vehicles)])


def _line(host: Host, vehicle: Vehicle) -> str:
    hold, job = host.leases.hold(vehicle), vehicle.authority.flies
    held = "nobody holds it" if hold is None else f"{hold.holder} holds it"
    remaining = None if hold is None else hold.remaining(host.clock())
    if hold is not None and hold.operator is not None and remaining is not None:
        held += f" ({hold.operator.role.word}, {remaining:.0f} s without a call)"
    commanded = "" if job is None else f"; {job.client} commands: {job.verb}"
    if job is None and vehicle.state.armed and vehicle.has_foreign_target:
        commanded = "; another station commands"
    return f"  vehicle {vehicle.state.system}: {held}{commanded}"
