"""The rules of an envelope in its flat frame: prisms to be inside of, or outside of. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, Point

from mavproxy_uavapi.core.airspace.local_frame import Spot

AT_ONCE = 500  # lines that shapely looks for; it holds all other threads meanwhile
Span = tuple[float, float]  # of a way, by its parameter: point number plus the share of the leg after it


@dataclass(frozen=True)
class Prism:
    """A polygon of the flat frame (x east, y north), from a floor to a ceiling in m above home."""

    shape: Any
    floor: float = -math.inf
    ceiling: float = math.inf

    def spans(self, a: Spot, b: Spot) -> Iterator[Span]:
        """The parts of the way from `a` to `b` that lie inside, as shares of it."""
        low, high = self._between(a.up, b.up)
        if low > high or self._is_far_from(a, b):
            return
        for begin, end in _spans_2d(self.shape, a, b):
            if max(begin, low) <= min(end, high):
                yield max(begin, low), min(end, high)

    @cached_property
    def _bounds(self) -> tuple[float, float, float, float]:
        return tuple(self.shape.bounds)  # west, south, east, north

    def _is_far_from(self, a: Spot, b: Spot) -> bool:
        """Whether the way passes outside the polygon's bounding box, which is quick to see."""
        west, south, east, north = self._bounds
        beside = max(a.east, b.east) < west or min(a.east, b.east) > east
        return beside or max(a.north, b.north) < south or min(a.north, b.north) > north

    def _between(self, a: float, b: float) -> Span:
        """The part of a climb from `a` to `b` between floor and ceiling; empty if it ends before it begins."""
        if a == b:
            return (0.0, 1.0) if self.floor <= a <= self.ceiling else (1.0, 0.0)
        ends = sorted((bound - a) / (b - a) for bound in (self.floor, self.ceiling))
        return max(ends[0], 0.0), min(ends[1], 1.0)

    def outside_by(self, spot: Spot) -> float:
        """Metres to get inside; 0 inside."""
        if self.shape.is_empty:
            return math.inf  # nothing of the polygon is that far from its borders
        beside = float(self.shape.distance(Point(spot.east, spot.north)))
        return math.hypot(beside, max(self.floor - spot.up, spot.up - self.ceiling, 0.0))

    def inside_by(self, spot: Spot) -> float:
        """Metres to get outside; 0 outside."""
        point = Point(spot.east, spot.north)
        if not self.shape.covers(point):
            return 0.0
        beside = float(self.shape.boundary.distance(point))
        return max(min(beside, spot.up - self.floor, self.ceiling - spot.up), 0.0)


@dataclass(frozen=True)
class Rule:
    """Be in one of these prisms, or in none of them."""

    what: str
    prisms: tuple[Prism, ...]
    inside: bool

    def broken(self, a: Spot, b: Spot) -> list[Span]:
        """The parts of the way from `a` to `b` that break it, as shares of it."""
        spans = sorted(span for prism in self.prisms for span in prism.spans(a, b))
        return _gaps(spans) if self.inside else list(joined(spans))

    def leaves(self, begins: Any, ends: Any, lines: Any) -> Any:
        """Which of many straight lines may break it, of one to be inside of: a mask. No other does.

        `lines` are shapely's, east and north.
        """
        (south, west, low), (north, east, high) = np.minimum(begins, ends).T, np.maximum(begins, ends).T
        mask = np.ones(len(lines), dtype=bool)
        for prism in self.prisms:
            least_east, least_north, most_east, most_north = prism.shape.bounds
            near = (east >= least_east) & (west <= most_east) & (north >= least_north) & (south <= most_north)
            fits = mask & near & (low >= prism.floor) & (high <= prism.ceiling)
            fits[fits] = shapely.covers(prism.shape, lines[fits])
            mask &= ~fits
        return mask

    def broken_by(self, spot: Spot) -> float:
        """By how many metres a point breaks it; 0 where it does not."""
        if self.inside:
            return min((prism.outside_by(spot) for prism in self.prisms), default=math.inf)
        return max((prism.inside_by(spot) for prism in self.prisms), default=0.0)


class Rules:
    """The rules of an envelope for one vehicle, in their order, and which of them a way comes near to."""

    def __init__(self, rules: Sequence[Rule]) -> None:
        self.inside = [rule for rule in rules if rule.inside]
        self._outside = [rule for rule in rules if not rule.inside]
        self._tree = shapely.STRtree([rule.prisms[0].shape for rule in self._outside])

    def near(self, way: Sequence[Spot]) -> Iterator[Rule]:
        """Those that a way of points that are numbers may break, and others."""
        yield from self.inside
        norths, easts, _ = zip(*way, strict=True)
        box = shapely.box(min(easts), min(norths), max(easts), max(norths))
        for number in sorted(self._tree.query(box)):
            yield self._outside[int(number)]

    def suspects(self, begins: Any, ends: Any) -> Any:
        """Which of many straight lines may break one: a mask. No other does."""
        lines = shapely.linestrings(np.stack([begins[:, 1::-1], ends[:, 1::-1]], axis=1))
        mask = np.zeros(len(lines), dtype=bool)
        for rule in self.inside:
            mask |= rule.leaves(begins, ends, lines)
        floors, ceilings = (
            np.array([(p.floor, p.ceiling) for rule in self._outside for p in rule.prisms]).reshape(-1, 2).T
        )
        low, high = np.minimum(begins[:, 2], ends[:, 2]), np.maximum(begins[:, 2], ends[:, 2])
        for first in range(0, len(lines), AT_ONCE):
            found, rule_numbers = self._tree.query(lines[first : first + AT_ONCE], predicate="intersects")
            found += first
            meets = (high[found] >= floors[rule_numbers]) & (low[found] <= ceilings[rule_numbers])
            mask[found[meets]] = True
        return mask


def _spans_2d(shape: Any, a: Spot, b: Spot) -> Iterator[Span]:
    """The parts of a way over the ground that lie in a shape."""
    east, north = b.east - a.east, b.north - a.north
    square = east * east + north * north
    if square < 1e-12:
        if shape.covers(Point(a.east, a.north)):
            yield 0.0, 1.0
        return
    line = LineString([(a.east, a.north), (b.east, b.north)])
    if shape.covers(line):
        yield 0.0, 1.0
        return
    if not shape.intersects(line):
        return
    for part in shapely.get_parts(shape.intersection(line)):
        if part.geom_type == "LineString":
            ends = [
                ((x - a.east) * east + (y - a.north) * north) / square for x, y in (part.coords[0], part.coords[-1])
            ]
            yield max(min(ends), 0.0), min(max(ends), 1.0)


def joined(spans: Iterable[Span]) -> Iterator[Span]:
    """Spans in order, those that touch as one."""
    open_span: Span | None = None
    for begin, end in sorted(spans):
        if open_span is None:
            open_span = begin, end
        elif begin <= open_span[1] + 1e-9:
            open_span = open_span[0], max(open_span[1], end)
        else:
            yield open_span
            open_span = begin, end
    if open_span is not None:
        yield open_span


def _gaps(spans: Iterable[Span]) -> list[Span]:
    """The parts of a whole way that none of the spans covers."""
    gaps, reached = [], 0.0
    for begin, end in joined(spans):
        if begin > reached + 1e-9:
            gaps.append((reached, begin))
        reached = max(reached, end)
    if reached < 1.0 - 1e-9:
        gaps.append((reached, 1.0))
    return gaps
