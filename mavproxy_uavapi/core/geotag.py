"""Where and when a picture was taken, and how that is written into a JPEG: EXIF 2.3. Pure.

The camera's own EXIF stays: all its offsets count from the beginning of the block, so a new first directory at its
end has the old entries and the new ones, and nothing else moves.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.core import geodesy
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

NEAR = 2.0  # s between a picture and a position; beyond it is unknown where the picture was taken
SOI, APP0, APP1, EXIF = b"\xff\xd8", b"\xff\xe0", b"\xff\xe1", b"Exif\0\0"
LONGEST = 65_533  # bytes of a segment
EMPTY = b"II*\0\x08\0\0\0\0\0\0\0\0\0"  # a block whose one directory has no entry
ORDERS = {b"II": "<", b"MM": ">"}
EXIF_IFD, GPS_IFD = 0x8769, 0x8825
BYTE, ASCII, LONG, RATIONAL = 1, 2, 4, 5  # types of entries
ENTRY = 12  # bytes

Directory = Mapping[int, tuple[int, int, bytes]]  # by tag: type, count, and the value's bytes


@dataclass(frozen=True)
class Geotag:
    """Where and when a picture was taken.

    Attributes:
        time: s since 1970.
        lat, lon: degrees; None while unknown, as the following.
        alt: m above sea level.
        relative_alt: m above home.
        heading: of the vehicle, degrees clockwise from true north.
    """

    time: float
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    relative_alt: float | None = None
    heading: float | None = None


def geotag_of(state: VehicleState, at: float, utc: float) -> Geotag:
    """Where a vehicle was: its newest position, moved by its velocity.

    Args:
        state: the vehicle's.
        at: when, s on the clock of arrivals.
        utc: the same moment, s since 1970.
    """
    received, here = state.messages.get("GLOBAL_POSITION_INT"), state.position
    if received is None or here is None or abs(at - received.at) > NEAR or not any(here.place):
        return Geotag(utc)
    seconds = (at - received.at) * state.time_ratio.ratio
    north, east, down = (speed * seconds for speed in here.velocity)
    return Geotag(
        utc, *geodesy.moved(here.lat, here.lon, north, east), here.msl - down, here.alt - down, here.heading
    )


def tagged(jpeg: bytes, tag: Geotag) -> bytes:
    """A JPEG with the place, the height above sea, the heading and the UTC in its EXIF.

    Its own EXIF is kept, but for another place. What is no JPEG, or has an EXIF that cannot be read or grown, is
    returned as it is.
    """
    if not jpeg.startswith(SOI):
        return jpeg
    begin, end = _exif_segment(jpeg)
    try:
        block = _grown(jpeg[begin + 4 + len(EXIF) : end] or EMPTY, tag)
    except (struct.error, KeyError):
        return jpeg
    if len(EXIF) + len(block) > LONGEST:
        return jpeg
    segment = APP1 + struct.pack(">H", 2 + len(EXIF) + len(block)) + EXIF + block
    return jpeg[:begin] + segment + jpeg[end:]


def _exif_segment(jpeg: bytes) -> tuple[int, int]:
    """Where the EXIF segment begins and ends; both the same where there is none: behind JFIF's, which comes first."""
    at = place = len(SOI)
    while jpeg[at : at + 1] == b"\xff" and 0xE0 <= (jpeg[at + 1 : at + 2] or b"\0")[0] <= 0xEF:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if jpeg[at : at + 2] == APP1 and jpeg[at + 4 :].startswith(EXIF):
            return at, end
        if jpeg[at : at + 2] == APP0:
            place = end
        at = end
    return place, place


def _grown(block: bytes, tag: Geotag) -> bytes:
    """An EXIF block with a new first directory, which has the old one's entries, a place and a time.

    Raises:
        KeyError, struct.error: it is none.
    """
    order = ORDERS[block[:2]]
    (first,) = struct.unpack_from(order + "I", block, 4)
    (count,) = struct.unpack_from(order + "H", block, first)
    old = {}
    for number in range(count):
        entry = block[first + 2 + number * ENTRY :][:ENTRY]
        old[struct.unpack(order + "H10x", entry)[0]] = entry
    (following,) = struct.unpack_from(order + "I", block, first + 2 + count * ENTRY)
    block += b"\0" * (len(block) % 2)
    for pointer, directory in (
        (EXIF_IFD, {} if EXIF_IFD in old else _of_time(tag)),
        (GPS_IFD, _of_place(tag, order)),
    ):
        if directory:
            old[pointer] = struct.pack(order + "HHII", pointer, LONG, 1, len(block))
            block += _written(directory, len(block), order)
    entries = b"".join(old[number] for number in sorted(old))
    directory_bytes = struct.pack(order + "H", len(old)) + entries + struct.pack(order + "I", following)
    return block[:4] + struct.pack(order + "I", len(block)) + block[8:] + directory_bytes


def _of_time(tag: Geotag) -> Directory:
    """DateTimeOriginal, OffsetTimeOriginal, SubSecTimeOriginal."""
    texts = {0x9003: _utc(tag, "%Y:%m:%d %H:%M:%S"), 0x9011: "+00:00", 0x9291: f"{int(tag.time % 1 * 1000):03d}"}
    return {number: _text(words) for number, words in texts.items()}


def _of_place(tag: Geotag, order: str) -> Directory:
    def rationals(*values: tuple[float, int]) -> tuple[int, int, bytes]:
        pairs = (struct.pack(order + "II", round(value * scale), scale) for value, scale in values)
        return RATIONAL, len(values), b"".join(pairs)

    seconds = time.gmtime(tag.time).tm_sec + tag.time % 1
    whole = (float(number) for number in time.gmtime(tag.time)[3:5])
    gps: dict[int, tuple[int, int, bytes]] = {
        0: (BYTE, 4, bytes((2, 3, 0, 0))),
        7: rationals(*((number, 1) for number in whole), (seconds, 1000)),
        29: _text(_utc(tag, "%Y:%m:%d")),
    }
    if tag.lat is not None and tag.lon is not None:
        for number, degrees, letters in ((1, tag.lat, "NS"), (3, tag.lon, "EW")):
            gps[number] = _text(letters[degrees < 0])
            minutes = abs(degrees) % 1 * 60
            gps[number + 1] = rationals(
                (math.floor(abs(degrees)), 1), (math.floor(minutes), 1), (minutes % 1 * 60, 100_000)
            )
    if tag.alt is not None:
        gps |= {5: (BYTE, 1, bytes([tag.alt < 0])), 6: rationals((abs(tag.alt), 1000))}
    if tag.heading is not None:
        gps |= {16: _text("T"), 17: rationals((tag.heading % 360, 100))}
    return gps


def _utc(tag: Geotag, form: str) -> str:
    return time.strftime(form, time.gmtime(tag.time))


def _text(words: str) -> tuple[int, int, bytes]:
    return ASCII, len(words) + 1, words.encode() + b"\0"


def _written(directory: Directory, at: int, order: str) -> bytes:
    """A directory that begins at `at` of its block; values of more than four bytes are behind it."""
    behind = at + 2 + len(directory) * ENTRY + 4
    entries, values = b"", b""
    for number, (kind, count, value) in sorted(directory.items()):
        if len(value) > 4:
            shown = struct.pack(order + "I", behind + len(values))
            values += value + b"\0" * (len(value) % 2)
        else:
            shown = value.ljust(4, b"\0")
        entries += struct.pack(order + "HHI", number, kind, count) + shown
    return struct.pack(order + "H", len(directory)) + entries + b"\0\0\0\0" + values


def report_of(tag: Geotag) -> dict[str, Any]:
    """The tag for callers."""
    digits = {"lat": 7, "lon": 7, "alt": 3, "relative_alt": 3, "heading": 2, "time": 3}
    return {name: None if value is None else round(value, digits[name]) for name, value in vars(tag).items()}
