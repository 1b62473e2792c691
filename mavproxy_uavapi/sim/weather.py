"""The wind, as SITL's parameters have it: SIM_WIND_SPD (m/s), SIM_WIND_DIR (degrees from), and how it grows.

SIM_WIND_T is how: 0 with the square root of the height up to SIM_WIND_T_ALT (m above the ground), 1 not at all, 2 by
SIM_WIND_T_COEF for each m above SIM_WIND_T_ALT. A change takes SIM_WIND_TC (s). It has no turbulence.
"""

from __future__ import annotations

import math

from .geodesy import wrap_pi
from .parameters import ParameterStore

SQUARE_ROOT, BY_HEIGHT = 0, 2  # SIM_WIND_T
STRONGEST = 100.0  # m/s: what blows harder would carry the vehicle off the globe


class Weather:
    """The wind at one vehicle."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._speed, self._direction = self._wanted

    @property
    def _wanted(self) -> tuple[float, float]:
        """m/s, and rad from."""
        return self._parameters["SIM_WIND_SPD"], math.radians(self._parameters["SIM_WIND_DIR"])

    def change(self, dt: float) -> None:
        """Let dt seconds pass."""
        share = dt / (dt + max(self._parameters["SIM_WIND_TC"], 0.1))
        speed, direction = self._wanted
        self._speed += (speed - self._speed) * share
        self._direction += wrap_pi(direction - self._direction) * share

    def at(self, height: float) -> tuple[float, float]:
        """m/s to the north and to the east, at a height in metres above the ground."""
        parameters, speed = self._parameters, self._speed
        full = parameters["SIM_WIND_T_ALT"]
        if parameters["SIM_WIND_T"] == SQUARE_ROOT and height < full > 0:
            speed *= math.sqrt(max(height, 0.0) / full)
        elif parameters["SIM_WIND_T"] == BY_HEIGHT:
            speed += (height - full) * parameters["SIM_WIND_T_COEF"]
        speed = min(max(speed, 0.0), STRONGEST)
        return -speed * math.cos(self._direction), -speed * math.sin(self._direction)
