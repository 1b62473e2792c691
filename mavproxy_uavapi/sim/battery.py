"""A lithium pack like SITL's: SIM_BATT_VOLTAGE when full, what is drawn is counted in mAh against BATT_CAPACITY.

As in SITL the voltage falls with the charge only if SIM_BATT_CAP_AH gives a capacity: by default the percentage falls
to 0, and the battery goes on. What a type of vehicle draws is that of SITL's model of it.
"""

from __future__ import annotations

from .parameters import ParameterStore

FULL_VOLTAGE = 12.6
HIGHEST_VOLTAGE = 60.0
HIGHEST_CURRENT = 300.0
EMPTY_SHARE = 0.81
"""What is left of the voltage of a full pack when it is empty."""
RESISTANCE = 0.01
"""Ohm."""
HOVER_POWER = 29.3 * 12.09
"""Watts of SITL's quadcopter; its current is proportional to the thrust."""
FULL_THROTTLE_CURRENT = 50.0
FULL_THROTTLE_SAG = 0.7
"""Amperes and volts of SITL's planes and rovers at full throttle."""


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

    def hover(self, thrust_share: float, dt: float) -> None:
        """Draw what this thrust takes (1 hovers) for dt seconds."""
        current = HOVER_POWER * thrust_share / max(self.voltage, 1.0)
        self._draw(current, RESISTANCE * current if self._capacity > 0 else 0.0, dt)

    def drive(self, throttle: float, dt: float, power: int = 1) -> None:
        """Draw what a throttle of 0..1 takes for dt seconds; the current rises with this power of the throttle."""
        self._draw(FULL_THROTTLE_CURRENT * throttle**power, FULL_THROTTLE_SAG * throttle, dt)

    def reset(self, percent: float) -> None:
        """Count from so much of BATT_CAPACITY on, as after a change of the pack."""
        left = max(0.0, min(100.0, percent)) / 100
        self.consumed = (1 - left) * self._parameters["BATT_CAPACITY"]
        self.low = False

    @property
    def _capacity(self) -> float:
        """mAh; 0 for a pack that does not become empty."""
        return 1000.0 * self._parameters["SIM_BATT_CAP_AH"]

    def _draw(self, current: float, sag: float, dt: float) -> None:
        """Draw amperes at this loss of volts for dt seconds."""
        self.current = min(current, HIGHEST_CURRENT)
        self.consumed += self.current * dt / 3.6
        rest = max(0.0, min(HIGHEST_VOLTAGE, self._parameters["SIM_BATT_VOLTAGE"]))
        capacity = self._capacity
        if self.forced_voltage is not None:
            rest = self.forced_voltage
        elif capacity > 0:
            charge = max(0.0, 1 - self.consumed / capacity)
            rest *= EMPTY_SHARE + (1 - EMPTY_SHARE) * charge**0.6
        self.voltage = max(0.0, rest - sag)
        self.consumed_wh += self.voltage * self.current * dt / 3600

    def becomes_low(self, now: float) -> bool:
        """True once, when the pack has been below BATT_LOW_VOLT for BATT_LOW_TIMER seconds, or at BATT_LOW_MAH.

        now is seconds since boot. A pack that was low stays low until the next boot, as in ArduPilot.
        """
        if self.low:
            return False
        low_voltage, low_mah = self._parameters["BATT_LOW_VOLT"], self._parameters["BATT_LOW_MAH"]
        if low_mah > 0 and self._parameters["BATT_CAPACITY"] - self.consumed < low_mah:
            self.low = True
        elif low_voltage > 0 and self.voltage < low_voltage:
            self._below_since = now if self._below_since is None else self._below_since
            self.low = now - self._below_since >= self._parameters["BATT_LOW_TIMER"]
        else:
            self._below_since = None
        return self.low
