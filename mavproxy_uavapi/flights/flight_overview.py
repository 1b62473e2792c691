"""A flight at a glance: where each vehicle was, second by second, and what happened. Pure.

It is made when a flight is packed, and is an attachment of its file: whoever shows a flight reads it, and then only
the moments that are looked at.
"""

from __future__ import annotations

import json
import math
import re
import zlib
from contextlib import suppress
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.mission.item_places import place_of
from mavproxy_uavapi.core.mission.mission_files import parts_of

NAME, KIND = "overview.json.gz", "application/gzip"
STEP = 1.0  # s from one place to the next
EVENTS = frozenset({"mode", "armed", "link", "statustext", "history"})
MOST_EVENTS = 20_000
MISSION_FILE = re.compile(r"mission-(?P<system>\d+)-\d+\.waypoints")
ABOVE_HOME = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
GZIP = 16 + zlib.MAX_WBITS


class FlownPlace(NamedTuple):
    """Where a vehicle was.

    Attributes:
        time: s since 1970.
        lat: degrees.
        lon: degrees.
        alt: m above sea.
        relative_alt: m above home.
        battery_percent: what is left; None if it is not told.
    """

    time: float
    lat: float
    lon: float
    alt: float
    relative_alt: float
    battery_percent: float | None


class Overview:
    """What a flight was.

    Attributes:
        began: s since 1970 of its earliest message; NaN before that.
        ended: of its latest one.
        ways: where each vehicle was, by system id.
        events: of the stream, as it has them, in their order.
    """

    def __init__(self) -> None:
        self.began, self.ended = math.nan, math.nan
        self.ways: dict[int, list[FlownPlace]] = {}
        self.events: list[Any] = []
        self._missions: dict[int, str] = {}  # the last file of each vehicle
        self._battery: dict[int, float | None] = {}
        self._due: dict[str, float] = {}  # by topic: from when on its messages are looked at again (s since 1970)

    def see(self, topic: str, schema: str, time: float, data: bytes) -> None:
        """Take a message of the file at a time in s since 1970; most are not decoded."""
        self.began, self.ended = min(time, self.began), max(time, self.ended)  # NaN gives way
        name = topic.rpartition("/")[2]
        if schema == "uavapi.Event" and name in EVENTS and len(self.events) < MOST_EVENTS:
            self.events.append(json.loads(data))
        elif schema == "uavapi.View" and name in ("gps", "battery") and time >= self._due.get(topic, -math.inf):
            self._due[topic] = time + STEP
            self._see_view(time, json.loads(data))

    def see_attachment(self, name: str, data: bytes) -> None:
        """Take a file of the flight: the last mission of a vehicle is shown."""
        found = MISSION_FILE.fullmatch(name)
        if found:
            self._missions[int(found["system"])] = data.decode("utf-8", "replace")

    def _see_view(self, time: float, event: dict[str, Any]) -> None:
        system, info = event["system"], event["info"]
        if event["view"] == "battery":
            self._battery[system] = info.get("battery_remaining")
            return
        lat, lon, alt, relative_alt = (info["position"].get(name) for name in ("lat", "lon", "alt", "relative_alt"))
        if None not in (lat, lon, alt, relative_alt) and (lat or lon):  # 0 N 0 E: it did not know
            place = FlownPlace(time, lat, lon, alt, relative_alt, self._battery.get(system))
            self.ways.setdefault(system, []).append(place)

    def written(self) -> bytes:
        """As JSON, compressed by gzip: a list for each column of a way."""
        ways = []
        for system, way in sorted(self.ways.items()):
            columns = dict(zip(FlownPlace._fields, zip(*way, strict=True), strict=True))
            seconds = [round(time - self.began, 2) for time in columns.pop("time")]
            ways.append({"vehicle": system, "seconds": seconds, **columns})
        missions = []
        for system in sorted(self._missions.keys() & self.ways.keys()):
            with suppress(UavApiError):  # an autopilot may hold items that no file of ours has
                lat, lon, heights = zip(*mission_places(self._missions[system], self.ways[system][0]), strict=True)
                missions.append({"vehicle": system, "lat": lat, "lon": lon, "relative_alt": heights})
        began, lasted = (0.0, 0.0) if math.isnan(self.began) else (self.began, round(self.ended - self.began, 2))
        told = {"began": began, "seconds": lasted, "vehicles": ways, "missions": missions, "events": self.events}
        compressor = zlib.compressobj(wbits=GZIP)
        return compressor.compress(json.dumps(told, separators=(",", ":")).encode()) + compressor.flush()


def mission_places(text: str, home: FlownPlace) -> list[tuple[float, float, float | None]]:
    """Where a mission leads, from where the vehicle began: degrees, and m above home; None where it tells no such.

    Raises:
        BadRequest, Invalid: it is no mission.
    """
    start = (home.lat, home.lon)
    places: list[tuple[float, float, float | None]] = [(*start, 0.0)]
    for item in parts_of(text).items:
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            places.append((*start, None))
        elif item.has_location and item.name.startswith("NAV_") and (place := place_of(item)) is not None:
            places.append((*place, item.z if item.frame in ABOVE_HOME else None))
    return places


def unpacked(data: bytes) -> bytes:
    """The JSON of an overview as it is written."""
    return zlib.decompress(data, GZIP)


def mission_of(data: bytes, system: int) -> list[tuple[float, float, float | None]]:
    """The places of a vehicle's mission in an overview, as `mission_places` has them; none if there was none."""
    for one in json.loads(unpacked(data))["missions"]:
        if one["vehicle"] == system:
            return list(zip(one["lat"], one["lon"], one["relative_alt"], strict=True))
    return []


def ways_of(data: bytes) -> dict[int, list[FlownPlace]]:
    """The ways of an overview as `Overview.written` gives it, by system id."""
    told = json.loads(unpacked(data))
    ways = {}
    for way in told["vehicles"]:
        times = [told["began"] + seconds for seconds in way["seconds"]]
        columns = [times, *(way[name] for name in FlownPlace._fields[1:])]
        ways[way["vehicle"]] = [FlownPlace(*row) for row in zip(*columns, strict=True)]
    return ways
