"""What a flight's file says: an event of the telemetry stream as messages with topics and schemas. Pure.

Every event is kept as the stream has it, under `/SYSTEM/NAME`. Positions, attitudes and texts are there once more in
Foxglove's own schemas, so that its panels show them without any setting: `/SYSTEM/location`, `/SYSTEM/pose`, `/log`.
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from mavproxy_uavapi.core.geotag import Geotag, report_of
from mavproxy_uavapi.flights.flight_file import TRAIL, FlightMessage
from mavproxy_uavapi.http.contract.responses import dumps
from mavproxy_uavapi.http.stream.stream_event import Event, When, of_info

LOG_LEVELS = (5, 5, 4, 4, 3, 2, 2, 1)  # Foxglove's, by MAV_SEVERITY
INFO = 2
READINGS = "readings"  # the event that tells of some
MOST_SERIES = 1000  # topics of readings; others are together in one


class Topics:
    """Makes the messages of one flight."""

    def __init__(self) -> None:
        self._places: dict[int, Mapping[str, float]] = {}  # by system: the newest place from home, NED (m)
        self._series: set[str] = set()  # topics of readings

    def records(self, event: Event) -> Iterator[FlightMessage]:
        """The messages of an event; the first one is the event itself."""
        at, kind = round(event.at.time * 1e9), "uavapi.View" if event.kind == "view" else "uavapi.Event"
        if event.name == READINGS:
            yield from self._readings(at, event.info["readings"])
            return
        topic = f"/{event.system}/{event.name}" if event.system else f"/{event.name}"
        yield FlightMessage(topic, kind, at, event.json(0).encode())
        shown = self._shown(event)
        if shown is not None:
            name, schema, members = shown
            stamp = {"sec": at // 10**9, "nsec": at % 10**9}
            yield FlightMessage(name, schema, at, dumps({"timestamp": stamp, **members}).encode())

    def _readings(self, at: int, readings: Iterable[Mapping[str, Any]]) -> Iterator[FlightMessage]:
        """Each device and quantity has a topic, for a curve; a file has only so many."""
        for reading in readings:
            topic = f"/readings/{reading['device']}/{reading['quantity']}"
            if topic not in self._series:
                if len(self._series) >= MOST_SERIES:
                    topic = "/readings"
                self._series.add(topic)
            yield FlightMessage(topic, "uavapi.Reading", at, dumps(reading).encode())

    def _shown(self, event: Event) -> tuple[str, str, dict[str, Any]] | None:
        """An event as Foxglove shows it: topic, schema, members; None if it does not."""
        system, name, info = event.system, event.name, event.info
        if name == "gps":
            return f"/{system}/location", "foxglove.LocationFix", _location(info["position"])
        if name == "ned":
            self._places[system] = info["position"]
        if name == "attitude":
            return f"/{system}/pose", "foxglove.PoseInFrame", _pose(self._places.get(system, {}), info)
        if name == "statustext":
            level = LOG_LEVELS[min(info["severity"], len(LOG_LEVELS) - 1)]
            return "/log", "foxglove.Log", _log(level, info["text"], f"vehicle {system}")
        if name == TRAIL:
            return "/log", "foxglove.Log", _log(INFO, info["sentence"], info["kind"])
        return None


def of_picture(system: int, tag: Geotag, jpeg: bytes) -> Iterator[FlightMessage]:
    """A picture: first what is known of it, then the picture itself, at the time at which it was taken."""
    at, digest = round(tag.time * 1e9), hashlib.sha256(jpeg).hexdigest()
    info = {"name": f"picture-{system}-{at // 10**3}.jpg", "sha256": digest, "bytes": len(jpeg), **report_of(tag)}
    event = of_info("event", "picture", system, When(tag.time, 0.0), info)
    yield FlightMessage(f"/{system}/picture", "uavapi.Event", at, event.json(0).encode())
    stamp = {"sec": at // 10**9, "nsec": at % 10**9}
    image = {"timestamp": stamp, "frame_id": "camera", "format": "jpeg", "data": base64.b64encode(jpeg).decode()}
    yield FlightMessage(f"/{system}/image", "foxglove.CompressedImage", at, dumps(image).encode())


def _location(position: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "frame_id": "earth",
        "latitude": position["lat"],
        "longitude": position["lon"],
        "altitude": position["alt"],
        "position_covariance": [0.0] * 9,
        "position_covariance_type": 0,
    }


def _pose(ned: Mapping[str, float | None], attitude: Mapping[str, Any]) -> dict[str, Any]:
    """East, north, up from home (m), and the rotation of a body whose axes are forward, left, up."""
    roll, pitch, yaw = (math.radians(attitude[name]) / 2 for name in ("roll", "pitch", "yaw"))
    pitch, yaw = -pitch, math.pi / 4 - yaw
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return {
        "frame_id": "home",
        "pose": {
            "position": {"x": ned.get("y") or 0.0, "y": ned.get("x") or 0.0, "z": -(ned.get("z") or 0.0)},
            "orientation": {
                "x": sr * cp * cy - cr * sp * sy,
                "y": cr * sp * cy + sr * cp * sy,
                "z": cr * cp * sy - sr * sp * cy,
                "w": cr * cp * cy + sr * sp * sy,
            },
        },
    }


def _log(level: int, message: str, name: str) -> dict[str, Any]:
    return {"level": level, "message": message, "name": name, "file": "", "line": 0}
