"""Where vehicles will be, and whether two of them come too near to each other. Pure.

A forecast is a row of points along a way, each with the times between which the vehicle may be there. Two vehicles
come too near where two such points are too near and their times overlap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mavproxy_uavapi.core.airspace.space import Spot

FINE = 8  # points in the distance to be kept
MOST = 400  # points of one way; those of a longer way lie farther apart, and count as wider
LEAST_PACE = 0.1  # m/s; a speed of 0 must not make a way endless


class Pace(NamedTuple):
    """How fast a vehicle flies to places, m/s."""

    level: float
    climb: float
    descent: float


class Slack(NamedTuple):
    """How far a vehicle may be off its times: `ahead` s early, `behind` s late for each leg, and a share."""

    ahead: float
    behind: float
    share: float


@dataclass(frozen=True)
class Forecast:
    """Where a vehicle may be, and when.

    Attributes:
        points: m north, east, up; one row for each, the first is where it is now.
        early, late: s from now, for each point.
        apart: m between neighbours.
    """

    points: Any
    early: Any
    late: Any
    apart: float

    def at_any_time(self) -> Forecast:
        """The same points, each at any time: for a vehicle that does not report its position."""
        return Forecast(self.points, np.zeros_like(self.early), np.full_like(self.late, math.inf), self.apart)


class Meeting(NamedTuple):
    """Where two vehicles first come too near: our vehicle's place, the time until then (s), and the least gap (m)."""

    at: Spot
    seconds: float
    gap: float


def along(
    spots: Sequence[Spot],
    pace: Pace,
    slack: Slack,
    distance: float,
    *,
    seconds: float = math.inf,
) -> Forecast:
    """The forecast of a way. The vehicle stays at its end.

    Args:
        spots: the corners, the first is where the vehicle is now.
        pace: how fast it flies.
        slack: how late or early it may be.
        distance: m to be kept.
        seconds: how far the forecast goes; what may be reached later is not in it.
    """
    legs = [_leg(a, b, pace) for a, b in zip(spots, spots[1:], strict=False)]
    apart = max(distance / FINE, sum(length for length, _ in legs) / MOST)
    points, times, slower = [np.array([spots[0]])], [np.zeros(1)], [np.array([slack.behind])]
    begun = 0.0
    for number, ((length, lasts), a, b) in enumerate(zip(legs, spots, spots[1:], strict=False), 2):
        shares = np.linspace(0.0, 1.0, math.ceil(length / apart) + 1)[1:]
        points.append(np.outer(1 - shares, a) + np.outer(shares, b))
        times.append(begun + shares * lasts)
        slower.append(np.full_like(shares, slack.behind * number))
        begun += lasts
        if begun * (1 - slack.share) - slack.ahead > seconds:
            break
    planned = np.concatenate(times)
    early = np.maximum(planned * (1 - slack.share) - slack.ahead, 0.0)
    late = planned * (1 + slack.share) + np.concatenate(slower)
    late[-1] = math.inf
    kept = early <= seconds
    return Forecast(np.concatenate(points)[kept], early[kept], late[kept], apart)


def _leg(a: Spot, b: Spot, pace: Pace) -> tuple[float, float]:
    """Metres, and seconds."""
    level, up = math.hypot(b.north - a.north, b.east - a.east), b.up - a.up
    vertical = pace.climb if up > 0 else pace.descent
    return math.hypot(level, up), max(level / max(pace.level, LEAST_PACE), abs(up) / max(vertical, LEAST_PACE))


def meeting(ours: Forecast, theirs: Forecast, distance: float) -> Meeting | None:
    """Where two vehicles first come nearer than `distance` m; None if they do not.

    If the two are nearer than `distance` already, only a further approach counts.
    """
    if not len(ours.points) or not len(theirs.points):
        return None
    gaps = np.linalg.norm(ours.points[:, None, :] - theirs.points[None, :, :], axis=2)
    # Points this far apart may lie on ways that are nearer.
    between = math.hypot(distance, (ours.apart + theirs.apart) / 2)
    limit = min(between, float(gaps[0, 0]) - 1e-6)
    together = (ours.early[:, None] <= theirs.late[None, :]) & (theirs.early[None, :] <= ours.late[:, None])
    near = (gaps < limit) & together
    rows = near.any(axis=1)
    if not rows.any():
        return None
    row = int(np.argmax(rows))
    column = int(np.argmin(np.where(near[row], gaps[row], math.inf)))
    at = max(float(ours.early[row]), float(theirs.early[column]))
    return Meeting(Spot(*map(float, ours.points[row])), at, float(gaps[near].min()))
