"""Tracks of GPS_RAW_INT readings: their formats, and the waypoints that a track makes. Pure.

Two formats are CentMesh's, one line for each reading; both may be read:

    GPS_RAW_INT {time_usec : 251908000, fix_type : 3, lat : 357713121, lon : -786743912, alt : 584090, …}
    (251908000, 357713121, -786743912, 584090, 0, 65535, 0, 0, 3, 10)

The tuple is in the order of the wire. Units are MAVLink's: µs, 1e-7 degrees, mm AMSL, cm/s, 1e-2 degrees.
The third, GPX 1.1, is for maps; it is written only.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.vehicle.geodesy import offset

TEXT, TUPLE, GPX = "text", "tuple", "gpx"
FORMATS = (TEXT, TUPLE, GPX)
FIX_3D = mavutil.mavlink.GPS_FIX_TYPE_3D_FIX
LOWEST = 2.0  # m above home: what lies lower is flown at this height
HIGHEST = 10_000.0  # m above home
CLOSEST = 1.0  # m between waypoints: what lies closer is not flown to
MOST_WAYPOINTS = 10_000
LONGEST_LINE = 1000  # characters
GROUND = (-500.0, 9000.0)  # m AMSL: where the ground may lie
TEXT_LINE = re.compile(r"GPS_RAW_INT\s*\{(?P<body>[^{}]*)\}")
TUPLE_LINE = re.compile(r"\((?P<body>[-0-9,\s]*)\)")
INTEGER = re.compile(r"-?[0-9]{1,20}")
# As pymavlink prints the message, which is not the order of the wire.
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
    """A GPS_RAW_INT reading, its fields in the order of the wire."""

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
        """The reading as a line of that format, without its end."""
        if style == TEXT:
            return "GPS_RAW_INT {" + ", ".join(f"{name} : {getattr(self, name)}" for name in PRINTED) + "}"
        return str(astuple(self))

    def gpx(self, at: float) -> str:
        """The reading as a track point of GPX; `at` in s since 1970. Empty without a 3D fix."""
        if self.fix_type < FIX_3D:
            return ""
        time = datetime.datetime.fromtimestamp(at, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
        place = f'lat="{self.lat / 1e7:.7f}" lon="{self.lon / 1e7:.7f}"'
        return f"<trkpt {place}><ele>{self.alt / 1e3:.3f}</ele><time>{time}</time></trkpt>\n"


@dataclass(frozen=True)
class TrackWaypoint:
    """A place to fly to: degrees, and m above home."""

    lat: float
    lon: float
    alt: float


def style_of(name: str) -> str:
    """The format that a file's name asks for: `.gpx`, `.tuple`, or else text."""
    ending = name.rpartition(".")[2].lower()
    return ending if ending in (GPX, TUPLE) else TEXT


def parse(text: str) -> list[GpsReading]:
    """The readings of a track in either of CentMesh's formats; empty lines and lines that begin with # are left out.

    Raises:
        Invalid: a line is no reading, or there is none.
    """
    points = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            points.append(parse_line(line.strip(), number))
    if not points:
        raise Invalid("the track holds no reading", "track")
    return points


def parse_line(line: str, number: int) -> GpsReading:
    """One reading.

    Raises:
        Invalid: it is none, or at no place on Earth; the text has the line's `number`.
    """
    if len(line) > LONGEST_LINE:
        raise Invalid(f"line {number} is longer than {LONGEST_LINE} characters: {line[:60]!r}", "track")
    try:
        reading = GpsReading(**(_of_text(line) or _of_tuple(line)))
    except (TypeError, ValueError) as error:
        raise Invalid(f"line {number} is no GPS_RAW_INT reading: {line[:60]!r}", "track") from error
    if abs(reading.lat) > 90e7 or abs(reading.lon) > 180e7:
        raise Invalid(f"line {number} is no place on Earth: {line[:60]!r}", "track")
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
    """The whole of `text` as a number: half of `35.77` would be another place."""
    if not INTEGER.fullmatch(text.strip()):
        raise ValueError(text)
    return int(text)


def places_of(text: str, ground: float | None = None) -> list[TrackWaypoint]:
    """The places that a track's text leads through; long ones take their time.

    Raises:
        Invalid: as `parse` and `waypoints`.
    """
    return waypoints(parse(text), ground)


def waypoints(track: Sequence[GpsReading], ground: float | None = None) -> list[TrackWaypoint]:
    """The places that a track leads through.

    Args:
        track: readings in their order; those without a 3D fix are left out.
        ground: AMSL altitude (m) of the ground that the track's heights count from; by default the lowest
            point of the track, on the ground of which it began or ended.

    Raises:
        Invalid: there is no reading with a 3D fix, a place is too high, or there are too many.
    """
    fixed = [reading for reading in track if reading.fix_type >= FIX_3D]
    if not fixed:
        raise Invalid("the track holds no reading with a 3D fix", "track")
    level = min(reading.alt for reading in fixed) / 1e3 if ground is None else ground
    places = [TrackWaypoint(r.lat / 1e7, r.lon / 1e7, round(max(r.alt / 1e3 - level, LOWEST), 3)) for r in fixed]
    if not all(place.alt <= HIGHEST for place in places):
        highest = max(place.alt for place in places)
        raise Invalid(f"the track leads {highest:.0f} m above its ground; {HIGHEST:g} are the most", "track")
    thinned_places = list(thinned(places))
    if len(thinned_places) > MOST_WAYPOINTS:
        raise Invalid(f"the track leads through {len(thinned_places)} places; {MOST_WAYPOINTS} are the most", "track")
    return thinned_places


def thinned(places: Iterable[TrackWaypoint]) -> Iterable[TrackWaypoint]:
    """The places without those that are hardly away from the one before."""
    last: TrackWaypoint | None = None
    for place in places:
        if last is None or distance(last, place) >= CLOSEST:
            last = place
            yield place


def distance(one: TrackWaypoint, other: TrackWaypoint) -> float:
    """Metres between two places, height included."""
    north, east = offset(one.lat, one.lon, other.lat, other.lon)
    up = other.alt - one.alt
    return float((north**2 + east**2 + up**2) ** 0.5)
