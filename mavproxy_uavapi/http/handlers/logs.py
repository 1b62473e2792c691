"""/logs: the dataflash logs that a vehicle holds, and their download to this machine."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated, TypeVar

from aiohttp import web
from pydantic import Field
from typing_extensions import TypedDict

from mavproxy_uavapi.core.acquire import acquire
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, NotFound, Stale, ToolFailed
from mavproxy_uavapi.core.link.log_pieces import HIGHEST_ID, LogEntry
from mavproxy_uavapi.core.timeout import kept
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.files.log_store import LogFile, LogStore
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import Aged, means
from mavproxy_uavapi.http.contract.requests import Request
from mavproxy_uavapi.http.contract.responses import Done
from mavproxy_uavapi.http.wire.sent_file import send_file

T = TypeVar("T")


class LogRequest(Request):
    """A transfer of logs: `while_armed` asks an armed vehicle, too."""

    while_armed: Annotated[bool, Field(description="ask an armed vehicle, too; an ArduPilot sends nothing then")] = (
        False
    )


class LogDownload(LogRequest):
    """What identifies a download."""

    log: int


class LogView(TypedDict):
    """A log that the vehicle holds."""

    id: Annotated[int, means("its number", 3)]
    size: Annotated[int, means("bytes", 1204224)]
    time: Annotated[str | None, means("when it began, ISO 8601; null if it did not know", "2026-05-04T13:20:07Z")]
    downloaded: Annotated[bool, means("whether this machine has it", False)]


class LogsView(Aged):
    """The logs that the vehicle holds."""

    logs: list[LogView]


async def list_logs(call: Call) -> LogsView:
    """The logs that the vehicle holds: id, size (bytes), and when each began.

    A caller who may only watch gets the last list that somebody else requested.
    """
    known = call.known_vehicle
    if call.caller.flies(known.state.system):
        await call.vehicle.logs.read_list(while_armed=call.params(LogRequest).while_armed)
    newest = known.logs.newest
    if newest is None:
        raise Stale(f"vehicle {known.state.system} was not asked for its logs yet")
    entries, at = newest
    reports = await asyncio.to_thread(_reports, _store(call), known.state.system, entries)
    age = round(max(known.clock() - at, 0.0), 3)
    return {**call.answer("success"), "logs": reports, "age_s": age}


async def download_log(call: Call) -> Done:
    """Download a log from the vehicle to this machine; its job reports `bytes` and `of`."""
    vehicle, number, p = call.vehicle, _number(call), call.params(LogRequest)
    store = _store(call)

    async def verb(job: Job) -> None:
        entry = await vehicle.logs.find(number, while_armed=p.while_armed)
        await _download(vehicle, job, entry, store, while_armed=p.while_armed)

    identity = LogDownload(log=number, while_armed=p.while_armed)
    return await call.fly(vehicle, verb, f"Log {number} downloaded", identity=identity)


async def read_log(call: Call) -> web.StreamResponse:
    """A downloaded log, as a binary file; of several with the same id the last download."""
    vehicle, number = call.known_vehicle, _number(call)
    system, fetching = vehicle.state.system, vehicle.logs.fetching
    file = await asyncio.to_thread(_store(call).find, system, number)
    if file is None and fetching is not None and fetching.id == number:
        raise Busy(f"log {number} of vehicle {system} is being downloaded; /jobs shows how far")
    if file is None:
        raise NotFound(
            f"log {number} of vehicle {system} is not downloaded yet; POST /logs/{number}/download does that"
        )
    with call.one_more_stream():
        return await send_file(call.request, file, file.name, "application/octet-stream")


# -- helpers ------------------------------------------------------------------------------------------------


def _store(call: Call) -> LogStore:
    return LogStore(Path(call.service.settings.vehicle_logs).expanduser().absolute())


def _number(call: Call) -> int:
    text = call.names["id"]
    if not text.isascii() or not text.isdigit() or len(text) > 5 or int(text) > HIGHEST_ID:
        raise NotFound(f"there is no log {text[:32]!r}")
    return int(text)


def _reports(store: LogStore, system: int, entries: Sequence[LogEntry]) -> list[LogView]:
    return [
        {
            "id": entry.id,
            "size": entry.size,
            "time": None if entry.time_utc is None else _iso(entry.time_utc),
            "downloaded": store.has(system, entry),
        }
        for entry in entries
    ]


def _iso(seconds: int) -> str:
    return datetime.fromtimestamp(seconds, timezone.utc).isoformat().replace("+00:00", "Z")


async def _download(vehicle: Vehicle, job: Job, entry: LogEntry, store: LogStore, *, while_armed: bool) -> None:
    """Fetch a log into a file of the store; the file appears when it is complete."""
    file = await _on_disk(store, lambda: store.create(vehicle.state.system, entry))

    async def save(parts: Sequence[tuple[int, bytes]]) -> None:
        await _on_disk(store, lambda: file.write(parts))

    def report(done: int, of: int) -> None:
        job.progress = {"bytes": done, "of": of}

    report(0, entry.size)
    try:
        await vehicle.logs.fetch(entry, save, report, while_armed=while_armed)
        await _on_disk(store, file.finish)
    finally:
        await kept(asyncio.to_thread(_discard, file))


def _discard(file: LogFile) -> None:
    with suppress(OSError):  # the disk is full: what could not be written is not wanted
        file.discard()


async def _on_disk(store: LogStore, action: Callable[[], T]) -> T:
    """What `action` returns, from a thread.

    Raises:
        ToolFailed: the disk refuses.
    """
    try:
        return await acquire(asyncio.to_thread(action))
    except OSError as error:
        raise ToolFailed(f"cannot save a log in {store.folder}: {error.strerror}") from error
