"""The start of a simulated vehicle: a name or four numbers -> a home position."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from mavproxy_uavapi.launcher.errors import OptionError


class HomePosition(NamedTuple):
    """Latitude and longitude in degrees (WGS 84), altitude in m AMSL, heading in degrees from north."""

    lat: float
    lon: float
    alt: float
    heading: float

    def __str__(self) -> str:
        return f"{self.lat:.7f},{self.lon:.7f},{self.alt:g},{self.heading:g}"


BUILT_IN: Mapping[str, HomePosition] = {
    "AbraDF": HomePosition(-15.840081, -47.926642, 1042, 30),
    "CMAC": HomePosition(-35.363261, 149.165230, 584, 353),
}


def read_home(text: str) -> HomePosition | None:
    """`lat,lon,alt,heading` -> a home; None if the text is not four numbers or one is out of range."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        return None
    home = HomePosition(*numbers)
    return home if abs(home.lat) <= 90 and abs(home.lon) <= 180 and 0 <= home.heading <= 360 else None


def read_locations(lines: Iterable[str]) -> dict[str, HomePosition]:
    """The lines `NAME=lat,lon,alt,heading  # comment` of an ArduPilot locations.txt; others are skipped."""
    homes: dict[str, HomePosition] = {}
    for line in lines:
        name, _, numbers = line.partition("#")[0].partition("=")
        home = read_home(numbers)
        if home is not None:
            # ArduPilot takes the first of two lines with the same name.
            homes.setdefault(name.strip(), home)
    return homes


def resolve(location: str, ardupilot_path: str | None = None) -> HomePosition:
    """The home for a location on the command line.

    Names are looked up where sim_vehicle.py does it (the user's own file, then ArduPilot's locations.txt), then in
    the table here: ArduPilot itself does not know AbraDF, and asks a geocoder on the network instead.

    Raises:
        OptionError: neither a known name nor four numbers in range.
    """
    if "," in location:
        home = read_home(location)
        if home is None:
            raise OptionError(f"--location: expected lat,lon,alt,heading (degrees, m AMSL), got {location!r}")
        return home
    for file in location_files(ardupilot_path):
        if file.is_file():
            homes = read_locations(file.read_text(encoding="utf-8", errors="replace").splitlines())
            if location in homes:
                return homes[location]
    if location not in BUILT_IN:
        raise OptionError(f"--location: unknown name {location!r}; lat,lon,alt,heading works everywhere")
    return BUILT_IN[location]


def location_files(ardupilot_path: str | None) -> list[Path]:
    """The files that may name locations, in order of precedence."""
    # sim_vehicle.py reads XDG_CONFIG_DIR; the standard's own name for it comes second.
    named = os.environ.get("XDG_CONFIG_DIR") or os.environ.get("XDG_CONFIG_HOME")
    config = Path(named) if named else Path.home() / ".config"
    files = [Path(os.environ.get("ARDUPILOT_LOCATIONS") or config / "ardupilot" / "locations.txt")]
    if ardupilot_path is not None:
        files.append(Path(ardupilot_path, "Tools", "autotest", "locations.txt"))
    return files
