"""The movement that a vehicle was commanded last, and how far it has come on its way. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mavproxy_uavapi.core.airspace.forecast import Pace, Path, gaps_between
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot, to_leg
from mavproxy_uavapi.core.mission.mission_legs import MissionRoute, PathPoint

CORNER = 3.0  # m; a vehicle this near to a corner of its way has passed it


@dataclass(eq=False)
class Ordered:
    """The movement that the newest message commands.

    Attributes:
        way: its path; empty where none is known.
        is_to_place: whether it leads to positions, or is a velocity.
        at: when it was sent (s).
        passed: legs of the path that the vehicle has flown.
        route: that of a mission; `way` has the corners of its legs then.
    """

    way: Sequence[PathPoint] = ()
    is_to_place: bool = True
    at: float = -math.inf
    passed: int = 0
    route: MissionRoute | None = None

    @classmethod
    def by_mission(cls, route: MissionRoute, at: float) -> Ordered:
        """The order to fly a mission."""
        legs = route.legs
        return cls([legs[0].begin, *(leg.end for leg in legs)] if legs else (), at=at, route=route)

    @property
    def loops(self) -> bool:
        """Whether it is a mission that goes round, so that nobody knows how far it has come."""
        return self.route is not None and self.route.loops

    def advance(self, here: PathPoint) -> None:
        """Note how far the vehicle, which is at `here`, has come on its way."""
        if len(self.way) < 2 or self.loops:
            return
        frame, at = LocalFrame((here.lat, here.lon)), Spot(0.0, 0.0, here.up)
        while self.passed + 2 < len(self.way):
            corners = [frame.spot(stop[:2], stop.up) for stop in self.way[self.passed : self.passed + 3]]
            if not _is_past(at, corners):
                break
            self.passed += 1

    @property
    def ahead(self) -> Sequence[PathPoint]:
        """The corners of its way that are still ahead; empty if it has none."""
        return self.way if len(self.way) < 2 or self.loops else self.way[self.passed + 1 :]

    @property
    def path_ahead(self) -> Path | None:
        """The legs of its mission that are still ahead, all of them with `loops`; None where it has none."""
        return None if self.route is None or not self.route.legs else self.route.path.part(self.passed)

    def is_beside(self, stop: PathPoint, within: float) -> bool:
        """Whether a place is not farther than `within` m, or a leg's margin, from the path; False without one."""
        if self._lines is None:
            return False
        frame, begins, ends, lows, highs, margins = self._lines
        here = np.array([frame.spot((stop.lat, stop.lon), stop.up)])
        reach = np.maximum(margins, within)[:, None]
        near = ((lows - reach <= here) & (here <= highs + reach)).all(axis=1)
        return bool((gaps_between(here, here, begins[near], ends[near]) <= reach[near, 0]).any())

    @cached_property
    def _lines(self) -> tuple[LocalFrame, Any, Any, Any, Any, Any] | None:
        """A flat frame, and each leg in it: beginning, end, the box around them, and its margin; None for no legs."""
        if len(self.way) < 2:
            return None
        path = Path.through(self.way, Pace(1.0, 1.0, 1.0)) if self.route is None else self.route.path
        margins = (
            np.zeros(len(path.begins)) if self.route is None else np.array([leg.margin for leg in self.route.legs])
        )
        frame = LocalFrame(self.way[0][:2])
        begins, ends = frame.spots(path.begins), frame.spots(path.ends)
        return frame, begins, ends, np.minimum(begins, ends), np.maximum(begins, ends), margins


def _is_past(at: Spot, corners: Sequence[Spot]) -> bool:
    """Whether a vehicle at `at` has passed the second of three corners."""
    a, b, c = corners
    return math.dist(at, b) < CORNER or to_leg(at, b, c) + CORNER < to_leg(at, a, b)
