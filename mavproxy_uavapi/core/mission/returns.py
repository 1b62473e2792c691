"""How high and how fast a vehicle returns to launch, by its parameters. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mavproxy_uavapi.core.airspace.forecast import Pace
from mavproxy_uavapi.core.airspace.time_limits import quantity
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.mission_legs import PathPoint

LOWEST_RETURN = 0.3  # m above home, of a copter's RTL
FENCE_HEIGHT = 1  # bit of FENCE_TYPE
LEAST_SLOPE = 0.5  # of RTL_CONE_SLOPE; less counts as none


def return_pace(kind: str, parameters: Mapping[str, float], pace: Pace) -> Pace:
    """How fast a vehicle of that kind returns that flies to places at `pace`; a rover's RTL_SPEED is in m/s."""
    if kind == "rover":
        speed = parameters.get("RTL_SPEED", 0.0)
    else:
        speed = quantity(parameters, "RTL_SPEED", "RTL_SPEED_MS", 0.0)
    return pace._replace(level=speed) if speed > 0 else pace


def return_height(parameters: Mapping[str, float], here: PathPoint, home: tuple[float, float]) -> float:
    """The height (m above home) at which a copter returns from `here`: `ModeRTL::compute_return_target`."""
    climb = max(quantity(parameters, "RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M", 0.0), 0.0)
    least = max(LOWEST_RETURN, here.up + climb)
    up = max(quantity(parameters, "RTL_ALT", "RTL_ALT_M", 15.0), least)
    slope = parameters.get("RTL_CONE_SLOPE", 3.0)
    if slope >= LEAST_SLOPE:
        up = min(up, max(slope * math.hypot(*offset(here.lat, here.lon, *home)), least))
    if parameters.get("FENCE_ENABLE") and int(parameters.get("FENCE_TYPE", 0)) & FENCE_HEIGHT:
        up = min(up, parameters.get("FENCE_ALT_MAX", math.inf) - parameters.get("FENCE_MARGIN", 2.0))
    return max(up, here.up)


def return_height_of_plane(parameters: Mapping[str, float], up: float) -> float:
    """The height (m above home) at which a plane that is at `up` returns: its own where RTL_ALTITUDE is below 0."""
    height = parameters.get("RTL_ALTITUDE", parameters.get("ALT_HOLD_RTL", 10_000.0) / 100)
    return up if height < 0 else height
