"""The way back of SMART_RTL, from AP_SmartRTL.cpp; what loops in it is not cut off."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .geodesy import Ned, metres_from
from .parameters import ParameterStore

Point = Sequence[float]


class ReturnPath:
    """Where a vehicle has come from since it was armed, SRTL_ACCURACY metres from point to point."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._points: list[Ned] = []

    def begin(self, position: Ned) -> None:
        """Arming: there it ends."""
        self._points = [position]

    def add(self, position: Ned) -> None:
        """Where the vehicle is now."""
        if self._points and math.dist(position, self._points[-1]) >= self._parameters["SRTL_ACCURACY"]:
            self._points.append(position)

    @property
    def is_known(self) -> bool:
        """Whether there is a way back."""
        return bool(self._points)

    def points(self) -> list[Ned]:
        """The way, from its end at home on, without the points that lie near a straight line."""
        return [Ned(*point) for point in simplified(self._points, self._parameters["SRTL_ACCURACY"] / 2)]


def simplified(path: Sequence[Point], accuracy: float) -> list[Point]:
    """The path (metres) with the points left out that lie within accuracy of a straight line.

    The algorithm is Ramer, Douglas and Peucker's, as in ArduPilot's SmartRTL.
    """
    if len(path) < 3:
        return list(path)
    distances = [metres_from(point, path[0], path[-1]) for point in path[1:-1]]
    farthest = max(range(len(distances)), key=distances.__getitem__) + 1
    if distances[farthest - 1] <= accuracy:
        return [path[0], path[-1]]
    return simplified(path[: farthest + 1], accuracy)[:-1] + simplified(path[farthest:], accuracy)
