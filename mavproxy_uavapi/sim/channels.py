"""Radio inputs (the pilot's sticks) and servo outputs, in microseconds of pulse width."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Mapping

from .parameters import ParameterStore

NEUTRAL = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800)
"""What SITL's radio sends at first: sticks centred, throttle down, mode switch on 6."""
OVERRIDE_TIMEOUT = 3.0
"""RC_OVERRIDE_TIME, seconds that an RC_CHANNELS_OVERRIDE lasts."""
RELEASED = (0, -math.inf)
"""Pulse and time of an override that there is not."""
MODE_SWITCH_EDGES = (1231, 1361, 1491, 1621, 1750)
"""Pulse widths between the six positions of the flight mode switch."""
STICK_DEADZONE = 20
CHANNEL_COUNT = 16
SERVO_FUNCTIONS = tuple(f"SERVO{channel}_FUNCTION" for channel in range(1, 17))
"""The parameter of each output."""
MOTOR_FUNCTIONS = (33, 34, 35, 36)
STEERING_FUNCTION, THROTTLE_FUNCTION = 26, 70
DISABLED_OUTPUT = 0


class Sticks:
    """The radio channels 1..16 with overrides from MAVLink on top."""

    def __init__(self, neutral: tuple[int, ...] = NEUTRAL) -> None:
        self._radio = [*neutral, *([0] * (CHANNEL_COUNT - len(neutral)))]
        self._override: dict[int, tuple[int, float]] = {}

    def override(self, pulses: list[int], now: float) -> None:
        """RC_CHANNELS_OVERRIDE: 0 releases a channel, 65535 leaves it as it is."""
        for channel, pulse in enumerate(pulses[:CHANNEL_COUNT]):
            if pulse == 0:
                self._override.pop(channel, None)
            elif pulse != 65535:
                self._override[channel] = (pulse, now)

    def move(self, channel: int, pulse: int) -> None:
        """The pilot moves a real stick; channel counts from 1."""
        self._radio[channel - 1] = pulse

    def pulses(self, now: float) -> list[int]:
        """All 16 channels, 0 where there is none."""
        return [self._pulse(channel, now) for channel in range(1, CHANNEL_COUNT + 1)]

    def _pulse(self, channel: int, now: float) -> int:
        pulse, since = self._override.get(channel - 1, RELEASED)
        return pulse if now - since <= OVERRIDE_TIMEOUT else self._radio[channel - 1]

    def axis(self, channel: int, now: float) -> float:
        """A centring stick as -1..1, zero within the dead zone."""
        offset = self._pulse(channel, now) - 1500
        if abs(offset) <= STICK_DEADZONE:
            return 0.0
        return max(-1.0, min(1.0, offset / 500))

    def throttle(self, now: float) -> float:
        """The throttle stick as 0..1."""
        return max(0.0, min(1.0, (self._pulse(3, now) - 1000) / 1000))

    def mode_switch(self, channel: int, now: float) -> int | None:
        """Position 1..6 of the flight mode switch on channel; None when FLTMODE_CH names no channel."""
        if not 1 <= channel <= CHANNEL_COUNT:
            return None
        return 1 + bisect(MODE_SWITCH_EDGES, self._pulse(channel, now))


class Servos:
    """Outputs 1..16; a free one (SERVOn_FUNCTION 0) can be set by command."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._pulses = [DISABLED_OUTPUT] * len(SERVO_FUNCTIONS)

    def function(self, channel: int) -> int:
        """SERVOn_FUNCTION of channel (from 1)."""
        return int(self._parameters[SERVO_FUNCTIONS[channel - 1]])

    def set(self, channel: int, pulse: int) -> bool:
        """Drive a free output; False when the channel does not exist or something else drives it."""
        if not 1 <= channel <= len(SERVO_FUNCTIONS) or self.function(channel) not in (0, 1):
            return False
        self._pulses[channel - 1] = pulse & 0xFFFF
        return True

    def pulses(self, motor_pulse: int) -> list[int]:
        """All outputs; a copter's motors show motor_pulse."""
        return self.driven(dict.fromkeys(MOTOR_FUNCTIONS, motor_pulse))

    def driven(self, by_function: Mapping[int, int]) -> list[int]:
        """All outputs; those with a SERVOn_FUNCTION of by_function show its pulse."""
        functions = [int(self._parameters[name]) for name in SERVO_FUNCTIONS]
        return [by_function.get(function, pulse) for function, pulse in zip(functions, self._pulses, strict=True)]
