"""Reads a complete flight's file at the moments that are asked for, by its index. Blocking."""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader

from mavproxy_uavapi.core.errors import Invalid, NotFound
from mavproxy_uavapi.flights.flight_overview import NAME

MOST_EVENTS = 50_000  # of one answer


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
    events: list[bytes] = []
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            return b'{"events":[]}'
        ours = {number for number, schema in summary.schemas.items() if schema.name.startswith("uavapi.")}
        topics = [channel.topic for channel in summary.channels.values() if channel.schema_id in ours]
        began = summary.statistics.message_start_time + round(at * 1e9)
        ends = began + round(seconds * 1e9)
        for _, _, message in reader.iter_messages(topics, starting_at=max(began, 0), ending_before=max(ends, 0)):
            if len(events) == MOST_EVENTS:
                raise Invalid(f"there are more than {MOST_EVENTS} events in {seconds:g} s", "seconds")
            events.append(message.data)
    return b'{"events":[' + b",".join(events) + b"]}"
