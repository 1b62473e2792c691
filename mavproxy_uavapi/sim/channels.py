"""Radio inputs (the pilot's sticks) and servo outputs, in microseconds of pulse width."""

from __future__ import annotations

from collections.abc import Mapping

from .parameters import ParameterStore

NEUTRAL = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800)
"""What SITL's radio sends at first: sticks centred, throttle down, mode switch on 6."""
OVERRIDE_TIMEOUT = 3.0
"""RC_OVERRIDE_TIME, seconds that an RC_CHANNELS_OVERRIDE lasts."""
MODE_SWITCH_EDGES = (1231, 1361, 1491, 1621, 1750)
"""Pulse widths between the six positions of the flight mode switch."""
STICK_DEADZONE = 20
CHANNEL_COUNT = 16
SERVO_COUNT = 16
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
        pulses = list(self._radio)
        for channel, (pulse, since) in self._override.items():
            if now - since <= OVERRIDE_TIMEOUT:
                pulses[channel] = pulse
        return pulses

    def axis(self, channel: int, now: float) -> float:
        """A centring stick as -1..1, zero within the dead zone."""
        offset = self.pulses(now)[channel - 1] - 1500
        if abs(offset) <= STICK_DEADZONE:
            return 0.0
        return max(-1.0, min(1.0, offset / 500))

    def throttle(self, now: float) -> float:
        """The throttle stick as 0..1."""
        return max(0.0, min(1.0, (self.pulses(now)[2] - 1000) / 1000))

    def mode_switch(self, channel: int, now: float) -> int | None:
        """Position 1..6 of the flight mode switch on channel; None when FLTMODE_CH names no channel."""
        if not 1 <= channel <= CHANNEL_COUNT:
            return None
        pulse = self.pulses(now)[channel - 1]
        return 1 + sum(pulse >= edge for edge in MODE_SWITCH_EDGES)


class Servos:
    """Outputs 1..16; a free one (SERVOn_FUNCTION 0) can be set by command."""

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._pulses = [DISABLED_OUTPUT] * SERVO_COUNT

    def function(self, channel: int) -> int:
        """SERVOn_FUNCTION of channel (from 1)."""
        return int(self._parameters[f"SERVO{channel}_FUNCTION"])

    def set(self, channel: int, pulse: int) -> bool:
        """Drive a free output; False when the channel does not exist or something else drives it."""
        if not 1 <= channel <= SERVO_COUNT or self.function(channel) not in (0, 1):
            return False
        self._pulses[channel - 1] = pulse & 0xFFFF
        return True

    def pulses(self, motor_pulse: int) -> list[int]:
        """All outputs; a copter's motors show motor_pulse."""
        return self.driven(dict.fromkeys(MOTOR_FUNCTIONS, motor_pulse))

    def driven(self, by_function: Mapping[int, int]) -> list[int]:
        """All outputs; those with a SERVOn_FUNCTION of by_function show its pulse."""
        return [
            by_function.get(self.function(channel), self._pulses[channel - 1])
            for channel in range(1, SERVO_COUNT + 1)
        ]
