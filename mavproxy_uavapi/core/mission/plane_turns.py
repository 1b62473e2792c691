"""How a plane turns into the legs of its mission, and lands, which carries it beside or beyond them. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mavproxy_uavapi.core.airspace.time_limits import quantity
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.item_places import on_circle
from mavproxy_uavapi.core.mission.mission_legs import Leg, Setting

GRAVITY = 9.80665  # m/s/s
GUSTY = 1.16  # times the radius of its guidance, in a gust
ROLL_IN = 0.7  # s that it flies on before it turns
TURNED = 4.0  # radii from the beginning of a leg, after which a plane is on it
WIDER = 1.25  # times its radius, at most, that a plane circles: SITL's is at 97 m with 80
STEEP, STEEPEST_LANDING = 9.0, 20.0  # degrees of a landing's slope: from where it floats, and more is refused
ROLLS_ON, FLOATS = 20.0, 20.0  # m, and m for each degree above STEEP, behind the place of a landing
STEP = 10  # m, in which what a turn carries it beside a leg is counted: the envelope is narrowed for each number


def turned(leg: Leg, course: float | None, setting: Setting) -> tuple[list[Leg], float | None]:
    """A leg, parted where the plane is on it, if the turn into it carries the plane beside it.

    Args:
        leg: as it is drawn.
        course: rad, in which it comes to its beginning; NaN where nobody knows, None where the leg's margin says it.
        setting: the plane's radius, and its parameters.

    Returns:
        The parts, and the course at its end.
    """
    north, east = offset(*leg.begin[:2], *leg.end[:2])
    length = math.hypot(north, east)
    if not length > 0:
        return [leg], course
    ahead, radius = math.atan2(east, north), turning_radius(leg.fastest.level, setting.parameters)
    at_its_end = ahead if length > TURNED * radius else math.nan
    turn = 0.0 if course is None else math.pi if math.isnan(course) else course - ahead
    beside = carried_beside(turn, radius)
    if not beside:
        return [leg], at_its_end
    turning = leg._replace(margin=beside + leg.margin)
    share = (TURNED * radius + 2 * leg.margin) / length
    if share >= 1:
        return [turning], at_its_end
    up = leg.begin.up + share * (leg.end.up - leg.begin.up)
    middle = leg.begin._replace(up=up, **on_circle(leg.begin, share * length, ahead))
    return [turning._replace(end=middle, waits=0.0), leg._replace(begin=middle, margin=0.0)], at_its_end


def carried_beside(turn: float, radius: float) -> float:
    """Metres beside a leg to which a turn by so many rad carries a plane: two radii where it turns about."""
    return STEP * math.ceil(radius * (1 - math.cos(turn)) / STEP)


def comes_to_rest_beyond(slope: float) -> float:
    """Metres behind its place to which a plane rolls that lands down so many degrees: it flares higher, and floats.

    Bounds what ArduPlane 4.7's SITL did with 17 m/s and no wind: 16 m after 9 degrees, 50 after 12, 117 after 16, 191
    after 20.
    """
    return ROLLS_ON + FLOATS * max(slope - STEEP, 0.0)


def turning_radius(speed: float, parameters: Mapping[str, float]) -> float:
    """The widest (m) that a plane turns at a speed over the ground: by its bank, or as AP_L1_Control demands."""
    bank = quantity(parameters, "LIM_ROLL_CD", "ROLL_LIMIT_DEG", 45.0)
    by_bank = speed**2 / (GRAVITY * math.tan(math.radians(min(max(bank, 5.0), 80.0))))
    period, damping = parameters.get("NAVL1_PERIOD", 17.0), parameters.get("NAVL1_DAMPING", 0.75)
    return max(by_bank, GUSTY * speed * period / (4 * math.pi * max(damping, 0.1))) + ROLL_IN * speed / 2
