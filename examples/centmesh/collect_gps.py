"""Collect GPS_RAW_INT readings of a vehicle into a file.

python collect_gps.py flight.track            one every 5 s, as text, until Ctrl-C
python collect_gps.py flight.track 1 --style tuple --latest latest.txt
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from client import Api, parser, positive

TEXT = ("time_usec", "fix_type", "lat", "lon", "alt", "eph", "epv", "vel", "cog", "satellites_visible")
WIRE = ("time_usec", "lat", "lon", "alt", "eph", "epv", "vel", "cog", "fix_type", "satellites_visible")
# What MAVLink sends for a value that it does not know, and the API answers as null.
UNKNOWN = {"eph": 65535, "epv": 65535, "vel": 65535, "cog": 65535, "satellites_visible": 255}


def line(reading: dict[str, Any], style: str) -> str:
    """A reading in one of the two formats: 1e-7 degrees, mm AMSL."""
    known = {name: UNKNOWN.get(name, 0) if reading[name] is None else reading[name] for name in WIRE}
    if style == "tuple":
        return str(tuple(known[name] for name in WIRE))
    return "GPS_RAW_INT {" + ", ".join(f"{name} : {known[name]}" for name in TEXT) + "}"


def replace(file: Path, text: str) -> None:
    """Make `text` the file's content; whoever reads it sees the old one or the new one."""
    beside = file.with_name(file.name + ".new")
    beside.write_text(text, encoding="ascii")
    os.replace(beside, file)


def main() -> None:
    """Collect."""
    arguments = parser(__doc__, altitude=None)
    arguments.add_argument("file", type=Path)
    arguments.add_argument("seconds", type=positive, nargs="?", default=5.0, help="between readings (%(default)g)")
    arguments.add_argument("--style", choices=("text", "tuple"), default="text")
    arguments.add_argument("--latest", type=Path, help="a file that holds the newest reading alone")
    arguments.add_argument("--count", type=int, default=0, help="readings to collect; 0: until Ctrl-C")
    options = arguments.parse_args()
    api = Api(options.url)
    began, collected = time.monotonic(), 0
    with options.file.open("w", encoding="ascii") as track:
        while not options.count or collected < options.count:
            text = line(api.get("/telemetry/message/GPS_RAW_INT")["info"], options.style) + "\n"
            track.write(text)
            track.flush()
            if options.latest is not None:
                replace(options.latest, text)
            collected += 1
            time.sleep(max(0.0, began + collected * options.seconds - time.monotonic()))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(0)
