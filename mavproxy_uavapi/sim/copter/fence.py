"""The autopilot's own fence: what a copter has broken of it. From AC_Fence.cpp and Copter's fence.cpp.

FENCE_TYPE chooses among the greatest height, the circle around home and the stored areas. Without ArduCopter's
FENCE_ALT_MIN, FENCE_MARGIN and FENCE_AUTOENABLE.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import from_deg_e7

from ..fence_and_rally import CIRCLES, POLYGONS
from ..geodesy import Location, Ned, to_ned
from ..mission import Item
from .aircraft import Aircraft

HEIGHT, CIRCLE, AREAS = 1, 2, 4
"""Bits of FENCE_TYPE."""
NAMES = {HEIGHT: "Max Alt", CIRCLE: "Circle", AREAS: "Polygon"}
FARTHER = 20.0
"""m that a vehicle must have gone on beyond a fence until it has broken it again (AC_FENCE_*_BACKUP_DISTANCE)."""
INCLUSIONS = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
)


class Fence:
    """The fence of one copter; `items` are what it stores."""

    def __init__(self, aircraft: Aircraft) -> None:
        self._aircraft = aircraft
        self._broken: dict[int, float] = {}
        self.items: Sequence[Item] = ()

    def newly_broken(self) -> int:
        """The bits of what has been broken since the last call."""
        aircraft, new = self._aircraft, 0
        counts = aircraft.parameters["FENCE_ENABLE"] == 1 and aircraft.armed and aircraft.estimator.ready
        beyond = self._beyond() if counts else {}
        for kind, metres in beyond.items():
            if kind not in self._broken or metres > self._broken[kind] + FARTHER:
                new, self._broken[kind] = new | kind, metres
        self._broken = {kind: metres for kind, metres in self._broken.items() if kind in beyond}
        return new

    def words(self, kinds: int) -> str:
        """`Circle and Polygon fence breached`."""
        return " and ".join(name for kind, name in NAMES.items() if kinds & kind) + " fence breached"

    def _beyond(self) -> dict[int, float]:
        """By kind, by how many m the vehicle is beyond it."""
        aircraft, parameters = self._aircraft, self._aircraft.parameters
        kinds = int(parameters["FENCE_TYPE"])
        here, home = aircraft.estimator.position, aircraft.home_offset
        too_high = aircraft.altitude - parameters["FENCE_ALT_MAX"]
        too_far = math.dist(here[:2], home[:2]) - parameters["FENCE_RADIUS"]
        found = {HEIGHT: too_high, CIRCLE: too_far, AREAS: max(self._outside(here), default=-1.0)}
        return {kind: metres for kind, metres in found.items() if kinds & kind and metres > 0}

    def _outside(self, here: Ned) -> Iterator[float]:
        """For each area, m that a vehicle is on its wrong side; negative on the right one."""
        items = [item for item in self.items if item.command in (*POLYGONS, *CIRCLES)]
        while items:
            item = items[0]
            corners = [self._place(one) for one in items[: int(item.param1) if item.command in POLYGONS else 1]]
            items = items[len(corners) :]
            if item.command in CIRCLES:
                outside = math.dist(here[:2], corners[0]) - item.param1
            else:
                edge = min(_to_edge(here[:2], a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
                outside = -edge if _is_in(here[:2], corners) else edge
            yield outside if item.command in INCLUSIONS else -outside

    def _place(self, item: Item) -> tuple[float, float]:
        origin = self._aircraft.estimator.origin
        assert origin is not None
        return to_ned(origin, Location(from_deg_e7(item.x), from_deg_e7(item.y), 0.0))[:2]


def _is_in(at: Sequence[float], corners: Sequence[tuple[float, float]]) -> bool:
    """Whether a ray to the east crosses the outline an odd number of times."""
    north, east = at
    inside = False
    for (n, e), (m, f) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (n > north) != (m > north) and east < (f - e) * (north - n) / (m - n) + e:
            inside = not inside
    return inside


def _to_edge(at: Sequence[float], a: tuple[float, float], b: tuple[float, float]) -> float:
    """Metres to the line between two corners."""
    along = (b[0] - a[0], b[1] - a[1])
    length = along[0] ** 2 + along[1] ** 2
    share = 0.0 if length == 0 else ((at[0] - a[0]) * along[0] + (at[1] - a[1]) * along[1]) / length
    share = max(0.0, min(1.0, share))
    return math.dist(at, (a[0] + share * along[0], a[1] + share * along[1]))
