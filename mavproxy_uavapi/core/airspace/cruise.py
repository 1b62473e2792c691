"""The speeds at which a vehicle flies to places, and how long it takes. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.airspace.speeds import Speeds
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.mission_way import Stop

SLOWEST = 0.1  # m/s; a speed of 0 must not make a way endless
PLANE, ROVER = 12.0, 2.0  # m/s; used until their own is known


def speeds(kind: str, parameters: Mapping[str, float], speeds: Speeds) -> list[tuple[str, float]]:
    """Speeds in m/s by kind (ground, climb, descent), from the vehicle's type, parameters and later commands."""
    if kind == "rover":
        cruise = parameters.get("WP_SPEED") or parameters.get("CRUISE_SPEED") or ROVER
        return [("ground", _set(speeds, cruise, "ground", "air"))]
    if kind == "plane":
        cruise = parameters.get("AIRSPEED_CRUISE") or parameters.get("TRIM_ARSPD_CM", 100 * PLANE) / 100
        return [("ground", _set(speeds, cruise, "ground", "air"))]
    known = time_limits.limits(parameters, {})
    return [
        ("ground", _set(speeds, known.horizontal, "ground", "air")),
        ("climb", _set(speeds, known.up, "climb")),
        ("descent", _set(speeds, known.down, "descent")),
    ]


def _set(speeds: Speeds, cruise: float, *kinds: str) -> float:
    values = speeds.to_send(new_kind=True)
    return next((values[kind] for kind in kinds if kind in values), cruise)


def seconds(vehicle: Any, stops: Sequence[Stop]) -> float:
    """Seconds along a way, and from its end straight home; 0 for the latter while home is not known."""
    legs = [_leg(a, b) for a, b in zip(stops, stops[1:], strict=False)]
    home = vehicle.state.messages.get("HOME_POSITION")
    if home is not None and stops:
        at = Stop(home.message.latitude / 1e7, home.message.longitude / 1e7, 0.0)
        legs.append(_leg(stops[-1], at))
    of_kind = dict(speeds(vehicle.kind, vehicle.state.parameters, vehicle.speeds))
    ground = max(of_kind["ground"], SLOWEST)
    slowest_climb = max(min(of_kind.get("climb", ground), of_kind.get("descent", ground)), SLOWEST)
    return sum(max(level / ground, height / slowest_climb) for level, height in legs)


def _leg(a: Stop, b: Stop) -> tuple[float, float]:
    return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon)), abs(b.up - a.up)
