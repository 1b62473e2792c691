"""A lithium pack like SITL's: 12.6 V full, sagging under load, counted in mAh against BATT_CAPACITY.

As in SITL the voltage falls with the charge only if SIM_BATT_CAP_AH gives a capacity. By default the battery never
becomes empty.
"""

from __future__ import annotations

from .parameters import ParameterStore

FULL_VOLTAGE = 12.6
EMPTY_VOLTAGE = 10.2
RESISTANCE = 0.012
"""Ohm; 20 A cost a quarter of a volt."""
AVIONICS_CURRENT = 0.4
HOVER_CURRENT = 18.0


class Battery:
    """State of charge; voltage in volts, current in amperes, consumed in mAh."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self.consumed = 0.0
        self.consumed_wh = 0.0
        self.current = 0.0
        self.voltage = FULL_VOLTAGE
        self.forced_voltage: float | None = None
        self.low = False
        self._below_since: float | None = None

    @property
    def remaining(self) -> int:
        """Percent of BATT_CAPACITY that is left, 0..100."""
        capacity = max(self._parameters["BATT_CAPACITY"], 1.0)
        return max(0, min(100, round(100 * (1 - self.consumed / capacity))))

    def drain(self, throttle_share: float, dt: float) -> None:
        """Draw the current of this throttle (1 hovers) for dt seconds."""
        self.current = AVIONICS_CURRENT + HOVER_CURRENT * throttle_share**1.5
        self.consumed += self.current * dt / 3.6
        holds = 1000.0 * self._parameters["SIM_BATT_CAP_AH"]
        charge = max(0.0, 1 - self.consumed / holds) if holds > 0 else 1.0
        rest = EMPTY_VOLTAGE + (FULL_VOLTAGE - EMPTY_VOLTAGE) * charge**0.6
        if self.forced_voltage is not None:
            rest = self.forced_voltage
        self.voltage = rest - RESISTANCE * self.current
        self.consumed_wh += self.voltage * self.current * dt / 3600

    def becomes_low(self, now: float) -> bool:
        """True once, when the pack has been below BATT_LOW_VOLT for BATT_LOW_TIMER seconds, or at BATT_LOW_MAH.

        now is seconds since boot. A pack that was low stays low until the next boot, as in ArduPilot.
        """
        if self.low:
            return False
        low_voltage, low_mah = self._parameters["BATT_LOW_VOLT"], self._parameters["BATT_LOW_MAH"]
        capacity = self._parameters["BATT_CAPACITY"]
        if low_mah > 0 and capacity - self.consumed < low_mah:
            self.low = True
        elif low_voltage > 0 and self.voltage < low_voltage:
            self._below_since = now if self._below_since is None else self._below_since
            self.low = now - self._below_since >= self._parameters["BATT_LOW_TIMER"]
        else:
            self._below_since = None
        return self.low
