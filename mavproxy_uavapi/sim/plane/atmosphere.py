"""Air density: what makes the true airspeed larger than the indicated one, and circles wider."""

from __future__ import annotations

import math

SEA_LEVEL_DENSITY = 1.225
"""kg/m³."""
SEA_LEVEL_PRESSURE = 101325.0
"""Pa."""
GAS_CONSTANT = 287.05
"""J/kg/K, of dry air."""
LAPSE = 2.25577e-5
"""1/m; of the standard atmosphere's temperature."""
TEMPERATURE = 303.0
"""K of the air that SITL's plane flies in."""


def true_airspeed_factor(altitude: float) -> float:
    """True divided by indicated airspeed at an altitude in metres AMSL (barometric formula)."""
    pressure = SEA_LEVEL_PRESSURE * max(1 - LAPSE * altitude, 0.1) ** 5.25588
    return math.sqrt(SEA_LEVEL_DENSITY * GAS_CONSTANT * TEMPERATURE / pressure)


def standard_factor(altitude: float) -> float:
    """The same in the standard atmosphere, which is what the autopilot reckons with."""
    return float(max(1 - LAPSE * altitude, 0.1) ** -2.12794)
