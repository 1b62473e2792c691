"""`uavapi flight [start NAME [SYSID …]|stop]` at the prompt: the records of flights."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.text import joined
from mavproxy_uavapi.flights.flight_store import Flight
from mavproxy_uavapi.flights.recorder import FlightRecorder

USAGE = "flight takes nothing, or `start NAME` and for some vehicles only their system ids, or `stop`"
SHOWN = 5  # newest flights


async def command(host: Host, recorder: FlightRecorder, args: Sequence[str]) -> str:
    """Run the command.

    Raises:
        BadRequest: no such command, or no vehicle to record.
        NoVehicle: none such was heard.
        NotFound: no flights are recorded here.
        ToolFailed: the disk refuses.
    """
    word, rest = (args[0] if args else ""), args[1:]
    if word == "start" and rest and all(number.isdecimal() for number in rest[1:]):
        systems = [host.registry.find(int(number)).state.system for number in rest[1:]] or sorted(host.fleet.vehicles)
        if not systems:
            raise BadRequest("no vehicle was heard yet")
        return f"flight {(await recorder.begin(rest[0], '', systems)).id} is recorded until `uavapi flight stop`"
    if word == "stop" and not rest:
        ended = [await recorder.end(flight.id) for flight in recorder.recording if flight.name]
        return joined(["flight", *map(_line, ended)]) if ended else "no flight with a name is recorded"
    if word:
        raise BadRequest(USAGE)
    now, store = {flight.id: flight for flight in recorder.recording}, recorder.store
    flights = [now.get(flight.id, flight) for flight in (await asyncio.to_thread(store.all))[:SHOWN]]
    return joined(["flight", *map(_line, flights), f"all of them: {store.folder}"])


def _line(flight: Flight) -> str:
    vehicles = ", ".join(map(str, flight.vehicles))
    what = f"{flight.name!r}, vehicle {vehicles}" if flight.name else f"vehicle {vehicles}"
    return f"  {flight.id}: {what}, {flight.state}, {flight.messages} messages"
