"""Tracks of GPS_RAW_INT readings: their formats, and the waypoints of a track. Pure.

Two formats are CentMesh's, with one line per reading; both can be read:

    GPS_RAW_INT {time_usec : 251908000, fix_type : 3, lat : 357713121, lon : -786743912, alt : 584090, …}
    (251908000, 357713121, -786743912, 584090, 0, 65535, 0, 0, 3, 10)

The tuple has the fields in wire order. Units are MAVLink's: µs, 1e-7 degrees, mm AMSL, cm/s, 1e-2 degrees.
The third format, GPX 1.1, is for maps; it is only written.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.geodesy import from_deg_e7, offset

TEXT, TUPLE, GPX = "text", "tuple", "gpx"
FORMATS = (TEXT, TUPLE, GPX)
FIX_3D = mavutil.mavlink.GPS_FIX_TYPE_3D_FIX
LOWEST = 2.0  # m above home; lower readings are flown at this height
HIGHEST = 10_000.0  # m above home
CLOSEST = 1.0  # m; a reading that is closer to the last waypoint makes no new one
MOST_WAYPOINTS = 10_000
LONGEST_LINE = 1000  # characters
GROUND = (-500.0, 9000.0)  # m AMSL; the range of the ground's altitude
TEXT_LINE = re.compile(r"GPS_RAW_INT\s*\{(?P<body>[^{}]*)\}")
TUPLE_LINE = re.compile(r"\((?P<body>[-0-9,\s]*)\)")
INTEGER = re.compile(r"-?[0-9]{1,20}")
# The order in which pymavlink prints the message, which is not the wire order.
PRINTED = (
    "time_usec", "fix_type", "lat", "lon", "alt", "eph", "epv", "vel", "cog", "satellites_visible",
)  # fmt: skip
GPX_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="mavproxy-uavapi" xmlns="http://www.topografix.com/GPX/1/1">
<trk><name>GPS_RAW_INT</name><trkseg>
"""
GPX_TAIL = "</trkseg></trk>\n</gpx>\n"


@dataclass(frozen=True)
class GpsReading:
    """A GPS_RAW_INT reading; its fields are in wire order."""

    time_usec: int
    lat: int
    lon: int
    alt: int
    eph: int = 0
    epv: int = 65535
    vel: int = 0
    cog: int = 0
    fix_type: int = FIX_3D
    satellites_visible: int = 255

    @classmethod
    def of(cls, message: Any) -> GpsReading:
        """The reading of a GPS_RAW_INT message."""
        return cls(**{field.name: getattr(message, field.name) for field in fields(cls)})

    def line(self, style: str) -> str:
        """The reading as a line of that format, without the line end."""
        if style == TEXT:
            return "GPS_RAW_INT {" + ", ".join(f"{name} : {getattr(self, name)}" for name in PRINTED) + "}"
        return str(astuple(self))

    def gpx(self, at: float) -> str:
        """The reading as a GPX track point; `at` is s since 1970. Empty without a 3D fix."""
        if self.fix_type < FIX_3D:
            return ""
        time = datetime.datetime.fromtimestamp(at, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
        place = f'lat="{from_deg_e7(self.lat):.7f}" lon="{from_deg_e7(self.lon):.7f}"'
        return f"<trkpt {place}><ele>{self.alt / 1e3:.3f}</ele><time>{time}</time></trkpt>\n"


@dataclass(frozen=True)
class TrackWaypoint:
    """A waypoint: degrees, and m above home."""

    lat: float
    lon: float
    alt: float


def style_of(name: str) -> str:
    """The format for a file name: by its ending `.gpx` or `.tuple`, otherwise text."""
    ending = name.rpartition(".")[2].lower()
    return ending if ending in (GPX, TUPLE) else TEXT


def parse(text: str) -> list[GpsReading]:
    """The readings of a track in either of CentMesh's formats; empty lines and lines that begin with # are skipped.

    Raises:
        Invalid: a line is not a reading, or there is no reading.
    """
    points = []
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            points.append(parse_line(line.strip(), number))
    if not points:
        raise Invalid("the track has no reading", "track")
    return points


def parse_line(line: str, number: int) -> GpsReading:
    """One reading.

    Raises:
        Invalid: it is not a reading, or its position does not exist; the text has the line's `number`.
    """
    if len(line) > LONGEST_LINE:
        raise Invalid(f"line {number} is longer than {LONGEST_LINE} characters: {line[:60]!r}", "track")
    try:
        reading = GpsReading(**(_of_text(line) or _of_tuple(line)))
    except (TypeError, ValueError) as error:
        raise Invalid(f"line {number} is not a GPS_RAW_INT reading: {line[:60]!r}", "track") from error
    if abs(reading.lat) > 90e7 or abs(reading.lon) > 180e7:
        raise Invalid(f"line {number} has no valid latitude and longitude: {line[:60]!r}", "track")
    return reading


def _of_text(line: str) -> dict[str, int]:
    match = TEXT_LINE.fullmatch(line)
    pairs = [part.partition(":") for part in match["body"].split(",")] if match else []
    named = {name.strip(): value for name, _, value in pairs}
    return {name: _integer(value) for name, value in named.items() if name in PRINTED}


def _of_tuple(line: str) -> dict[str, int]:
    match = TUPLE_LINE.fullmatch(line)
    numbers = [part for part in match["body"].split(",") if part.strip()] if match else []
    names = [field.name for field in fields(GpsReading)]
    return dict(zip(names, map(_integer, numbers), strict=True)) if numbers else {}


def _integer(text: str) -> int:
    """All of `text` as a number: a part of `35.77` would be another position."""
    if not INTEGER.fullmatch(text.strip()):
        raise ValueError(text)
    return int(text)


def waypoints_of(text: str, ground: float | None = None) -> list[TrackWaypoint]:
    """The waypoints of a track's text; slow for a long text.

    Raises:
        Invalid: as `parse` and `waypoints`.
    """
    return waypoints(parse(text), ground)


def waypoints(track: Sequence[GpsReading], ground: float | None = None) -> list[TrackWaypoint]:
    """The waypoints of a track.

    Args:
        track: the readings in order; those without a 3D fix are skipped.
        ground: the ground's altitude (m AMSL), from which the track's heights count; by default the lowest point of
            the track, because a track begins or ends on the ground.

    Raises:
        Invalid: no reading has a 3D fix, a waypoint is too high, or there are too many.
    """
    fixed = [reading for reading in track if reading.fix_type >= FIX_3D]
    if not fixed:
        raise Invalid("the track has no reading with a 3D fix", "track")
    level = min(reading.alt for reading in fixed) / 1e3 if ground is None else ground
    places = [
        TrackWaypoint(from_deg_e7(r.lat), from_deg_e7(r.lon), round(max(r.alt / 1e3 - level, LOWEST), 3))
        for r in fixed
    ]
    if not all(place.alt <= HIGHEST for place in places):
        highest = max(place.alt for place in places)
        raise Invalid(f"the track reaches {highest:.0f} m above its ground; the limit is {HIGHEST:g} m", "track")
    thinned_places = list(thinned(places))
    if len(thinned_places) > MOST_WAYPOINTS:
        raise Invalid(f"the track has {len(thinned_places)} waypoints; the limit is {MOST_WAYPOINTS}", "track")
    return thinned_places


def thinned(places: Iterable[TrackWaypoint]) -> Iterable[TrackWaypoint]:
    """The waypoints without those that are too close to the one before."""
    last: TrackWaypoint | None = None
    for place in places:
        if last is None or distance(last, place) >= CLOSEST:
            last = place
            yield place


def distance(one: TrackWaypoint, other: TrackWaypoint) -> float:
    """Metres between two waypoints, height included."""
    north, east = offset(one.lat, one.lon, other.lat, other.lon)
    up = other.alt - one.alt
    return float((north**2 + east**2 + up**2) ** 0.5)
