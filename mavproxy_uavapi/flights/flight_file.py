"""The file of a flight: MCAP, in which every message has a time, a topic and a schema. Blocking.

While a flight lasts its file is a journal: each message is a record of its own, so that a file that ends anywhere can
be read up to its last whole record. `pack` then makes the file that one takes home, compressed and with an index; it
is run in a process of its own.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import itertools
import json
import os
import struct
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, Writer

from mavproxy_uavapi import __version__
from mavproxy_uavapi.flights.flight_overview import KIND as OVERVIEW_KIND
from mavproxy_uavapi.flights.flight_overview import NAME as OVERVIEW
from mavproxy_uavapi.flights.flight_overview import Overview

MODE = 0o600  # a flight shows where somebody was
LIBRARY = f"mavproxy-uavapi {__version__}"
CHUNK = 256 * 1024  # bytes that are compressed together: a moment of the flight is read from two or three of them
TOGETHER = 10_000  # messages of one write
STREAMED = ("uavapi.View", "uavapi.Event")  # schemas of what the stream had, as it had it
TRAIL = "history"  # the event that tells of an entry of the trail
# How a message begins: its opcode, the length of what follows, then channel, sequence, log time and publish time.
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
BEFORE_DATA = MESSAGE_HEAD.size - struct.calcsize("<BQ")


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
_TIME = _object(sec={"type": "integer"}, nsec={"type": "integer"})
_EVENT = {"system": {"type": "integer"}, "time": _NUMBER, "clock": _NUMBER, "info": {"type": "object"}}
SCHEMAS: Mapping[str, Mapping[str, Any]] = {
    "uavapi.View": _object(view=_TEXT, **_EVENT),
    "uavapi.Event": _object(event=_TEXT, **_EVENT),
    "foxglove.LocationFix": _object(
        timestamp=_TIME,
        frame_id=_TEXT,
        latitude=_NUMBER,
        longitude=_NUMBER,
        altitude=_NUMBER,
        position_covariance={"type": "array", "items": _NUMBER},
        position_covariance_type={"type": "integer"},
    ),
    "foxglove.PoseInFrame": _object(
        timestamp=_TIME,
        frame_id=_TEXT,
        pose=_object(
            position=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER),
            orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
        ),
    ),
    "uavapi.Reading": _object(device=_TEXT, quantity=_TEXT, representation=_TEXT, time=_NUMBER),
    "foxglove.CompressedImage": _object(
        timestamp=_TIME, frame_id=_TEXT, format=_TEXT, data={"type": "string", "contentEncoding": "base64"}
    ),
    "foxglove.Log": _object(
        timestamp=_TIME,
        level={"type": "integer"},
        message=_TEXT,
        name=_TEXT,
        file=_TEXT,
        line={"type": "integer"},
    ),
}


class FlightMessage(NamedTuple):
    """A message for the file.

    Attributes:
        topic: such as `/1/gps`.
        schema: its name in `SCHEMAS`.
        time: ns since 1970.
        data: JSON.
    """

    topic: str
    schema: str
    time: int
    data: bytes


class FlightFile:
    """A journal that is being written.

    Args:
        path: of a new file.

    Attributes:
        path: the same.

    Raises:
        OSError: it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, MODE), "wb")
        fcntl.flock(self._file, fcntl.LOCK_EX)  # another MAVProxy of this machine leaves it alone
        self._file.write(MCAP0_MAGIC)
        self._add(Header(profile="", library=LIBRARY))
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, records: Iterable[FlightMessage]) -> None:
        """Add messages, and bring them to the disk."""
        for record in records:
            channel = self._channels.get(record.topic) or self._register(record)
            length = BEFORE_DATA + len(record.data)
            self._file.write(MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channel, 0, record.time, record.time))
            self._file.write(record.data)
        self._sync()

    def write_many(self, records: Iterator[FlightMessage]) -> None:
        """Add messages of any number, a part after the other."""
        while part := list(itertools.islice(records, TOGETHER)):
            self.write(part)

    def attach(self, name: str, kind: str, data: bytes, time: int) -> None:
        """Add a file, of a media type, at a time in ns since 1970."""
        self._add(Attachment(create_time=time, log_time=time, name=name, media_type=kind, data=data))
        self._sync()

    def note(self, name: str, known: dict[str, str]) -> None:
        """Add what is known of the flight."""
        self._add(Metadata(name=name, metadata=known))
        self._sync()

    def close(self, about: dict[str, str]) -> None:
        """End it, with what is known of the flight."""
        try:
            self._add(Metadata(name="flight", metadata=about))
            self._add(DataEnd(data_section_crc=0))
            self._add(Footer(summary_start=0, summary_offset_start=0, summary_crc=0))
            self._file.write(MCAP0_MAGIC)
            self._sync()
        finally:
            self._let_go()

    def abandon(self) -> None:
        """Leave it as it is: the disk refuses more."""
        with suppress(OSError):
            self._let_go()

    def _let_go(self) -> None:
        if self._file.closed:
            return
        fcntl.flock(self._file, fcntl.LOCK_UN)  # a forked child may have it open yet
        self._file.close()

    def _register(self, record: FlightMessage) -> int:
        """The id of a new channel: from 1 on, like those of schemas."""
        schema = self._schemas.get(record.schema)
        if schema is None:
            schema = self._schemas[record.schema] = len(self._schemas) + 1
            text = json.dumps(SCHEMAS.get(record.schema, {"type": "object"})).encode()
            self._add(Schema(id=schema, name=record.schema, encoding="jsonschema", data=text))
        channel = self._channels[record.topic] = len(self._channels) + 1
        self._add(Channel(id=channel, topic=record.topic, message_encoding="json", metadata={}, schema_id=schema))
        return channel

    def _add(self, record: McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())  # type: ignore[no-untyped-call]

    def _sync(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())
        if os.fstat(self._file.fileno()).st_nlink == 0:  # the system would take it all, and keep nothing
            raise FileNotFoundError(errno.ENOENT, "it was removed", str(self.path))


@contextmanager
def claimed(path: Path) -> Iterator[bool]:
    """Hold a journal, unless somebody writes or packs it; gives whether it is held.

    Raises:
        FileNotFoundError: it is not there.
    """
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True


class RecordedMessage(NamedTuple):
    """A message that was read from a file.

    Attributes:
        topic: such as `/1/gps`.
        schema: its name.
        time: s since 1970.
        data: the message.
    """

    topic: str
    schema: str
    time: float
    data: dict[str, Any]


def records_of(path: Path) -> Iterator[McapRecord]:
    """The whole records of a file, in the order in which they were written; a torn end is left out.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        try:
            yield from StreamReader(file).records
        except (McapError, struct.error, UnicodeDecodeError):
            return  # it ends in the middle of a record: whoever wrote it was killed


def encoded_messages_of(path: Path, only: str = "") -> Iterator[FlightMessage]:
    """The messages of a file whose data is JSON, as `records_of` has them; `only` those of a schema."""
    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    for record in records_of(path):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message) and channels[record.channel_id].message_encoding == "json":
            topic, schema = channels[record.channel_id].topic, schemas[channels[record.channel_id].schema_id]
            if only in ("", schema):
                yield FlightMessage(topic, schema, record.log_time, record.data)


def messages_of(path: Path, only: str = "") -> Iterator[RecordedMessage]:
    """The same, decoded."""
    for topic, schema, stamp, data in encoded_messages_of(path, only):
        yield RecordedMessage(topic, schema, stamp / 1e9, json.loads(data))


def attachments_of(path: Path) -> Iterator[Attachment]:
    """The files in a file; its overview is none of them."""
    return (record for record in records_of(path) if isinstance(record, Attachment) and record.name != OVERVIEW)


def metadata_of(path: Path) -> dict[str, dict[str, str]]:
    """What a packed file says of itself, by name: `flight`, `versions`, `manifest`."""
    with path.open("rb") as file:
        return {record.name: record.metadata for record in make_reader(file).iter_metadata()}


def pack(source: Path, target: Path, about: dict[str, str]) -> int:
    """Write a journal anew, compressed, with an index, an overview and what is known of it; returns its messages."""
    partial = target.with_suffix(".packing")
    count, overview = 0, Overview()
    metadata: dict[str, dict[str, str]] = {"manifest": {}}  # the newest of each name
    with os.fdopen(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, MODE), "wb") as file:
        writer = Writer(file, chunk_size=CHUNK)
        writer.start(library=LIBRARY)
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        names: dict[int, str] = {}  # of schemas
        seen: dict[int, tuple[str, str]] = {}  # topic and schema, by channel
        for record in records_of(source):
            if isinstance(record, Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                names[record.id] = record.name
            elif isinstance(record, Channel) and record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                )
                seen[record.id] = record.topic, names[record.schema_id]
            elif isinstance(record, Message):
                count += 1
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
                overview.see(*seen[record.channel_id], record.log_time / 1e9, record.data)
            elif isinstance(record, Attachment) and record.name != OVERVIEW:
                writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
                overview.see_attachment(record.name, record.data)
                metadata["manifest"][record.name] = hashlib.sha256(record.data).hexdigest()
            elif isinstance(record, Metadata) and record.name != "manifest":
                metadata[record.name] = record.metadata
        now = time.time_ns()
        writer.add_attachment(now, now, OVERVIEW, OVERVIEW_KIND, overview.written())
        for name, known in {**metadata, "flight": about}.items():
            writer.add_metadata(name, known)
        writer.finish()  # type: ignore[no-untyped-call]
        file.flush()
        os.fsync(file.fileno())
    partial.replace(target)
    return count
