"""Where vehicles will be, and whether two of them come too near to each other. Pure.

A forecast is a row of straight pieces of a way, each with the times between which the vehicle may be on it. Two
vehicles come too near where two such pieces are too near and their times overlap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot

FINE = 8  # pieces in the distance to be kept
MOST = 400  # pieces of one way besides one for each leg; those of a longer way are longer, and count for longer
AT_ONCE = 250_000  # pairs of pieces that are compared in one go
LEAST_PACE = 0.1  # m/s; a speed of 0 must not make a way endless
Box = tuple[Any, Any]  # the least and the greatest m north, east and up


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
class Path:
    """Straight legs, one after the other, as arrays: thousands of them are as quick as a few.

    Attributes:
        begins, ends: m north, east and up for each leg; or latitude and longitude in degrees, and m up.
        fastest, slowest: the paces that it may be flown at.
        waits: s that the vehicle waits at its end.
        margins: m beside it, over the ground, that the vehicle may be.
        circles: of a part of a circle the number of the mission's item; 0 for other legs. The vehicle may be on any
            part of it from its arrival on, nobody knows how long.
    """

    begins: Any
    ends: Any
    fastest: Any
    slowest: Any
    waits: Any
    margins: Any
    circles: Any

    @classmethod
    def through(cls, places: Sequence[Sequence[float]], pace: Pace) -> Path:
        """A path from place to place at one pace; a single place is one, too."""
        at = np.array([*places, *places[-1:]] if len(places) == 1 else places, dtype=float)
        paces = np.tile(np.array(pace), (len(at) - 1, 1))
        return cls(at[:-1], at[1:], paces, paces.copy(), *np.zeros((3, len(at) - 1)))

    def part(self, begin: int, end: int | None = None) -> Path:
        """The legs from number `begin` to before `end`, from 0."""
        return Path(*(column[begin:end] for column in vars(self).values()))

    def then(self, after: Path) -> Path:
        """This path and another one after it."""
        pairs = zip(vars(self).values(), vars(after).values(), strict=True)
        return Path(*(np.concatenate(pair) for pair in pairs))

    def raised(self, up: float) -> Path:
        """The same path so many m higher."""
        return replace(self, begins=self.begins + (0.0, 0.0, up), ends=self.ends + (0.0, 0.0, up))

    def box(self) -> Box:
        """The box around it."""
        lows, highs = _boxes(self)
        return lows.min(axis=0), highs.max(axis=0)

    def in_frame(self, frame: LocalFrame) -> Path:
        """A path in degrees in the metres of a flat frame."""
        return replace(self, begins=frame.spots(self.begins), ends=frame.spots(self.ends))


Way = tuple[Path, bool]  # in degrees and m up; whether each leg may be flown at any time


@dataclass(frozen=True)
class Forecast:
    """Where a vehicle may be, and when.

    Attributes:
        begins, ends: m north, east, up; one row for each piece. The first is the point where it is now.
        early, late: s from now, for each piece.
        margins: m beside each piece, over the ground, that it may be.
    """

    begins: Any
    ends: Any
    early: Any
    late: Any
    margins: Any

    def at_any_time(self) -> Forecast:
        """The same way, each place at any time: for a vehicle of which nobody knows how far it has come."""
        return replace(self, early=np.zeros_like(self.early), late=np.full_like(self.late, math.inf))

    def reached(self, speed: float, seconds: float) -> Forecast:
        """The pieces that it may reach in so many s: straight from where it is now, at that speed (m/s)."""
        away = gaps_between(self.begins[:1], self.begins[:1], self.begins, self.ends) - self.margins
        early = np.maximum(self.early, away / max(speed, LEAST_PACE))
        return replace(self, early=early)._only(early <= seconds)

    def near(self, other: Forecast, distance: float) -> Forecast:
        """The pieces that are not farther than that from the box around another forecast."""
        (lows, highs), (other_lows, other_highs) = _boxes(self), _boxes(other)
        low, high = other_lows.min(axis=0) - distance, other_highs.max(axis=0) + distance
        return self._only(((highs >= low) & (lows <= high)).all(axis=1))

    def _only(self, pieces: Any) -> Forecast:
        """Some of its pieces: a slice, or whether each one counts."""
        return Forecast(*(column[pieces] for column in vars(self).values()))


class NearMiss(NamedTuple):
    """Where two vehicles first come too near: our vehicle's place, the time until then (s), and the least gap (m)."""

    at: Spot
    seconds: float
    gap: float


def common_box(ours: Path, theirs: Path, distance: float) -> Box | None:
    """Where each of two paths may be nearer to the other than that; None for nowhere."""
    lows, highs = zip(*(one.box() for one in (ours, theirs)), strict=True)
    low, high = np.maximum(*lows) - distance, np.minimum(*highs) + distance
    return (low, high) if (low <= high).all() else None


def along_path(
    path: Path, slack: Slack, distance: float, *, seconds: float = math.inf, box: Box | None = None
) -> Forecast:
    """The forecast of a way. The vehicle stays at its end.

    Args:
        path: the way in metres; it begins where the vehicle is now.
        slack: how late or early it may be.
        distance: m to be kept.
        seconds: how far the forecast goes; what may be reached later is not in it.
        box: legs that are outside of it are not in it.
    """
    first, last = path.begins[:1], len(path.begins) - 1
    legs = np.arange(last + 1)
    if box is not None:
        lows, highs = _boxes(path)
        legs = legs[((highs >= box[0]) & (lows <= box[1])).all(axis=1)]
    path = path.part(0, int(legs[-1]) + 1 if len(legs) else 0)
    starts, stops, waits = path.begins, path.ends, path.waits
    lengths = np.linalg.norm(stops[legs] - starts[legs], axis=1)
    counts = np.maximum(np.ceil(lengths / max(distance / FINE, lengths.sum() / MOST)), 1).astype(int)
    leg, of = (
        np.repeat(legs, counts),
        np.repeat(counts, counts),
    )  # of each piece: its leg, and the number of its pieces
    number = np.arange(counts.sum()) - np.repeat(counts.cumsum() - counts, counts)  # of a piece in its leg
    share, next_share = number / of, (number + 1) / of
    quick, slow = _lasts(stops - starts, path.fastest), _lasts(stops - starts, path.slowest)
    on_circle, first_of_circle = path.circles > 0, _first_of_equal(path.circles)
    slow = np.where(on_circle, math.inf, slow)
    soonest, latest = _begins(quick + np.where(np.isfinite(waits), waits, 0.0)), _begins(slow + waits)
    soonest, quick = np.where(on_circle, soonest[first_of_circle], soonest), np.where(on_circle, 0.0, quick)
    early = (soonest[leg] + share * quick[leg]) * (1 - slack.share) - slack.ahead
    late = (latest[leg] + next_share * slow[leg]) * (1 + slack.share) + slack.behind * (leg + 2)
    late += np.where(next_share == 1, waits[leg], 0.0) * (1 + slack.share)
    late = np.where((leg == last) & (next_share == 1), math.inf, late)
    begins = np.concatenate([first, (1 - share)[:, None] * starts[leg] + share[:, None] * stops[leg]])
    ends = np.concatenate([first, (1 - next_share)[:, None] * starts[leg] + next_share[:, None] * stops[leg]])
    if on_circle.any():  # the other side of one on which it is already takes its time
        away = gaps_between(first, first, begins[1:], ends[1:]) - path.margins[leg]
        straight = away / np.linalg.norm(path.fastest[leg], axis=1) * (1 - slack.share) - slack.ahead
        early = np.where(on_circle[leg], np.maximum(early, straight), early)
    early = np.concatenate([[0.0], np.maximum(early, 0.0)])
    late = np.concatenate([[slack.behind], late])
    margins = np.concatenate([[0.0], path.margins[leg]])
    return Forecast(begins, ends, early, late, margins)._only(early <= seconds)


def _begins(lasts: Any) -> Any:
    """When each of several things begins that follow one another."""
    return np.concatenate([[0.0], lasts.cumsum()[:-1]])


def _first_of_equal(numbers: Any) -> Any:
    """For each of several numbers the place of the first of those equal ones in a row to which it belongs."""
    begins = np.diff(numbers, prepend=math.nan) != 0
    return np.maximum.accumulate(np.where(begins, np.arange(len(numbers)), 0))


def _lasts(ways: Any, paces: Any) -> Any:
    """Seconds along each leg."""
    level, climb, descent = np.maximum(paces, LEAST_PACE).T
    up = ways[:, 2]
    return np.maximum(np.hypot(ways[:, 0], ways[:, 1]) / level, np.abs(up) / np.where(up > 0, climb, descent))


def near_miss(ours: Forecast, theirs: Forecast, distance: float) -> NearMiss | None:
    """Where two vehicles first come nearer than `distance` m; None if they do not.

    If the two are nearer than `distance` already, only a further approach counts.
    """
    if not len(ours.begins) or not len(theirs.begins):
        return None
    limit = min(distance, float(np.linalg.norm(ours.begins[0] - theirs.begins[0])) - 1e-6)
    ours, theirs = ours.near(theirs, distance), theirs.near(ours, distance)
    count = len(theirs.begins)
    rows = max(AT_ONCE // max(count, 1), 1)
    for begin in range(0, len(ours.begins) if count else 0, rows):
        found = _first(ours._only(slice(begin, begin + rows)), theirs, limit)
        if found is not None:
            return found
    return None


def _first(ours: Forecast, theirs: Forecast, limit: float) -> NearMiss | None:
    near = (ours.early[:, None] <= theirs.late[None, :]) & (theirs.early[None, :] <= ours.late[:, None])
    (lows, highs), (their_lows, their_highs) = _boxes(ours), _boxes(theirs)
    for axis in range(3):
        near &= lows[:, None, axis] < their_highs[None, :, axis] + limit
        near &= their_lows[None, :, axis] < highs[:, None, axis] + limit
    rows, columns = np.nonzero(near)
    ends = ours.begins[rows], ours.ends[rows], theirs.begins[columns], theirs.ends[columns]
    gaps, beside = gaps_between(*ends), ours.margins[rows] + theirs.margins[columns]
    if beside.any():
        gaps = np.where(beside > 0, _least_gaps(*ends, beside), gaps)
    too_near = gaps < limit
    if not too_near.any():
        return None
    rows, columns, gaps = rows[too_near], columns[too_near], gaps[too_near]
    row = rows[0]
    column = columns[rows == row][int(np.argmin(gaps[rows == row]))]
    at = max(float(ours.early[row]), float(theirs.early[column]))
    return NearMiss(Spot(*map(float, ours.begins[row])), at, float(gaps.min()))


def _boxes(legs: Path | Forecast) -> tuple[Any, Any]:
    """The box around each leg or piece, with its margin over the ground: the lowest and the highest corners."""
    lows, highs = np.minimum(legs.begins, legs.ends), np.maximum(legs.begins, legs.ends)
    if legs.margins.any():
        beside = np.multiply.outer(legs.margins, (1.0, 1.0, 0.0))
        lows, highs = lows - beside, highs + beside
    return lows, highs


def _least_gaps(a: Any, b: Any, c: Any, d: Any, beside: Any) -> Any:
    """Metres, at the least, between what is so many m beside two lines over the ground."""
    level = gaps_between(*(ends * (1.0, 1.0, 0.0) for ends in (a, b, c, d))) - beside
    up = np.maximum(a[:, 2], b[:, 2]), np.minimum(c[:, 2], d[:, 2])
    down = np.maximum(c[:, 2], d[:, 2]), np.minimum(a[:, 2], b[:, 2])
    upright = np.maximum(up[1] - up[0], down[1] - down[0])
    return np.hypot(np.maximum(level, 0.0), np.maximum(upright, 0.0))


def gaps_between(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Metres between the straight lines from `a` to `b` and those from `c` to `d`, row by row.

    Ericson, Real-Time Collision Detection, 5.1.9.
    """
    u, v, r = b - a, d - c, a - c
    uu, vv = np.maximum((u * u).sum(axis=1), 1e-12), np.maximum((v * v).sum(axis=1), 1e-12)
    uv, ur, vr = (u * v).sum(axis=1), (u * r).sum(axis=1), (v * r).sum(axis=1)
    apart = uu * vv - uv * uv
    parallel = apart <= 1e-9 * uu * vv
    s = np.where(parallel, 0.0, np.clip((uv * vr - ur * vv) / np.where(parallel, 1.0, apart), 0.0, 1.0))
    t = np.clip((uv * s + vr) / vv, 0.0, 1.0)
    s = np.clip((uv * t - ur) / uu, 0.0, 1.0)
    t = np.clip((uv * s + vr) / vv, 0.0, 1.0)
    return np.linalg.norm(r + s[:, None] * u - t[:, None] * v, axis=1)
