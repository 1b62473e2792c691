"""Checks how much memory and time a PNG or JPEG needs, before it is decoded: a few kB may be enough to fill the
memory or keep a core busy. Pure.
"""

from __future__ import annotations

import struct

PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
# JPEG markers (ITU T.81, table B.1): SOF0 to SOF15 hold the size; tables, extensions and comments may come before.
SIZE_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
BEFORE_IT = {0xC4, 0xCC, 0xDB, 0xDD, *range(0xE0, 0xF0), 0xFE}
FILL = 0xFF  # any number of these may come before a marker
SCAN = b"\xff\xda"  # begins a scan; a progressive JPEG has about 10, and each scan covers the whole picture
MOST_SCANS = 30
ANIMATION, PIXELS = b"acTL", b"IDAT"  # chunks of a PNG; the animation chunk comes first


def size_of(data: bytes) -> tuple[int, int] | None:
    """Width and height (px); None if the data is neither a PNG nor a JPEG."""
    if data.startswith(PNG) and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
        return width, height
    return _of_jpeg(data) if data.startswith(JPEG) else None


def why_costly(data: bytes) -> str | None:
    """Why decoding costs more than the size suggests: an animation, or too many scans; None if it does not."""
    if data.startswith(PNG) and _is_animated(data):
        return "an animated PNG"
    if data.startswith(JPEG) and data.count(SCAN) > MOST_SCANS:
        return f"a JPEG of more than {MOST_SCANS} scans"
    return None


def _is_animated(png: bytes) -> bool:
    at = len(PNG)
    while at + 8 <= len(png):
        length, kind = struct.unpack_from(">I4s", png, at)
        if kind in (ANIMATION, PIXELS):
            return bool(kind == ANIMATION)
        at += 12 + length
    return False


def _of_jpeg(data: bytes) -> tuple[int, int] | None:
    at = len(JPEG)
    while at + 9 <= len(data) and data[at] == FILL:
        marker = data[at + 1]
        if marker == FILL:
            at += 1
        elif marker in SIZE_OF_FRAME:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        elif marker in BEFORE_IT:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        else:
            break
    return None
