"""The autopilot's own fence: what a vehicle has broken of it. From AC_Fence.cpp.

FENCE_TYPE chooses among the greatest and the least height, the circle around home and the stored areas. The least
height counts from the moment on that the vehicle is FENCE_MARGIN above it, until it lands. Without FENCE_AUTOENABLE,
and the notices of FENCE_OPTIONS.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import from_deg_e7

from .estimator import Estimator
from .geodesy import Location, Ned, metres_from, to_ned
from .mission import Item
from .parameters import ParameterStore

POLYGONS = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLES = (mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
HEIGHT, CIRCLE, AREAS, FLOOR = 1, 2, 4, 8
"""Bits of FENCE_TYPE."""
NAMES = {HEIGHT: "Max Alt", CIRCLE: "Circle", AREAS: "Polygon", FLOOR: "Min Alt"}
FARTHER = {HEIGHT: 20.0, CIRCLE: 20.0, FLOOR: 20.0, AREAS: math.inf}
"""m that a vehicle must have gone on beyond a fence until it has broken it again (AC_FENCE_*_BACKUP_DISTANCE)."""
GIVE_UP = 100.0
"""m beyond the fence at which it has failed (AC_FENCE_GIVE_UP_DISTANCE)."""
INCLUSIONS = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
)


class Fenced(Protocol):
    """What the fence needs of its vehicle."""

    armed: bool
    estimator: Estimator
    parameters: ParameterStore

    @property
    def altitude(self) -> float:
        """Metres above home."""

    @property
    def home_offset(self) -> Ned:
        """Home in NED metres from the EKF origin."""

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT of a MAV_SEVERITY."""


class Fence:
    """The fence of one vehicle; `items` are what it stores."""

    def __init__(self, vehicle: Fenced) -> None:
        self._vehicle = vehicle
        self._broken: dict[int, float] = {}
        self._floor_counts = False
        self.items: Sequence[Item] = ()

    @property
    def enabled(self) -> bool:
        """Whether it is switched on."""
        return self._vehicle.parameters["FENCE_ENABLE"] == 1

    def newly_broken(self, *, landing: bool) -> int:
        """The bits of what has been broken since the last call; a vehicle that lands or has landed has no floor."""
        vehicle, new = self._vehicle, 0
        counts = self.enabled and vehicle.armed and vehicle.estimator.ready
        beyond = self._beyond(landing) if counts else {}
        for kind, metres in beyond.items():
            if kind not in self._broken or metres > self._broken[kind] + FARTHER[kind]:
                new, self._broken[kind] = new | kind, metres
        self._broken = {kind: metres for kind, metres in self._broken.items() if kind in beyond}
        return new

    @property
    def is_broken(self) -> bool:
        """Whether the vehicle is beyond it."""
        return bool(self._broken)

    @property
    def has_failed(self) -> bool:
        """Whether the vehicle is so far beyond it that it should only stop, or land."""
        return max(self._broken.values(), default=0.0) > GIVE_UP

    @property
    def lowest(self) -> float:
        """Metres above home that are safe: FENCE_ALT_MIN and FENCE_MARGIN."""
        return self._vehicle.parameters["FENCE_ALT_MIN"] + self._vehicle.parameters["FENCE_MARGIN"]

    @property
    def highest(self) -> float:
        """Metres above home that are safe: FENCE_ALT_MAX without FENCE_MARGIN."""
        return self._vehicle.parameters["FENCE_ALT_MAX"] - self._vehicle.parameters["FENCE_MARGIN"]

    @property
    def ceiling(self) -> float:
        """`highest`, while the greatest height is switched on; else infinite."""
        counts = self.enabled and int(self._vehicle.parameters["FENCE_TYPE"]) & HEIGHT
        return self.highest if counts else math.inf

    @property
    def return_point(self) -> tuple[float, float] | None:
        """Metres north and east of the EKF origin, of the point to which a plane returns; None without one."""
        return next((self._place(item) for item in self.items if item.command == RETURN_POINT), None)

    def words(self, kinds: int) -> str:
        """`Circle and Polygon fences breached`."""
        names = [name for kind, name in NAMES.items() if kinds & kind]
        return " and ".join(names) + (" fences" if len(names) > 1 else " fence") + " breached"

    def _beyond(self, landing: bool) -> dict[int, float]:
        """By kind, by how many m the vehicle is beyond it."""
        vehicle, parameters = self._vehicle, self._vehicle.parameters
        kinds = int(parameters["FENCE_TYPE"])
        here, home = vehicle.estimator.position, vehicle.home_offset
        found = {
            CIRCLE: math.dist(here[:2], home[:2]) - parameters["FENCE_RADIUS"],
            AREAS: max(self._outside(here), default=-1.0),
        }
        if "FENCE_ALT_MAX" in parameters:  # a rover has no heights
            found[HEIGHT] = vehicle.altitude - parameters["FENCE_ALT_MAX"]
            self._floor_counts = self._floor_counts and not landing
            if self._floor_counts:
                found[FLOOR] = parameters["FENCE_ALT_MIN"] - vehicle.altitude
            elif kinds & FLOOR and not landing and vehicle.altitude >= self.lowest:
                self._floor_counts = True
                vehicle.say(mavlink.MAV_SEVERITY_NOTICE, "Min Alt fence enabled (auto enable)")
        return {kind: metres for kind, metres in found.items() if kinds & kind and metres >= 0}

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
                sides = list(zip(corners, [*corners[1:], corners[0]], strict=True))
                edge = min(metres_from(here[:2], a, b) for a, b in sides)
                outside = -edge if _is_in(here[:2], sides) else edge
            yield outside if item.command in INCLUSIONS else -outside

    def _place(self, item: Item) -> tuple[float, float]:
        origin = self._vehicle.estimator.origin
        assert origin is not None
        return to_ned(origin, Location(from_deg_e7(item.x), from_deg_e7(item.y), 0.0))[:2]


def _is_in(at: Sequence[float], sides: Sequence[tuple[Sequence[float], Sequence[float]]]) -> bool:
    """Whether a ray to the east crosses the outline an odd number of times."""
    north, east = at
    inside = False
    for (n, e), (m, f) in sides:
        if (n > north) != (m > north) and east < (f - e) * (north - n) / (m - n) + e:
            inside = not inside
    return inside
