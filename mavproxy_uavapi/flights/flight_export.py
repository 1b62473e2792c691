"""A flight for other programs: tables by vehicle, its path, what happened, and its files, in one zip. Blocking."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import itertools
import json
import math
import shutil
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mavproxy_uavapi.flights.flight_file import TRAIL, RecordedMessage, attachments_of, messages_of
from mavproxy_uavapi.flights.flight_store import Flight, utc

# Of the views that a table has, and of their members: the column of each.
COLUMNS: Mapping[str, Mapping[str, str]] = {
    "gps": {
        "position.lat": "lat",
        "position.lon": "lon",
        "position.alt": "alt",
        "position.relative_alt": "relative_alt",
        "velocity.vx": "v_north",
        "velocity.vy": "v_east",
        "velocity.vz": "v_down",
        "heading": "heading",
    },
    "ned": {"position.x": "north", "position.y": "east", "position.z": "down"},
    "attitude": {name: name for name in ("roll", "pitch", "yaw")},
    "general": {"groundspeed": "ground_speed", "airspeed": "air_speed", "throttle": "throttle"},
    "battery": {"voltage": "battery_mv", "current": "battery_ca", "battery_remaining": "battery_percent"},
    "gps_raw": {"satelites": "satellites", "fix_type": "fix_type"},
    "status": {"mode": "mode", "armed": "armed"},
}
HEAD = ("time", "seconds", "vehicle")
TABLE = [*HEAD, *(column for columns in COLUMNS.values() for column in columns.values())]
TRAIL_TABLE = (
    *("time", "vehicle", "kind", "sentence"),
    *("client", "verb", "request", "outcome", "detail", "seconds", "sent", "script"),  # of a command
)
READINGS_TABLE = ("time", "device", "quantity", "representation", "value")
PICTURES_TABLE = ("name", "time", "vehicle", "lat", "lon", "alt", "relative_alt", "heading", "bytes", "sha256")
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet evaluates a text that begins with one of these
GAP = 5.0  # s without a message in which a table has no rows
GROUP = 10_000  # rows of Parquet that are written at once
GPX, KML = "http://www.topografix.com/GPX/1/1", "http://www.opengis.net/kml/2.2"

Row = dict[str, Any]


def write_zip(flight: Flight, source: Path, target: Path, rate: float, *, without: str = "") -> None:
    """Write what a flight's file has.

    Args:
        flight: what is known of it.
        source: its file.
        target: the zip.
        rate: rows in a second of the tables.
        without: begins the names of attached files that are left out; empty to leave out none.

    Raises:
        OSError: the disk refuses.
    """
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        known = {"sha256": flight.sha256, "versions": flight.versions, "files": flight.files}
        archive.writestr("flight.json", json.dumps({**flight.about(), **known}, indent=1))
        paths = {system: _write_tables(archive, source, system, rate) for system in flight.vehicles}
        archive.writestr("path.gpx", _gpx(flight, paths))
        archive.writestr("path.kml", _kml(flight, paths))
        _write_csv(archive, "trail.csv", TRAIL_TABLE, trail(source))
        _write_csv(archive, "texts.csv", ("time", "vehicle", "severity", "text"), texts(source))
        _write_csv(archive, "readings.csv", READINGS_TABLE, readings(source))
        _write_csv(archive, "pictures.csv", PICTURES_TABLE, pictures(source))
        sums = _write_files(archive, source, without)
        archive.writestr("SHA256SUMS", "".join(f"{digest}  {name}\n" for name, digest in sums.items()))


def _write_files(archive: zipfile.ZipFile, source: Path, without: str) -> dict[str, str]:
    """Write the attached files and the pictures; returns the SHA-256 of each by its name in the archive."""
    sums: dict[str, str] = {}

    def write(name: str, data: bytes) -> None:
        sums[name] = hashlib.sha256(data).hexdigest()
        archive.writestr(name, data)

    for attachment in attachments_of(source):
        if not without or not attachment.name.startswith(without):
            write(f"files/{Path(attachment.name).name}", attachment.data)
    names = {(seen.data["system"], seen.time): seen.data["info"]["name"] for seen in _events(source, "picture")}
    for seen in messages_of(source, "foxglove.CompressedImage"):
        name = names.get((int(seen.topic.split("/")[1]), seen.time))
        if name is not None:
            write(f"pictures/{Path(name).name}", base64.b64decode(seen.data["data"]))
    return sums


def _write_tables(archive: zipfile.ZipFile, source: Path, system: int, rate: float) -> list[Row]:
    """Write the tables of a vehicle, which may be longer than the memory; returns where it was, once a second."""
    path: list[Row] = []
    due = -math.inf

    def rows() -> Iterator[Row]:
        nonlocal due
        for row in table(source, system, rate):
            if row["seconds"] >= due and None not in (row.get("lat"), row.get("lon"), row.get("alt")):
                due = row["seconds"] + 1.0
                path.append({name: row[name] for name in ("lat", "lon", "alt", "time")})
            yield row

    _write_csv(archive, f"vehicle{system}.csv", TABLE, rows())
    _write_parquet(archive, f"vehicle{system}.parquet", table(source, system, rate))
    return path


def table(source: Path, system: int, rate: float) -> Iterator[Row]:
    """The telemetry of a vehicle: each row has the newest value of each column at its time.

    Args:
        source: a flight's file.
        system: the vehicle's system id.
        rate: rows in a second.

    Yields:
        Columns of `TABLE`: `time` is UTC, ISO 8601; `seconds` since the first row; angles in degrees, north, east,
        down and heights in m, speeds in m/s, `relative_alt` above home and `alt` above sea, the battery in mV and cA.
        There is no row for a time in which nothing was heard.
    """
    newest: Row = {}
    gap = max(GAP, 2.0 / rate)
    began = due = -math.inf
    for seen in messages_of(source, "uavapi.View"):
        if seen.data["system"] != system:
            continue
        if began == -math.inf:
            began = due = seen.time
        if not -gap < seen.time - due < gap:  # nothing was heard meanwhile, or a clock was set
            due = seen.time
        while seen.time >= due + 1.0 / rate and newest:
            due += 1.0 / rate
            yield {"time": _stamp(due), "seconds": round(due - began, 3), "vehicle": system, **newest}
        for member, column in COLUMNS.get(seen.data["view"], {}).items():
            newest[column] = _member(seen.data["info"], member)


def trail(source: Path) -> Iterator[Row]:
    """What was commanded and what happened; see /audit."""
    for seen in _events(source, TRAIL):
        entry = seen.data["info"]
        yield {name: _cell(entry.get(name)) for name in TRAIL_TABLE}


def texts(source: Path) -> Iterator[Row]:
    """What the autopilots said."""
    for seen in _events(source, "statustext"):
        info = seen.data["info"]
        yield {"time": _stamp(seen.time), "vehicle": seen.data["system"], **info, "text": _cell(info["text"])}


def readings(source: Path) -> Iterator[Row]:
    """What sensors measured; see docs/gradys.md."""
    for seen in messages_of(source, "uavapi.Reading"):
        yield {**{name: _cell(value) for name, value in seen.data.items()}, "time": _stamp(seen.data["time"])}


def pictures(source: Path) -> Iterator[Row]:
    """Which pictures were taken, where and when."""
    for seen in _events(source, "picture"):
        yield {**seen.data["info"], "vehicle": seen.data["system"], "time": _stamp(seen.time)}


def _cell(value: Any) -> Any:
    """A cell; a text that a spreadsheet would evaluate gets an apostrophe."""
    if isinstance(value, dict | list):
        return json.dumps(value)
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def _events(source: Path, name: str) -> Iterator[RecordedMessage]:
    return (seen for seen in messages_of(source, "uavapi.Event") if seen.data["event"] == name)


def _member(info: Mapping[str, Any], path: str) -> Any:
    value: Any = info
    for name in path.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _stamp(seconds: float) -> str:
    return utc(seconds, "%Y-%m-%dT%H:%M:%S") + f".{int(seconds % 1 * 1000):03d}Z"


def _write_csv(archive: zipfile.ZipFile, name: str, columns: Sequence[str], rows: Iterable[Row]) -> None:
    with archive.open(name, "w", force_zip64=True) as file, io.TextIOWrapper(file, "utf-8", newline="") as text:
        writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _write_parquet(archive: zipfile.ZipFile, name: str, rows: Iterator[Row]) -> None:
    """Write the table as Parquet, if pyarrow is installed and it has a row."""
    try:
        import pyarrow as pa  # noqa: PLC0415
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        return
    kinds = {"time": pa.string(), "mode": pa.string(), "armed": pa.bool_(), "vehicle": pa.int32()}
    schema = pa.schema([(column, kinds.get(column, pa.float64())) for column in TABLE])
    with tempfile.TemporaryFile() as file:
        with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
            while group := list(itertools.islice(rows, GROUP)):
                writer.write_table(pa.Table.from_pylist([{c: row.get(c) for c in TABLE} for row in group], schema))
        file.seek(0)
        with archive.open(name, "w", force_zip64=True) as target:
            shutil.copyfileobj(file, target)


def _gpx(flight: Flight, paths: Mapping[int, list[Row]]) -> bytes:
    root = ET.Element("gpx", {"xmlns": GPX, "version": "1.1", "creator": "mavproxy-uavapi"})
    for system, rows in paths.items():
        track = ET.SubElement(root, "trk")
        ET.SubElement(track, "name").text = f"{flight.name or flight.id}, vehicle {system}"
        segment = ET.SubElement(track, "trkseg")
        for row in rows:
            point = ET.SubElement(segment, "trkpt", {"lat": f"{row['lat']:.7f}", "lon": f"{row['lon']:.7f}"})
            ET.SubElement(point, "ele").text = f"{row['alt']:.2f}"
            ET.SubElement(point, "time").text = row["time"]
    return bytes(ET.tostring(root, "utf-8", xml_declaration=True))


def _kml(flight: Flight, paths: Mapping[int, list[Row]]) -> bytes:
    root = ET.Element("kml", {"xmlns": KML})
    document = ET.SubElement(root, "Document")
    ET.SubElement(document, "name").text = flight.name or flight.id
    for system, rows in paths.items():
        mark = ET.SubElement(document, "Placemark")
        ET.SubElement(mark, "name").text = f"vehicle {system}"
        line = ET.SubElement(mark, "LineString")
        ET.SubElement(line, "altitudeMode").text = "absolute"
        places = (f"{row['lon']:.7f},{row['lat']:.7f},{row['alt']:.2f}" for row in rows)
        ET.SubElement(line, "coordinates").text = " ".join(places)
    return bytes(ET.tostring(root, "utf-8", xml_declaration=True))
