"""How long a verb may take: from its distance, the vehicle's own speeds and how fast its clock runs. Pure.

A deadline is twice the time that the flight should need, plus a margin: wind, a gust at arrival and a slow
machine must not end a healthy flight, and nothing waits for ever.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

FACTOR = 2.0
MARGIN = 30.0  # s of the vehicle's clock
FLOOR = 30.0  # s of ours: acks, heartbeats and a machine's hiccups do not get faster with SIM_SPEEDUP

# ArduCopter's defaults, in its own units (cm/s, cm/s/s, cm, ms, s): used until the vehicle told its own.
DEFAULTS = {
    "WPNAV_SPEED": 1000.0,
    "WPNAV_SPEED_UP": 250.0,
    "WPNAV_SPEED_DN": 150.0,
    "WPNAV_ACCEL": 250.0,
    "LAND_SPEED": 50.0,
    "LAND_SPEED_HIGH": 0.0,
    "LAND_ALT_LOW": 1000.0,
    "RTL_ALT": 1500.0,
    "RTL_SPEED": 0.0,
    "RTL_LOIT_TIME": 5000.0,
    "GUID_TIMEOUT": 3.0,
}
SLOWEST = 0.1  # m/s; a parameter of 0 or less must not make a flight endless


@dataclass(frozen=True)
class Limits:
    """A copter's speeds (m/s), acceleration (m/s/s), heights (m) and times (s)."""

    horizontal: float
    up: float
    down: float
    acceleration: float
    land: float
    land_high: float
    land_low_alt: float
    rtl_alt: float
    rtl_speed: float
    rtl_loiter: float
    guided_timeout: float


def limits(parameters: Mapping[str, float], speeds: Mapping[str, float]) -> Limits:
    """The limits in force.

    Args:
        parameters: what the vehicle told, in ArduCopter's units; missing ones are taken as its defaults.
        speeds: what DO_CHANGE_SPEED set since, m/s, by kind (ground, air, climb, descent). A mode change
            undoes it in the autopilot, so the slower of the two counts.
    """
    known = {**DEFAULTS, **parameters}
    cruise = known["WPNAV_SPEED"] / 100
    horizontal = min(cruise, speeds.get("ground", cruise), speeds.get("air", cruise))
    up = known["WPNAV_SPEED_UP"] / 100
    down = known["WPNAV_SPEED_DN"] / 100
    down = min(down, speeds.get("descent", down))
    return Limits(
        horizontal=max(horizontal, SLOWEST),
        up=max(min(up, speeds.get("climb", up)), SLOWEST),
        down=max(down, SLOWEST),
        acceleration=max(known["WPNAV_ACCEL"] / 100, SLOWEST),
        land=max(known["LAND_SPEED"] / 100, SLOWEST),
        land_high=max(known["LAND_SPEED_HIGH"] / 100 or down, SLOWEST),
        land_low_alt=known["LAND_ALT_LOW"] / 100,
        rtl_alt=known["RTL_ALT"] / 100,
        rtl_speed=max(known["RTL_SPEED"] / 100 or horizontal, SLOWEST),
        rtl_loiter=known["RTL_LOIT_TIME"] / 1000,
        guided_timeout=max(known["GUID_TIMEOUT"], 0.1),
    )


def leg_time(limits: Limits, horizontal: float, up: float) -> float:
    """Seconds for a leg of `horizontal` m that ends `up` m higher (negative: lower), from rest to rest."""
    ramps = limits.horizontal / limits.acceleration if horizontal else 0.0
    vertical = up / limits.up if up > 0 else -up / limits.down
    return max(horizontal / limits.horizontal + ramps, vertical)


def landing_time(limits: Limits, height: float) -> float:
    """Seconds to land from `height` m above home, touchdown detection and disarming included."""
    height = max(height, 0.0)
    low = min(height, limits.land_low_alt)
    return (height - low) / limits.land_high + low / limits.land + 5.0


def return_time(limits: Limits, distance: float, height: float) -> float:
    """Seconds for RTL from `distance` m away at `height` m above home: climb, return, loiter, land."""
    return_height = max(limits.rtl_alt, height)
    climb = (return_height - height) / limits.up
    cruise = distance / limits.rtl_speed + limits.rtl_speed / limits.acceleration
    return climb + cruise + limits.rtl_loiter + landing_time(limits, return_height)


def allowed(expected: float, time_ratio: float) -> float:
    """Seconds of our clock that a verb may take whose flight needs `expected` s of the vehicle's clock.

    Args:
        expected: s, by one of the functions above.
        time_ratio: vehicle seconds per second of ours.
    """
    return max(FLOOR, (FACTOR * expected + MARGIN) / time_ratio)
