"""An envelope as geometry: whether a way stays inside, and if not, what it breaks, where and by how much. Pure.

The frame is flat: north, east and up in metres, around the middle of the envelope, east by the cosine of the latitude
there (`LocalFrame`). A straight line in it is straight in degrees, so inside or outside of a polygon is exact at any
distance. Metres are those of `geodesy.py`, the autopilot's own. East of the middle they err by the share
tan(latitude) n + n^2 / 2, with n = (metres north of the middle) / 6378 km: at 45 degrees and 5 km by 0.08 %, at 60
degrees and 50 km by 1.4 %. A circle is a polygon of 256 corners, which errs to the safe side by 0.0001 of its radius.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon

from mavproxy_uavapi.core.airspace.model import LARGEST, Area, Envelope, Place
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE

QUARTER = 64  # corners of a quarter of a circle
SAFE_RADIUS = 1.0 / math.cos(math.pi / (4 * QUARTER))  # times the radius: a polygon around the circle, not in it
TOUCH = 0.02  # m: a shorter part outside does not count; MAVLink's 1e-7 degrees are 0.01 m
AT_ONCE = 500  # lines that shapely looks for; it holds all other threads meanwhile
Span = tuple[float, float]  # of a way, by its parameter: point number plus the share of the leg after it


class Spot(NamedTuple):
    """A point of the flat frame: metres north and east, and above home."""

    north: float
    east: float
    up: float


class LocalFrame:
    """A flat frame around a place.

    Args:
        origin: latitude and longitude, degrees.
    """

    def __init__(self, origin: Place) -> None:
        self.origin = origin
        self._east = METRES_PER_DEGREE * math.cos(math.radians(origin[0]))

    def metres(self, place: Place) -> tuple[float, float]:
        """Metres north and east of the origin."""
        delta = (place[1] - self.origin[1] + 180.0) % 360.0 - 180.0
        return (place[0] - self.origin[0]) * METRES_PER_DEGREE, delta * self._east

    def spot(self, place: Place, up: float) -> Spot:
        """The point at a place, `up` m above home."""
        return Spot(*self.metres(place), up)

    def spots(self, places: Any) -> Any:
        """The points of many places: an array of metres from one of degrees, each row with m above home."""
        east = places[:, 1] - self.origin[1]
        east -= 360.0 * np.rint(east / 360.0)
        north = (places[:, 0] - self.origin[0]) * METRES_PER_DEGREE
        return np.stack([north, east * self._east, places[:, 2]], axis=1)

    def degrees(self, spot: Spot) -> Place:
        """Latitude and longitude of a point."""
        lon = self.origin[1] + spot.east / self._east
        return self.origin[0] + spot.north / METRES_PER_DEGREE, (lon + 180.0) % 360.0 - 180.0


class Breach(NamedTuple):
    """What a way breaks: a name, where it is farthest outside, and by how many metres."""

    what: str
    at: Spot
    by: float


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
        return _gaps(spans) if self.inside else list(_joined(spans))

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


class Space:
    """An envelope, ready for questions.

    Attributes:
        envelope: as it is written.
        missing: why it is not known yet; then no place is inside. Empty if it is known.

    Raises:
        Invalid: an outline crosses itself, or it is too large.
    """

    def __init__(self, envelope: Envelope, missing: str = "") -> None:
        self.envelope, self.missing = envelope, missing
        corners = [corner for area in envelope.areas for corner in area.corners]
        self._frame = LocalFrame(_middle(corners)) if corners else None
        self._shapes = [(area, _shape(area, self._frame)) for area in envelope.areas if self._frame is not None]
        self._rules = lru_cache(maxsize=16)(lambda *question: Rules(tuple(self._make_rules(*question))))

    def frame(self, near: Place) -> LocalFrame:
        """The flat frame of all points; limits without any area have one around `near`."""
        return self._frame or LocalFrame(near)

    @property
    def has_heights(self) -> bool:
        """Whether it limits heights."""
        areas = self.envelope.areas
        return self.envelope.limits.height is not None or any(
            math.isfinite(area.floor) or math.isfinite(area.ceiling) for area in areas
        )

    def rules(self, home: tuple[float, float] | None, inset: float = 0.0, on_ground: bool = False) -> Rules:
        """The rules for a vehicle that keeps `inset` m from each border over the ground.

        Args:
            home: metres north and east; None where it is not known: then the distance from it is not limited here.
            inset: m.
            on_ground: whether it drives: no floor and no ceiling of an inclusion counts, and it is at 0 m.
        """
        return self._rules(home, inset, on_ground)

    def _make_rules(self, home: tuple[float, float] | None, inset: float, on_ground: bool) -> Iterator[Rule]:
        limits = self.envelope.limits
        inside = [(area, shape) for area, shape in self._shapes if area.inclusion]
        together = [[one] for one in inside] if self.envelope.every else [inside] if inside else []
        for group in together:
            shapes = [(area, _prepared(shape.buffer(-inset) if inset else shape)) for area, shape in group]
            prisms = (Prism(s) if on_ground else Prism(s, a.floor, a.ceiling) for a, s in shapes)
            names = " or ".join(dict.fromkeys(area.name for area, _ in group))
            yield Rule(names, tuple(prisms), inside=True)
        for area, shape in self._shapes:
            if not area.inclusion:
                wide = _prepared(shape.buffer(inset) if inset else shape)
                yield Rule(area.name, (Prism(wide, area.floor, area.ceiling),), inside=False)
        if limits.height is not None:
            everywhere = _prepared(shapely.box(-1e9, -1e9, 1e9, 1e9))
            yield Rule("the highest height", (Prism(everywhere, ceiling=limits.height),), inside=True)
        if limits.distance is not None and home is not None:
            disc = Point(home[1], home[0]).buffer(max(limits.distance - inset, 0.0), QUARTER)
            yield Rule("the farthest distance from home", (Prism(_prepared(disc)),), inside=True)

    def breach(self, way: Sequence[Spot], rules: Rules, *, may_return: bool = True) -> Breach | None:
        """What a way breaks; None where nothing.

        Args:
            way: its points in order; one point is a way, too.
            rules: those of `rules`.
            may_return: whether a way that begins outside may lead inside, straight and for good.
        """
        for spot in way:
            if not all(map(math.isfinite, spot)):
                return Breach("a place that is no number", spot, math.nan)
        for rule in rules.near(way):
            spans = list(_joined(_broken(way, rule)))
            worst = [(span, self._worst(way, span, rule)) for span in spans]
            outside = [(span, breach) for span, breach in worst if not breach.by <= TOUCH]
            returns = len(outside) == 1 and outside[0][0][0] == 0.0 and outside[0][0][1] < max(len(way) - 1, 1)
            if outside and not (may_return and returns):
                return max((breach for _, breach in outside), key=lambda breach: breach.by)
        return None

    def first_breach(self, begins: Any, ends: Any, rules: Rules) -> tuple[int, Breach] | None:
        """The first of many straight legs that breaks a rule: its number from 0, and what; None where none does.

        Only the first leg may begin outside and lead inside.

        Args:
            begins, ends: arrays with a row for each leg, as a `Spot`.
            rules: those of `rules`.
        """
        suspect = ~np.isfinite(begins).all(axis=1) | ~np.isfinite(ends).all(axis=1)
        known = np.flatnonzero(~suspect)
        suspect[known] = rules.suspects(begins[known], ends[known])
        for number in np.flatnonzero(suspect):
            way = [Spot(*map(float, end)) for end in (begins[number], ends[number])]
            breach = self.breach(way, rules, may_return=bool(number == 0))
            if breach is not None:
                return int(number), breach
        return None

    @staticmethod
    def _worst(way: Sequence[Spot], span: Span, rule: Rule) -> Breach:
        begin, end = span
        at = [begin, (begin + end) / 2, end, *range(math.ceil(begin), math.floor(end) + 1)]
        spots = [_at(way, share) for share in at]
        by, _, spot = max((rule.broken_by(spot), number, spot) for number, spot in enumerate(spots))
        return Breach(rule.what, spot, by)


def _broken(way: Sequence[Spot], rule: Rule) -> Iterator[Span]:
    """The parts of a whole way that break a rule, leg by leg."""
    legs = zip(way, way[1:], strict=False) if len(way) > 1 else [(way[0], way[0])]
    for number, (a, b) in enumerate(legs):
        for begin, end in rule.broken(a, b):
            yield number + begin, number + end


def rows(points: Sequence[tuple[float, float, float]]) -> Any:
    """An array with a row for each point. `np.array` would keep all other threads waiting for thousands of them."""
    return np.fromiter(chain.from_iterable(points), dtype=float, count=3 * len(points)).reshape(-1, 3)


def outside_by(spot: Spot, rules: Rules) -> float:
    """By how many metres a point is outside; 0 inside."""
    return max((rule.broken_by(spot) for rule in rules.near([spot])), default=0.0)


def to_leg(spot: Spot, a: Spot, b: Spot) -> float:
    """Metres from a point to the straight way from `a` to `b`."""
    leg = [q - p for p, q in zip(a, b, strict=True)]
    square = sum(part * part for part in leg)
    along = sum((p - q) * part for p, q, part in zip(spot, a, leg, strict=True)) / square if square else 0.0
    share = min(max(along, 0.0), 1.0)
    return math.dist(spot, [p + share * part for p, part in zip(a, leg, strict=True)])


def _at(way: Sequence[Spot], share: float) -> Spot:
    number = min(int(share), max(len(way) - 2, 0))
    a, b = way[number], way[min(number + 1, len(way) - 1)]
    rest = share - number
    return Spot(*(p + rest * (q - p) for p, q in zip(a, b, strict=True)))


def _middle(corners: Sequence[Place]) -> Place:
    """The middle of the corners; longitudes are taken around the first, for the date line."""
    first = corners[0][1]
    lats = [lat for lat, _ in corners]
    lons = [(lon - first + 180.0) % 360.0 - 180.0 for _, lon in corners]
    lon = first + (min(lons) + max(lons)) / 2
    return (min(lats) + max(lats)) / 2, (lon + 180.0) % 360.0 - 180.0


def _shape(area: Area, frame: LocalFrame) -> Any:
    """The area's polygon, x east and y north."""
    if any(math.hypot(*frame.metres(corner)) > LARGEST for corner in area.corners):
        raise Invalid(f"{area.name} reaches farther than {LARGEST / 1000:g} km from the envelope's middle")
    if area.centre is not None:
        north, east = frame.metres(area.centre)
        return Point(east, north).buffer(area.radius * (1.0 if area.inclusion else SAFE_RADIUS), QUARTER)
    rings = [[frame.metres(corner)[::-1] for corner in ring] for ring in area.rings]
    shape = Polygon(rings[0], rings[1:])
    if not shape.is_valid or shape.is_empty or shape.area < TOUCH**2:
        raise Invalid(f"{area.name} is not a valid polygon: {shapely.is_valid_reason(shape)}")
    return shape


def _prepared(shape: Any) -> Any:
    shapely.prepare(shape)
    return shape


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


def _joined(spans: Iterable[Span]) -> Iterator[Span]:
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
    for begin, end in _joined(spans):
        if begin > reached + 1e-9:
            gaps.append((reached, begin))
        reached = max(reached, end)
    if reached < 1.0 - 1e-9:
        gaps.append((reached, 1.0))
    return gaps
