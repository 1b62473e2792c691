"""Several records into one, by time: those of several MAVProxys that saw the same flight. Blocking.

Each record has the clock of its own machine, and nothing here corrects it. What two of them have of one vehicle is
there once: its telemetry from the record that has had it so far, while that has it; an event, a text or an entry of
the trail from the first that has it.
"""

from __future__ import annotations

import hashlib
import heapq
import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.flights.flight_file import (
    FlightFile,
    FlightMessage,
    attachments_of,
    encoded_messages_of,
    metadata_of,
)
from mavproxy_uavapi.flights.flight_store import Flight, FlightStore, utc

SILENT = 1_000_000_000  # ns without a topic in one record after which another one's counts
ALIKE = 2_000_000_000  # ns between two that tell of the same
REMEMBERED = 10_000  # of those that are held against each other
SHOWN = ("uavapi.View", "foxglove.LocationFix", "foxglove.PoseInFrame")  # newest values, not events
EVENTS = ("uavapi.Event", "foxglove.Log")
OWN_TIMES = ("time", "clock", "timestamp", "dropped", "id")  # members that two records of one event have apart


def merge(store: FlightStore, names: Sequence[str], name: str) -> Flight:
    """Make a record of several.

    Args:
        store: where they are, and where it goes.
        names: ids of flights, or paths of .mcap files.
        name: what it is called.

    Raises:
        BadRequest: one of them is no record.
        NotFound: there is none of that id.
        OSError: the disk refuses.
    """
    files = [Path(one) if one.endswith(".mcap") else store.file(store.find(one)) for one in names]
    known = [_known_of(file) for file in files]
    first = min((next(encoded_messages_of(file)).time for file in files), default=0)
    systems = {int(system) for one in known for system in one["flight"]["vehicles"].split(",") if system}
    last = first

    def messages() -> Iterator[FlightMessage]:
        nonlocal last
        for message in _once(files):
            last = max(last, message.time)
            yield message

    with store.making(first / 1e9, name) as (flight, target):
        target.write_many(messages())
        _copy_files(files, target)
        target.note("versions", _versions(known))
        notes = "merged from " + ", ".join(one["flight"]["id"] for one in known)
        known_now = replace(flight, vehicles=tuple(sorted(systems)), ended=utc(last / 1e9), notes=notes)
        store.finish(known_now, target)
    return store.pack(flight.id)


def _known_of(file: Path) -> Mapping[str, Mapping[str, str]]:
    """What a record says of itself.

    Raises:
        BadRequest: it is none, or it is not complete.
    """
    try:
        known = metadata_of(file)
        next(encoded_messages_of(file))
    except (McapError, StopIteration, struct.error) as error:
        raise BadRequest(f"{file.name} is not the complete record of a flight") from error
    if "flight" not in known:
        raise BadRequest(f"{file.name} is not the record of a flight")
    return known


def _versions(known: Sequence[Mapping[str, Mapping[str, str]]]) -> dict[str, str]:
    """All versions; those that differ from the first record's have its number."""
    versions: dict[str, str] = {}
    for number, one in enumerate(known, 1):
        for name, version in one.get("versions", {}).items():
            if versions.setdefault(name, version) != version:
                versions[f"{name} ({number})"] = version
    return versions


def _copy_files(files: Sequence[Path], target: FlightFile) -> None:
    """Attach the files of all records; one that differs from another of its name gets the number of its record."""
    kept: dict[str, bytes] = {}
    for number, file in enumerate(files, 1):
        for one in attachments_of(file):
            if one.name in kept and one.data == kept[one.name]:
                continue
            path = Path(one.name)
            name = f"{path.stem}-{number}{path.suffix}" if one.name in kept else one.name
            kept[name] = one.data
            target.attach(name, one.media_type, one.data, one.log_time)


def _once(files: Sequence[Path]) -> Iterator[FlightMessage]:
    """The messages of all files by time, without what another one has told already."""

    def numbered(number: int, file: Path) -> Iterator[tuple[int, FlightMessage]]:
        return ((number, message) for message in encoded_messages_of(file))

    streams = [numbered(number, file) for number, file in enumerate(files)]
    owners: dict[Any, tuple[int, int]] = {}  # by topic: the record that counts, and when it was there last
    told: dict[Any, tuple[int, int]] = {}  # the same by what was told
    for number, message in heapq.merge(*streams, key=lambda one: one[1].time):
        is_shown = message.schema in SHOWN
        book, key = (owners, message.topic) if is_shown else (told, _content_of(message))
        owner, at = book.get(key, (number, message.time))
        if owner != number and message.time - at < (SILENT if is_shown else ALIKE):
            continue
        book.pop(key, None)
        book[key] = number, message.time
        if len(told) > REMEMBERED:
            del told[next(iter(told))]
        yield message


def _content_of(message: FlightMessage) -> bytes:
    """A hash of what two records of one event have alike."""
    content = message.data
    if message.schema in EVENTS:
        members: dict[str, Any] = json.loads(content)
        alike = {name: value for name, value in members.items() if name not in OWN_TIMES}
        if "info" in alike:
            alike["info"] = {name: value for name, value in members["info"].items() if name not in OWN_TIMES}
        content = json.dumps(alike, sort_keys=True).encode()
    return hashlib.blake2b(message.topic.encode() + b"\0" + content).digest()
