"""How long a verb may take: from its distance, the vehicle's own speeds and how fast its clock runs. Pure.

A deadline is twice the time that the flight should need, plus a margin: wind, a gust at arrival and a slow
machine must not end a healthy flight, and nothing waits for ever.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

FACTOR = 2.0
MARGIN = 30.0  # s of the vehicle's clock
FLOOR = 30.0  # s of ours: SIM_SPEEDUP does not shorten acks, heartbeats and a machine's pauses

# ArduCopter's parameters: each quantity's name up to 4.6 in cm or cm/s, its name since 4.7 in m or m/s, and the
# default (m, m/s, m/s/s), which is used until the vehicle has reported its own. Times are in ms and s in both.
NAMES = {
    "horizontal": ("WPNAV_SPEED", "WP_SPD", 10.0),
    "up": ("WPNAV_SPEED_UP", "WP_SPD_UP", 2.5),
    "down": ("WPNAV_SPEED_DN", "WP_SPD_DN", 1.5),
    "acceleration": ("WPNAV_ACCEL", "WP_ACC", 2.5),
    "land": ("LAND_SPEED", "LAND_SPD_MS", 0.5),
    "land_high": ("LAND_SPEED_HIGH", "LAND_SPD_HIGH_MS", 0.0),
    "land_low_alt": ("LAND_ALT_LOW", "LAND_ALT_LOW_M", 10.0),
    "rtl_alt": ("RTL_ALT", "RTL_ALT_M", 15.0),
    "rtl_speed": ("RTL_SPEED", "RTL_SPEED_MS", 0.0),
}
TIMES = {"RTL_LOIT_TIME": 5000.0, "GUID_TIMEOUT": 3.0}
WANTED = [*(names[:2] for names in NAMES.values()), *((name,) for name in TIMES)]
SLOWEST = 0.1  # m/s; a parameter of 0 or less must not make a flight endless


@dataclass(frozen=True)
class FlightLimits:
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


def limits(parameters: Mapping[str, float], speeds: Mapping[str, float]) -> FlightLimits:
    """The limits in force.

    Args:
        parameters: the vehicle's, in ArduCopter's units; a missing one counts as its default.
        speeds: those that DO_CHANGE_SPEED has set since, m/s, by kind (ground, air, climb, descent). A mode change
            undoes it in the autopilot, so the slower of the two counts.
    """
    known = {name: quantity(parameters, *names) for name, names in NAMES.items()}
    times = {name: parameters.get(name, default) for name, default in TIMES.items()}
    cruise, up, down = known["horizontal"], known["up"], known["down"]
    horizontal = min(cruise, speeds.get("ground", cruise), speeds.get("air", cruise))
    down = min(down, speeds.get("descent", down))
    return FlightLimits(
        horizontal=max(horizontal, SLOWEST),
        up=max(min(up, speeds.get("climb", up)), SLOWEST),
        down=max(down, SLOWEST),
        acceleration=max(known["acceleration"], SLOWEST),
        land=max(known["land"], SLOWEST),
        land_high=max(known["land_high"] or down, SLOWEST),
        land_low_alt=known["land_low_alt"],
        rtl_alt=known["rtl_alt"],
        rtl_speed=max(known["rtl_speed"] or horizontal, SLOWEST),
        rtl_loiter=times["RTL_LOIT_TIME"] / 1000,
        guided_timeout=max(times["GUID_TIMEOUT"], 0.1),
    )


def quantity(parameters: Mapping[str, float], in_cm: str, in_m: str, default: float) -> float:
    """A quantity in m, m/s or m/s/s, by whichever of its two names the firmware has."""
    if in_m in parameters:
        return parameters[in_m]
    return parameters[in_cm] / 100 if in_cm in parameters else default


def leg_time(limits: FlightLimits, horizontal: float, up: float) -> float:
    """Seconds for a leg of `horizontal` m that ends `up` m higher (negative: lower), from rest to rest."""
    ramps = limits.horizontal / limits.acceleration if horizontal else 0.0
    vertical = up / limits.up if up > 0 else -up / limits.down
    return max(horizontal / limits.horizontal + ramps, vertical)


def landing_time(limits: FlightLimits, height: float) -> float:
    """Seconds to land from `height` m above home, touchdown detection and disarming included."""
    height = max(height, 0.0)
    low = min(height, limits.land_low_alt)
    return (height - low) / limits.land_high + low / limits.land + 5.0


def return_time(limits: FlightLimits, distance: float, height: float) -> float:
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
