"""The way back of SMART_RTL."""

from __future__ import annotations

import math

Point = tuple[float, float]


def simplified(path: list[Point], accuracy: float) -> list[Point]:
    """The path (metres north, east) with the points left out that lie within accuracy of a straight line.

    The algorithm is Ramer, Douglas and Peucker's, as in ArduPilot's SmartRTL.
    """
    if len(path) < 3:
        return list(path)
    distances = [_off_line(point, path[0], path[-1]) for point in path[1:-1]]
    farthest = max(range(len(distances)), key=distances.__getitem__) + 1
    if distances[farthest - 1] <= accuracy:
        return [path[0], path[-1]]
    return simplified(path[: farthest + 1], accuracy)[:-1] + simplified(path[farthest:], accuracy)


def _off_line(point: Point, start: Point, end: Point) -> float:
    """Metres from the stretch between start and end."""
    north, east = end[0] - start[0], end[1] - start[1]
    length = north * north + east * east
    share = ((point[0] - start[0]) * north + (point[1] - start[1]) * east) / length if length > 0 else 0.0
    share = max(0.0, min(1.0, share))
    return math.dist(point, (start[0] + share * north, start[1] + share * east))
