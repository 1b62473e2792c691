"""/flights: what was recorded of each flight, as one file to take home."""

from __future__ import annotations

import asyncio
import struct
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from aiohttp import web
from mcap.exceptions import McapError
from pydantic import Field
from typing_extensions import TypedDict

from mavproxy_uavapi.core.errors import Busy, Forbidden, Invalid, NotFound, ToolFailed
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.flights.commands import calm
from mavproxy_uavapi.flights.flight_comparison import MISSION, WayComparison, compare_flights, compare_mission
from mavproxy_uavapi.flights.flight_overview import unpacked
from mavproxy_uavapi.flights.flight_reader import events_of, overview_of
from mavproxy_uavapi.flights.flight_store import COMPLETE, Flight
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import means
from mavproxy_uavapi.http.contract.requests import HIGHEST_SYSTEM, Number, Request, Written
from mavproxy_uavapi.http.wire.sent_file import send_file
from mavproxy_uavapi.programs.program import run_tool
from mavproxy_uavapi.scripts.manager import PRINTED_BY

T = TypeVar("T")
EXPORTING = 600.0  # s that making a zip may take
LONGEST_SPAN = 30.0  # s of flight in one answer
FILE, JSON = "application/octet-stream", "application/json"  # other types of files no maker of clients takes


class NewFlight(Request):
    """A record with a name: of these vehicles, or of all that are known, until it is ended."""

    name: Annotated[str, Field(min_length=1, max_length=80, description="what it is called", examples=["survey 3"])]
    notes: Annotated[str, Field(max_length=2000, description="what should be known of it")] = ""
    vehicles: Annotated[
        list[Annotated[int, Field(ge=1, le=HIGHEST_SYSTEM), Written]],
        Field(max_length=HIGHEST_SYSTEM, description="system ids; omitted for every vehicle that is known"),
    ] = []


class ExportOptions(Request):
    """`rate`: rows in a second of the tables."""

    rate: Annotated[Number, Field(gt=0, le=50, description="rows in a second of the tables")] = 5.0


class Span(Request):
    """Which moments of a flight."""

    at: Annotated[Number, Field(ge=0, le=1e7, description="s since its beginning")] = 0.0
    seconds: Annotated[Number, Field(gt=0, le=LONGEST_SPAN, description="how long, in s")] = 5.0


class Other(Request):
    """With which flight, and which vehicle's way."""

    other: Annotated[
        str,
        Field(
            max_length=200,
            description=f"id of the other flight, or `{MISSION}`",
            examples=["20260504-141203-survey-4"],
        ),
    ]
    vehicle: Annotated[
        int | None, Field(ge=1, le=HIGHEST_SYSTEM, description="system id; omitted for the first in both"), Written
    ] = None


class RecordedFlight(TypedDict):
    """What is known of a flight."""

    id: Annotated[str, means("names it", "20260504-132007-survey-3")]
    name: Annotated[str, means("as somebody gave it; empty: from arming to disarming of its vehicle", "survey 3")]
    notes: Annotated[str, means("as somebody gave them", "")]
    vehicles: Annotated[list[int], means("system ids", [1])]
    began: Annotated[str, means("UTC, ISO 8601", "2026-05-04T13:20:07+00:00")]
    ended: Annotated[str, means("the same; empty while it lasts, or if the program ended before it", "")]
    state: Annotated[str, means("recording; ended: it is being packed; complete", "complete")]
    messages: Annotated[int, means("in its file", 18210)]
    lost: Annotated[int, means("messages that came faster than they could be written", 0)]
    bytes: Annotated[int, means("size of the complete file", 910113)]
    sha256: Annotated[str, means("of the complete file", "")]
    version: Annotated[str, means("of the program that wrote it", "0.1.0")]
    versions: Annotated[
        dict[str, str],
        means("of what took part, as far as it is known", {"vehicle-1": "ArduCopter V4.6.3 (3fc7011a)"}),
    ]
    files: Annotated[dict[str, str], means("the SHA-256 of each file in it", {})]


class FlightsView(TypedDict):
    """The flights, the newest first."""

    flights: list[RecordedFlight]


async def list_flights(call: Call) -> FlightsView:
    """The flights that were recorded on this machine, the newest first."""
    recorder = call.service.flights
    running = {flight.id: flight for flight in recorder.recording}
    flights = await asyncio.to_thread(recorder.store.all)
    return {"flights": [_view(running.get(flight.id, flight)) for flight in flights]}


async def begin_flight(call: Call) -> RecordedFlight:
    """Begin a record with a name, of one or several vehicles; it lasts until it is ended."""
    p, known = call.params(NewFlight), call.service.host.fleet.vehicles
    systems = sorted(set(p.vehicles)) or [system for system in sorted(known) if call.caller.flies(system)]
    if not systems and not known:
        raise Invalid("no vehicle was heard yet; name the ones that are meant")
    for system in systems or known:
        call.require_right(system)
    return _view(await call.service.flights.begin(p.name, p.notes, systems))


async def end_flight(call: Call) -> RecordedFlight:
    """End a record; the vehicle goes on as it was."""
    for system in (await _find(call)).vehicles:
        call.require_right(system)
    return _view(await call.service.flights.end(call.names["id"]))


async def show_flight(call: Call) -> RecordedFlight:
    """What is known of a flight."""
    return _view(await _find(call))


async def remove_flight(call: Call) -> RecordedFlight:
    """Delete a flight's file from this machine."""
    flight = await _find(call)
    await asyncio.to_thread(call.service.flights.store.remove, flight)
    return _view(flight)


async def read_flight(call: Call) -> web.StreamResponse:
    """A flight's file: MCAP, for Foxglove and others; of one that is not complete yet, what there is.

    What scripts printed is for role admin, as everything of scripts; the zip leaves it out for others.
    """
    flight = await _find(call)
    if any(name.startswith(PRINTED_BY) for name in flight.files) and call.caller.role < Role.ADMIN:
        raise Forbidden(f"flight {flight.id} has what a script printed, which is for role admin; its .zip is not")
    with call.one_more_stream():
        try:
            path = call.service.flights.store.file(flight)
            return await send_file(call.request, path, f"{flight.id}.mcap", FILE)
        except OSError as error:
            raise NotFound(f"the file of flight {flight.id} cannot be read: {error.strerror}") from error


async def overview_flight(call: Call) -> web.StreamResponse:
    """A flight at a glance: where its vehicles were, second by second, and what happened."""
    data = await _read(call, overview_of, await _complete(call))
    if "gzip" in call.request.headers.get("Accept-Encoding", ""):
        return web.Response(body=data, content_type=JSON, headers={"Content-Encoding": "gzip"})
    return web.Response(body=await asyncio.to_thread(unpacked, data), content_type=JSON)


async def play_flight(call: Call) -> web.StreamResponse:
    """What the stream had in a span of time of a flight, in its order."""
    span, path = call.params(Span), await _complete(call)
    return web.Response(body=await _read(call, events_of, path, span.at, span.seconds), content_type=JSON)


async def compare_flight(call: Call) -> WayComparison:
    """A vehicle's way in this flight beside its way in another one, or beside its mission, in figures."""
    p, path = call.params(Other), await _complete(call)
    if p.other == MISSION:
        return await _read(call, compare_mission, call.names["id"], path, p.vehicle)
    other = await asyncio.to_thread(call.service.flights.store.find, p.other)
    second = call.service.flights.store.file(_require_complete(other))
    return await _read(call, compare_flights, (call.names["id"], path), (p.other, second), p.vehicle)


async def export_flight(call: Call) -> web.StreamResponse:
    """A flight as a zip: a table for each vehicle (CSV, Parquet), its path (GPX, KML), the trail, texts, files."""
    flight, rate = _require_complete(await _find(call)), call.params(ExportOptions).rate
    store, exports = call.service.flights.store, call.service.flights.exports
    with exports.one_more(), call.one_more_stream(), tempfile.TemporaryDirectory(prefix="uavapi-flight-") as folder:
        target = Path(folder) / f"{flight.id}.zip"
        without = "" if call.caller.role >= Role.ADMIN else PRINTED_BY
        where = ("--folder", str(store.folder), "export", flight.id, "--output", str(target))
        options = (*where, "--rate", f"{rate}", f"--without={without}")
        outcome = await run_tool(calm(*options), EXPORTING)
        if outcome.status != 0:
            raise ToolFailed(f"flight {flight.id} cannot be exported: {outcome.stderr.strip()[-200:]}")
        return await send_file(call.request, target, target.name, FILE)


# -- helpers ------------------------------------------------------------------------------------------------


async def _find(call: Call) -> Flight:
    recorder, name = call.service.flights, call.names["id"]
    for flight in recorder.recording:
        if flight.id == name:
            return flight
    return await asyncio.to_thread(recorder.store.find, name)


async def _read(call: Call, act: Callable[..., T], *args: Any) -> T:
    """What `act` reads of a flight's file, in a thread: few at once, because it takes a processor.

    Raises:
        NotFound: the file is gone, or damaged.
        TooManyRequests: as many are read already.
    """
    with call.service.flights.readers.one_more():
        try:
            return await asyncio.to_thread(act, *args)
        except (OSError, McapError, struct.error) as error:
            raise NotFound(f"the file of flight {call.names['id']} cannot be read") from error


def _require_complete(flight: Flight) -> Flight:
    if flight.state != COMPLETE:
        raise Busy(f"flight {flight.id} is not complete yet")
    return flight


async def _complete(call: Call) -> Path:
    """The file of the flight, which must be complete."""
    return call.service.flights.store.file(_require_complete(await _find(call)))


def _view(flight: Flight) -> RecordedFlight:
    return cast(RecordedFlight, {**asdict(flight), "vehicles": list(flight.vehicles)})
