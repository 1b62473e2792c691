"""The speeds at which a vehicle flies to places, and how long it takes. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.airspace.forecast import Pace
from mavproxy_uavapi.core.airspace.speeds import Speeds
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.mission_legs import Leg, PathPoint
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission

SLOWEST = 0.1  # m/s; a speed of 0 must not make a way endless
PLANE, ROVER = 12.0, 2.0  # m/s; used until their own is known
OVER_GROUND = 1.16  # times its airspeed at most, of a plane in thin air, in a turn or a descent, without wind


def speeds(kind: str, parameters: Mapping[str, float], speeds: Speeds) -> list[tuple[str, float]]:
    """Speeds in m/s by kind (ground, climb, descent), from the vehicle's type, parameters and later commands."""
    known = time_limits.limits(parameters, {})
    cruise = known.horizontal
    if kind == "rover":
        cruise = parameters.get("WP_SPEED") or parameters.get("CRUISE_SPEED") or ROVER
    elif kind == "plane":
        cruise = parameters.get("AIRSPEED_CRUISE") or parameters.get("TRIM_ARSPD_CM", 100 * PLANE) / 100
    ground = ("ground", _set(speeds, cruise, "ground", "air"))
    if kind in ("rover", "plane"):
        return [ground]
    return [
        ground,
        ("climb", _set(speeds, known.up, "climb")),
        ("descent", _set(speeds, known.down, "descent")),
    ]


def pace(kind: str, parameters: Mapping[str, float], in_force: Speeds) -> Pace:
    """The speeds at which it flies to places that it is sent to."""
    known = dict(speeds(kind, parameters, in_force))
    return Pace(known["ground"], known.get("climb", known["ground"]), known.get("descent", known["ground"]))


def mission_paces(vehicle: Any) -> tuple[Pace, Pace]:
    """The fastest and the slowest that it may begin its mission with.

    It begins with its parameters, whatever speeds it was given in GUIDED; one that flies it already may have got
    others meanwhile. A rover may keep its own.
    """
    parameters = vehicle.state.parameters
    own = present = pace(vehicle.kind, parameters, Speeds(vehicle.state))
    if vehicle.kind == "rover" or flies_mission(vehicle.mode):
        present = pace(vehicle.kind, parameters, vehicle.speeds)
    fastest, slowest = (Pace(*map(limit, own, present)) for limit in (max, min))
    return over_ground(vehicle.kind, fastest), slowest


def over_ground(kind: str, pace: Pace) -> Pace:
    """The fastest over the ground for a pace in the air."""
    return pace._replace(level=OVER_GROUND * pace.level) if kind == "plane" else pace


def _set(speeds: Speeds, cruise: float, *kinds: str) -> float:
    values = speeds.to_send(new_kind=True)
    return next((values[kind] for kind in kinds if kind in values), cruise)


def seconds(vehicle: Any, stops: Sequence[PathPoint]) -> float:
    """Seconds along a way, and from its end straight home; 0 for the latter while home is not known."""
    its_own = pace(vehicle.kind, vehicle.state.parameters, vehicle.speeds)
    home = vehicle.state.home
    if home is not None and stops:
        stops = [*stops, PathPoint(home.lat, home.lon, 0.0)]
    return sum(_lasts(a, b, its_own) for a, b in zip(stops, stops[1:], strict=False))


def mission_seconds(home: tuple[float, float] | None, legs: Sequence[Leg]) -> float:
    """Seconds along the legs of a mission at the slowest, with the known waits, and from its end straight home."""
    last = legs[-1]
    waits = sum(leg.waits for leg in legs[:-1] if math.isfinite(leg.waits))
    along = waits + sum(_lasts(leg.begin, leg.end, leg.slowest) for leg in legs[:-1])
    along += _lasts(last.begin, last.end, last.slowest)
    return along if home is None else along + _lasts(last.end, PathPoint(*home, 0.0), last.slowest)


def _lasts(a: PathPoint, b: PathPoint, at: Pace) -> float:
    level, height = math.hypot(*offset(a.lat, a.lon, b.lat, b.lon)), abs(b.up - a.up)
    return max(level / max(at.level, SLOWEST), height / max(min(at.climb, at.descent), SLOWEST))
