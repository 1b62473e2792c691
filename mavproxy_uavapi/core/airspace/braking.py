"""How far a vehicle goes before it stands. Pure.

The law is ArduCopter's: a limit for the deceleration, another for how fast it builds up (jerk). A controller uses
only SHARE of the limit, so braking takes longer than physics requires. A slow vehicle takes even longer: at most its
speed times `jerk / limit` is asked for (`shape_vel_accel_xy`), so that BRAKE takes 1.6 m from 1 m/s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

GRAVITY = 9.80665  # m/s/s
SHARE = 0.7  # of the limit, that a controller plans with
BRAKE_DECELERATION = 7.5  # m/s/s, ArduCopter's BRAKE_MODE_DECEL_RATE
OURS, ITS_OWN = 0.05, 0.25  # s from a position to the effect of a stop: on our clock (link, MAVProxy), on its own
LATENCY = OURS + ITS_OWN
# Names up to ArduCopter 4.6, from 4.7 on, divisor of the first, default in SI units.
ACCELERATION = ("WPNAV_ACCEL", "WP_ACC", 100.0, 2.5)
ACCELERATION_UP = ("WPNAV_ACCEL_Z", "WP_ACC_Z", 100.0, 1.0)
LEAN = ("ANGLE_MAX", "ATC_ANGLE_MAX", 100.0, 30.0)
JERK = ("PSC_JERK_XY", "PSC_NE_JERK", 1.0, 5.0)
ROVER_DECELERATION = 1.0  # m/s/s, where ATC_DECEL_MAX and ATC_ACCEL_MAX are 0 or not known
WANTED = [names[:2] for names in (ACCELERATION, ACCELERATION_UP, LEAN, JERK)]
WANTED_OF_ROVER = [("ATC_DECEL_MAX",), ("ATC_ACCEL_MAX",)]


@dataclass(frozen=True)
class Braking:
    """How a vehicle stops.

    Attributes:
        deceleration: over the ground, m/s/s.
        vertical: up and down, m/s/s.
        jerk: m/s/s/s.
        limit: of the deceleration that the controller asks for, m/s/s; the lean angle may give less.
    """

    deceleration: float
    vertical: float
    jerk: float
    limit: float

    def distance(self, speed: float) -> float:
        """Metres over the ground from `speed` m/s to rest."""
        slow = speed * self.limit / self.jerk + speed * speed / (2 * self.limit)
        return max(_distance(speed, self.deceleration, self.jerk), slow)

    def height(self, speed: float) -> float:
        """Metres up or down from `speed` m/s to rest."""
        return _distance(speed, self.vertical, self.jerk)

    def to_rest(self, velocity: tuple[float, float, float], seconds: float) -> tuple[float, float, float]:
        """Metres north, east and up until it stands, if it goes on for `seconds` before it brakes.

        Args:
            velocity: m/s north, east, up.
            seconds: s.
        """
        north, east, up = velocity
        speed = math.hypot(north, east)
        along = seconds + (self.distance(speed) / speed if speed > 1e-6 else 0.0)
        return north * along, east * along, up * seconds + math.copysign(self.height(abs(up)), up)


def _distance(speed: float, deceleration: float, jerk: float) -> float:
    planned = SHARE * deceleration
    return speed * speed / (2 * planned) + speed * deceleration / (2 * jerk)


def of_guided(parameters: Mapping[str, float]) -> Braking:
    """A copter that is given a velocity of 0 in GUIDED, or none any more."""
    acceleration, vertical, _, jerk = _values(parameters)
    return Braking(acceleration, vertical, jerk, acceleration)


def of_brake(parameters: Mapping[str, float]) -> Braking:
    """A copter in BRAKE: as hard as its lean angle allows."""
    _, vertical, lean, jerk = _values(parameters)
    hardest = GRAVITY * math.tan(math.radians(min(max(lean, 10.0), 80.0)))
    return Braking(min(BRAKE_DECELERATION, hardest), vertical, jerk, BRAKE_DECELERATION)


def of(kind: str, parameters: Mapping[str, float]) -> Braking:
    """A vehicle of that kind that is stopped at once."""
    return of_rover(parameters) if kind == "rover" else of_brake(parameters)


def of_rover(parameters: Mapping[str, float]) -> Braking:
    """A rover in HOLD."""
    known = parameters.get("ATC_DECEL_MAX") or parameters.get("ATC_ACCEL_MAX") or ROVER_DECELERATION
    deceleration = max(known, 0.1)
    return Braking(deceleration, 1.0, 10.0, deceleration)


def _values(parameters: Mapping[str, float]) -> list[float]:
    values = []
    for old, new, divisor, default in (ACCELERATION, ACCELERATION_UP, LEAN, JERK):
        value = parameters[new] if new in parameters else parameters.get(old, default * divisor) / divisor
        values.append(value if value > 0 else default)
    return values


def overshoot(braking: Braking, speed: float, acceleration: float, seconds: float, corridor: float) -> float:
    """Metres by which a stopped vehicle may pass a border over the ground: the bound of the model.

    The model looks at the last reported speed. For `seconds` after it the vehicle may gain speed outwards. No
    vehicle is stopped within `corridor` m of an allowed way.

    Args:
        braking: how it stops.
        speed: the fastest that it flies, m/s.
        acceleration: how fast it gains speed, m/s/s.
        seconds: from one look until a stop after the next look has an effect.
        corridor: m.
    """
    gained = acceleration * seconds
    faster = speed + gained
    more = braking.distance(faster) - braking.distance(speed) + gained * seconds / 2
    beside = corridor / seconds  # the fastest that is still trusted across its way
    return max(more, corridor + braking.distance(beside))
