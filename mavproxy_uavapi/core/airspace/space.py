"""An envelope as geometry: whether a way stays inside, and if not, what it breaks, where and by how much. Pure.

The frame is flat, around the middle of the envelope (`LocalFrame`). A circle is a polygon of 256 corners, which errs
to the safe side by 0.0001 of its radius.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot
from mavproxy_uavapi.core.airspace.model import LARGEST, Area, Envelope, Place
from mavproxy_uavapi.core.airspace.prisms import Prism, Rule, Rules, Span, joined
from mavproxy_uavapi.core.errors import Invalid

QUARTER = 64  # corners of a quarter of a circle
SAFE_RADIUS = 1.0 / math.cos(math.pi / (4 * QUARTER))  # times the radius: a polygon around the circle, not in it
TOUCH = 0.02  # m: a shorter part outside does not count; MAVLink's 1e-7 degrees are 0.01 m


class Breach(NamedTuple):
    """What a way breaks: a name, where it is farthest outside, and by how many metres."""

    what: str
    at: Spot
    by: float


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
            spans = list(joined(_broken(way, rule)))
            worst = [(span, self._worst(way, span, rule)) for span in spans]
            outside = [(span, breach) for span, breach in worst if breach.by > TOUCH]
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


def outside_by(spot: Spot, rules: Rules) -> float:
    """By how many metres a point is outside; 0 inside."""
    return max((rule.broken_by(spot) for rule in rules.near([spot])), default=0.0)


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
        raise Invalid(f"{area.name} is no area: {_fault(shapely.is_valid_reason(shape), frame)}")
    return shape


def _fault(reason: str, frame: LocalFrame) -> str:
    """GEOS's reason, such as `Ring Self-intersection[12.5 -7]` (m east, m north), in words and degrees."""
    found = re.search(r"\[(\S+) (\S+)\]", reason)
    if found is None:
        return "it is smaller than a point"
    lat, lon = frame.degrees(Spot(float(found[2]), float(found[1]), 0.0))
    what = (
        "its holes lie outside or in each other"
        if "hole" in reason.lower()
        else "its outline crosses or touches itself"
    )
    return f"{what} near {lat:.6f}, {lon:.6f}"


def _prepared(shape: Any) -> Any:
    shapely.prepare(shape)
    return shape
