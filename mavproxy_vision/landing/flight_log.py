"""The track of a mission: a file of positions, and a plot with target and touchdown."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition

SIDE = 900  # px
EDGE = 80  # px
COLOURS = {"track": (200, 120, 40), "start": (80, 160, 60), "target": (40, 40, 220), "touchdown": (160, 40, 160)}


@dataclass
class FlightLog:
    """Positions from GLOBAL_POSITION_INT.

    Attributes:
        rows: latitude, longitude (degrees), altitude (m above home), time (s since the vehicle's boot).
        target: latitude and longitude of the target, if known.
    """

    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    target: tuple[float, float] | None = None

    def add(self, message: Any) -> None:
        """Take a GLOBAL_POSITION_INT."""
        here = GlobalPosition.of(message)
        if not self.rows or here.boot_time > self.rows[-1][3]:
            self.rows.append((here.lat, here.lon, here.alt, here.boot_time))

    def write(self, file: Path) -> None:
        """Write `lat,lon,alt,time` lines.

        Raises:
            OSError: it cannot be written.
        """
        with file.open("w", newline="", encoding="utf-8") as stream:
            rows = csv.writer(stream)
            rows.writerow(("lat", "lon", "alt", "time"))
            rows.writerows((f"{lat:.7f}", f"{lon:.7f}", f"{alt:.3f}", f"{at:.3f}") for lat, lon, alt, at in self.rows)

    def plot(self, file: Path) -> None:
        """Plot the track, north up, in metres from its start.

        Raises:
            OSError: it cannot be written.
        """
        encoded, data = cv2.imencode(".png", self.drawn())
        if encoded:
            file.write_bytes(data.tobytes())

    def drawn(self) -> NDArray[np.uint8]:
        """The plot, shape (SIDE, SIDE, 3), blue green red."""
        image = np.full((SIDE, SIDE, 3), 255, np.uint8)
        if not self.rows:
            return image
        lat, lon = self.rows[0][:2]
        points = [(*offset(lat, lon, row[0], row[1]), row[2]) for row in self.rows]
        marks = {"start": points[0][:2], "touchdown": points[-1][:2]}
        if self.target is not None:
            marks["target"] = offset(lat, lon, *self.target)
        everything = [point[:2] for point in points] + list(marks.values())
        north, east = [point[0] for point in everything], [point[1] for point in everything]
        span = max(max(north) - min(north), max(east) - min(east), 2.0) * 1.1
        middle = ((max(north) + min(north)) / 2, (max(east) + min(east)) / 2)
        scale = (SIDE - 2 * EDGE) / span

        def pixel(place: tuple[float, ...]) -> tuple[int, int]:
            x = SIDE / 2 + (place[1] - middle[1]) * scale
            return round(x), round(SIDE / 2 - (place[0] - middle[0]) * scale)

        _grid(image, middle, span, pixel)
        line = np.array([pixel(point) for point in points], np.int32).reshape(-1, 1, 2)
        cv2.polylines(image, [line], False, COLOURS["track"], 2, cv2.LINE_AA)
        for name, place in marks.items():
            _mark(image, name, pixel(place))
        top = max(point[2] for point in points)
        seconds = self.rows[-1][3] - self.rows[0][3]
        caption = f"{lat:.7f} {lon:.7f}  up to {top:.1f} m above home, {seconds:.0f} s"
        cv2.putText(image, caption, (EDGE, 40), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (60, 60, 60), 1, cv2.LINE_AA)
        if "target" in marks:
            gap = math.dist(marks["target"], marks["touchdown"])
            text = f"touchdown {gap:.2f} m from the target, by the vehicle's own estimate"
            cv2.putText(image, text, (EDGE, 64), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (60, 60, 60), 1, cv2.LINE_AA)
        return image


def _grid(image: NDArray[np.uint8], middle: tuple[float, float], span: float, pixel: Any) -> None:
    step = next(size for size in (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1e9) if span / size <= 10)
    for axis in range(2):
        first = math.ceil((middle[axis] - span / 2) / step)
        for number in range(first, math.floor((middle[axis] + span / 2) / step) + 1):
            value = number * step
            ends = [list(middle), list(middle)]
            for end, sign in zip(ends, (-1, 1), strict=True):
                end[axis], end[1 - axis] = value, middle[1 - axis] + sign * span / 2
            line_start, line_end = pixel(tuple(ends[0])), pixel(tuple(ends[1]))
            cv2.line(image, line_start, line_end, (225, 225, 225), 1)
            text = f"{value:g} m {'north' if axis == 0 else 'east'}"
            label_at = (
                (line_start[0] + 4, line_start[1] - 4) if axis == 0 else (line_start[0] - 30, line_start[1] + 16)
            )
            cv2.putText(image, text, label_at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (130, 130, 130), 1, cv2.LINE_AA)


def _mark(image: NDArray[np.uint8], name: str, at: tuple[int, int]) -> None:
    colour = COLOURS[name]
    if name == "target":
        cv2.drawMarker(image, at, colour, cv2.MARKER_CROSS, 26, 2, cv2.LINE_AA)
    else:
        cv2.circle(image, at, 8, colour, 2, cv2.LINE_AA)
    shift = {"start": 24, "target": -14, "touchdown": 24}[name]
    label_at = (at[0] + 12, at[1] + shift)
    cv2.putText(image, name, label_at, cv2.FONT_HERSHEY_SIMPLEX, 0.55, colour, 1, cv2.LINE_AA)
