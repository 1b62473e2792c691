"""Reads a complete flight's file at the moments that are asked for, by its index. Blocking."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk

from mavproxy_uavapi.core.errors import Invalid, NotFound
from mavproxy_uavapi.flights.flight_file import STREAMED
from mavproxy_uavapi.flights.flight_overview import NAME

MOST_EVENTS = 50_000  # of one answer
RECORD_HEAD = 9  # bytes before what is in a record: what it is, and its length


class _Chunks(NamedTuple):
    """Where a file's messages are.

    Attributes:
        began: ns since 1970 of the earliest one.
        places: of each chunk: ns of its first and its last message, and its offset in the file (bytes).
        ours: the channels that have what the stream had.
    """

    began: int
    places: list[tuple[int, int, int]]
    ours: frozenset[int]


@lru_cache(maxsize=8)
def _chunks_of(path: Path, _changed: int) -> _Chunks:
    """The index of a file, which takes longer to read than a moment of the flight: that of an hour 0.3 s."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        return _Chunks(0, [], frozenset())
    schemas = {number for number, schema in summary.schemas.items() if schema.name in STREAMED}
    ours = frozenset(channel.id for channel in summary.channels.values() if channel.schema_id in schemas)
    places = [(one.message_start_time, one.message_end_time, one.chunk_start_offset) for one in summary.chunk_indexes]
    return _Chunks(summary.statistics.message_start_time, places, ours)


def overview_of(path: Path) -> bytes:
    """The overview of a flight, as it is written in the file.

    Raises:
        NotFound: it has none: it is older than overviews.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        for attachment in make_reader(file).iter_attachments():
            if attachment.name == NAME:
                return attachment.data
    raise NotFound(f"{path.name} has no overview")


def events_of(path: Path, at: float, seconds: float) -> bytes:
    """What the stream had in a span of time, as JSON: `{"events": […]}`.

    Args:
        path: the file.
        at: s since its first message.
        seconds: how long.

    Raises:
        Invalid: it has too many events for one answer.
        OSError: it cannot be read.
    """
    chunks = _chunks_of(path, path.stat().st_mtime_ns)
    begins = chunks.began + round(at * 1e9)
    ends = begins + round(seconds * 1e9)
    found: list[Message] = []
    with path.open("rb") as file:
        for first, last, offset in chunks.places:
            if first < ends and last >= begins:
                file.seek(offset + RECORD_HEAD)
                found += [
                    record
                    for record in breakup_chunk(Chunk.read(ReadDataStream(file)))
                    if isinstance(record, Message)
                    and record.channel_id in chunks.ours
                    and begins <= record.log_time < ends
                ]
                if len(found) > MOST_EVENTS:
                    raise Invalid(f"there are more than {MOST_EVENTS} events in {seconds:g} s", "seconds")
    found.sort(key=lambda message: message.log_time)
    return b'{"events":[' + b",".join(message.data for message in found) + b"]}"
