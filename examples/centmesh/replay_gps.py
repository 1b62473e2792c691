"""Fly through a file of GPS_RAW_INT readings, leg by leg, and return to launch.

python replay_gps.py flight.track
python replay_gps.py flight.track --ground 584      the ground's AMSL altitude in m, if the track never touches it
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

from client import Api, parser, rtl_on_interrupt

LOWEST = 2.0  # m above home
FIX_3D = 3


class Reading(NamedTuple):
    """Degrees, m AMSL, and the kind of fix."""

    lat: float
    lon: float
    alt: float
    fix: int


def parse(text: str) -> Reading:
    """A line in either format."""
    if text.startswith("GPS_RAW_INT"):
        named = {name: int(value) for name, value in re.findall(r"(\w+) : (-?\d+)", text)}
        lat, lon, alt, fix = (named[name] for name in ("lat", "lon", "alt", "fix_type"))
    else:
        numbers = [int(part) for part in text.strip("()").split(",")]
        lat, lon, alt, fix = *numbers[1:4], numbers[8]
    return Reading(lat / 1e7, lon / 1e7, alt / 1e3, fix)


def main() -> None:
    """Fly it."""
    arguments = parser(__doc__, altitude=None)
    arguments.add_argument("file", type=Path)
    arguments.add_argument("--ground", type=float, help="m AMSL; by default the track's lowest reading")
    options = arguments.parse_args()
    lines = [text.strip() for text in options.file.read_text(encoding="ascii").splitlines() if text.strip()]
    track = [reading for reading in map(parse, lines) if reading.fix >= FIX_3D]
    if not track:
        sys.exit(f"{options.file}: no reading with a 3D fix")
    ground = min(reading.alt for reading in track) if options.ground is None else options.ground
    heights = [round(max(reading.alt - ground, LOWEST), 2) for reading in track]
    api = Api(options.url)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        api.get("/command/takeoff", alt=heights[0])
        for reading, height in zip(track, heights, strict=True):
            api.post("/movement/go_to_gps_wait", lat=reading.lat, long=reading.lon, alt=height)
        api.get("/command/rtl")


if __name__ == "__main__":
    main()
