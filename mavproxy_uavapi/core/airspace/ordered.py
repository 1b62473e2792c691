"""The movement that a vehicle was commanded last, and how far it has come on its way. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mavproxy_uavapi.core.airspace.forecast import Pace, Path, Way, gaps_between
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot, to_leg
from mavproxy_uavapi.core.mission.mission_legs import PathPoint

CORNER = 3.0  # m; a vehicle this near to a corner of its way has passed it


@dataclass(eq=False)
class Ordered:
    """The movement that the newest message commands.

    Attributes:
        way: its path; empty where none is known, and for a mission.
        is_to_place: whether it leads to positions, or is a velocity.
        at: when it was sent (s).
        passed: legs of the path that the vehicle has flown.
        mission: the legs of a mission.
        loops: whether it is a mission that goes round, so that nobody knows how far it has come.
        fastest: m/s in any direction, of a mission.
        allowed_by: the envelopes that it was held against.
        is_unread: whether it may be a mission that nobody has looked at.
    """

    way: Sequence[PathPoint] = ()
    is_to_place: bool = True
    at: float = -math.inf
    passed: int = 0
    mission: Path | None = None
    loops: bool = False
    fastest: float = 0.0
    allowed_by: Sequence[Any] = ()
    is_unread: bool = True

    @classmethod
    def by_mission(cls, way: Way | None, at: float) -> Ordered:
        """The order to fly a mission; None for one without legs."""
        if way is None:
            return cls(at=at, is_unread=False)
        path, loops = way
        fastest = float(np.linalg.norm(path.fastest, axis=1).max())
        return cls(at=at, mission=path, loops=loops, fastest=fastest, is_unread=False)

    def advance(self, here: PathPoint, item: int | None = None) -> None:
        """Note how far the vehicle, which is at `here`, has come on its way; `item`: that of its mission it flies.

        From a circle it comes when it flies another item.
        """
        path = self._path
        if path is None or self.loops:
            return
        frame, at = LocalFrame((here.lat, here.lon)), Spot(0.0, 0.0, here.up)
        while self.passed + 1 < len(path.begins):
            if circle := path.circles[self.passed]:
                if item is None or item <= circle:
                    break
                self.passed += 1
                continue
            corners = path.begins[self.passed], path.ends[self.passed], path.ends[self.passed + 1]
            if not _is_past(at, [frame.spot((float(lat), float(lon)), float(up)) for lat, lon, up in corners]):
                break
            self.passed += 1

    @property
    def ahead(self) -> Sequence[PathPoint]:
        """The corners of its way that are still ahead; empty if it has none, and for a mission: see `path_ahead`."""
        return self.way if len(self.way) < 2 else self.way[self.passed + 1 :]

    @property
    def path_ahead(self) -> Path | None:
        """The legs of its mission that are still ahead, all of them with `loops`; None where it has none."""
        return None if self.mission is None else self.mission.part(self.passed)

    @property
    def has_come_to_wait(self) -> bool:
        """Whether the last place of its mission that it has passed is one at which it waits."""
        return self.mission is not None and self.passed > 0 and bool(self.mission.waits[self.passed - 1] > 0)

    def is_beside(self, stop: PathPoint, within: float) -> bool:
        """Whether a place is not farther than `within` m, or a leg's margin, from the path; False without one."""
        if self._lines is None:
            return False
        here = np.array([self._lines[0].spot((stop.lat, stop.lon), stop.up)])
        present, all_legs = slice(max(self.passed - 1, 0), self.passed + 2), slice(None)
        return any(self._is_near(here, within, legs) for legs in (present, all_legs))

    def _is_near(self, here: Any, within: float, legs: slice) -> bool:
        assert self._lines is not None
        begins, ends, lows, highs, margins = (part[legs] for part in self._lines[1:])
        reach = np.maximum(margins, within)[:, None]
        near = ((lows - reach <= here) & (here <= highs + reach)).all(axis=1)
        return bool((gaps_between(here, here, begins[near], ends[near]) <= reach[near, 0]).any())

    @cached_property
    def _path(self) -> Path | None:
        if self.mission is not None or len(self.way) < 2:
            return self.mission
        return Path.through(self.way, Pace(1.0, 1.0, 1.0))

    @cached_property
    def _lines(self) -> tuple[LocalFrame, Any, Any, Any, Any, Any] | None:
        """A flat frame, and each leg in it: beginning, end, the box around them, and its margin; None for no legs."""
        path = self._path
        if path is None:
            return None
        lat, lon, _ = map(float, path.begins[0])
        frame = LocalFrame((lat, lon))
        begins, ends = frame.spots(path.begins), frame.spots(path.ends)
        return frame, begins, ends, np.minimum(begins, ends), np.maximum(begins, ends), path.margins


def _is_past(at: Spot, corners: Sequence[Spot]) -> bool:
    """Whether a vehicle at `at` has passed the second of three corners."""
    a, b, c = corners
    return math.dist(at, b) < CORNER or to_leg(at, b, c) + CORNER < to_leg(at, a, b)
