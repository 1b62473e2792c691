"""An envelope as it is written: areas in degrees, and limits. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.strict_json import is_finite_number, shown
from mavproxy_uavapi.core.text import nearest

Place = tuple[float, float]  # latitude and longitude, degrees
LARGEST = 50_000.0  # m from the envelope's middle to its farthest corner: beyond it the flat frame errs too much
HIGHEST_LATITUDE = 85.0  # degrees: nearer to a pole a degree of longitude is too short
MOST_AREAS, MOST_CORNERS = 200, 20_000


@dataclass(frozen=True)
class Area:
    """A polygon or a circle, from a floor to a ceiling.

    Attributes:
        name: for messages.
        inclusion: whether the vehicle must be inside (of one such area), or must not be.
        rings: corners of the outline, then of each hole; empty for a circle.
        centre, radius: of a circle; radius in m.
        floor, ceiling: m above home; infinite where there is none.
    """

    name: str
    inclusion: bool
    rings: tuple[tuple[Place, ...], ...] = ()
    centre: Place | None = None
    radius: float = 0.0
    floor: float = -math.inf
    ceiling: float = math.inf

    @property
    def corners(self) -> list[Place]:
        """All places that it is written by."""
        return [corner for ring in self.rings for corner in ring] + ([self.centre] if self.centre else [])


@dataclass(frozen=True)
class EnvelopeLimits:
    """Limits besides the areas; None for none.

    Attributes:
        height: highest m above home.
        distance: farthest m from home, over the ground.
        speed, climb, descent: highest speeds, m/s: over the ground, up, down.
        reserve: percent of the battery that must be left at home.
        endurance: s that a full battery lasts; with it the reserve counts after the way there and home.
    """

    height: float | None = None
    distance: float | None = None
    speed: float | None = None
    climb: float | None = None
    descent: float | None = None
    reserve: float | None = None
    endurance: float | None = None

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> EnvelopeLimits:
        """The limits of a JSON object.

        Raises:
            Invalid: an unknown name, or a value that is no positive number.
        """
        names = [one.name for one in fields(cls)]
        for name, value in values.items():
            if name not in names:
                raise Invalid(f"there is no limit {shown(name)}; {nearest(name, names)}", "limits")
            if value is not None and not (is_finite_number(value) and value > 0):
                raise Invalid(f"{shown(value)} is not a positive number", "limits", name)
        if (values.get("reserve") or 0) > 100:
            raise Invalid(f"{values['reserve']} %; at most 100 % is possible", "limits", "reserve")
        return cls(**{name: None if value is None else float(value) for name, value in values.items()})

    def report(self) -> dict[str, float]:
        """The limits that there are."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class Envelope:
    """Areas and limits.

    Attributes:
        areas: with at least one inclusion a vehicle must be inside one of them.
        limits: besides the areas.
        source: where it comes from, for messages.
        every: whether it must be inside every inclusion, as ArduPilot takes its fences.
        remarks: what stands in the file and limits nothing, in sentences.
        is_own: whether it is the fence that the vehicle's autopilot keeps itself.
    """

    areas: tuple[Area, ...] = ()
    limits: EnvelopeLimits = field(default_factory=EnvelopeLimits)
    source: str = "the envelope"
    every: bool = False
    remarks: tuple[str, ...] = ()
    is_own: bool = False

    @property
    def inclusions(self) -> int:
        """How many areas a vehicle must be inside of (one, or every one)."""
        return sum(area.inclusion for area in self.areas)

    @property
    def exclusions(self) -> int:
        """How many areas a vehicle must be outside of."""
        return len(self.areas) - self.inclusions

    def summary(self) -> str:
        """`1 inclusion, 2 exclusions, height 60`: what is in force, and the remarks."""
        counts = [(self.inclusions, "inclusion"), (self.exclusions, "exclusion")]
        words = [f"{count} {name}{'' if count == 1 else 's'}" for count, name in counts]
        words += [f"{name} {value:g}" for name, value in self.limits.report().items()]
        return "; ".join([", ".join(words), *self.remarks])

    def __post_init__(self) -> None:
        if not self.areas and self.limits == EnvelopeLimits():
            raise Invalid("there is neither an area nor a limit in it")
        if len(self.areas) > MOST_AREAS or sum(len(area.corners) for area in self.areas) > MOST_CORNERS:
            raise Invalid(f"it has more than {MOST_AREAS} areas or {MOST_CORNERS} corners")
        for area in self.areas:
            _check(area)


def _check(area: Area) -> None:
    """Raise Invalid unless the area makes sense; whether its outline crosses itself shows in `space.py`."""
    for lat, lon in area.corners:
        if not (is_finite_number(lat) and is_finite_number(lon) and abs(lat) <= HIGHEST_LATITUDE and abs(lon) <= 180):
            raise Invalid(f"{area.name}: {lat}, {lon} is not a latitude and longitude in degrees")
    if area.centre is not None and not 0 < area.radius <= LARGEST:
        raise Invalid(f"{area.name}: its radius is {area.radius:g} m, not between 0 and {LARGEST:g}")
    if area.centre is None and not area.rings:
        raise Invalid(f"{area.name} has neither corners nor a centre")
    if any(len(set(ring)) < 3 for ring in area.rings):
        raise Invalid(f"{area.name}: a polygon has three corners at least")
    if math.isnan(area.floor) or math.isnan(area.ceiling) or area.floor >= area.ceiling:
        raise Invalid(f"{area.name}: its floor ({area.floor:g} m) is not below its ceiling ({area.ceiling:g} m)")
