"""`uavapi fleet VERB [SYSID …]` at the prompt: one verb for several vehicles."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import BadRequest, UavApiError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

VERBS: Mapping[str, Callable[[Vehicle, Job], Awaitable[None]]] = {
    "arm": lambda vehicle, job: vehicle.arm(job),
    "brake": lambda vehicle, job: vehicle.brake(job),
    "disarm": lambda vehicle, job: vehicle.disarm(job),
    "guided": lambda vehicle, job: vehicle.set_mode(job, "GUIDED"),
    "land": lambda vehicle, job: vehicle.land(job),
    "rtl": lambda vehicle, job: vehicle.rtl(job),
    "stop": lambda vehicle, job: vehicle.stop(job),
}


async def command(host: Host, args: Sequence[str]) -> str:
    """Run `VERB [SYSID …]`, for every known vehicle if none is named; returns a line per vehicle.

    Raises:
        BadRequest: there is no such verb, or a word is not a system id.
    """
    if not args or args[0] not in VERBS:
        raise BadRequest(f"fleet takes a verb ({', '.join(VERBS)}) and, for some vehicles only, their system ids")
    if not all(word.isdecimal() for word in args[1:]):
        raise BadRequest(f"{' '.join(args[1:])}: expected system ids")
    systems = [int(word) for word in args[1:]] or sorted(host.fleet.vehicles)
    lines = await asyncio.gather(*(_line(host, args[0], system) for system in systems))
    return "\n".join([f"fleet {args[0]}", *lines]) if lines else "no vehicle was heard yet"


async def _line(host: Host, verb: str, system: int) -> str:
    async def body(job: Job) -> str:
        await VERBS[verb](vehicle, job)
        return "done"

    try:
        vehicle = host.registry.commandable(system)
        job = host.jobs.begin(vehicle, f"fleet {verb}", {}, body, outlives_client=True)
        return f"  vehicle {system}: {await job.outcome()}"
    except UavApiError as error:
        return f"  vehicle {system}: {error}"
