"""Faults on command: the one place that decides what goes wrong for a test.

Names of faults and their fields are those of the control line protocol (`control`). Times are simulated
seconds. The simulator asks here before it sends, receives and acknowledges.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ALL_COMMANDS = -1
FOREIGN_SYSTEM = 99
FOREIGN_COMPONENT = 190
FLOATS = ("float", "double")
_NUMBERS = {str(kind.msgname): number for number, kind in mavlink.mavlink_map.items()}


class FaultError(ValueError):
    """A fault that does not exist or lacks a field; the text says which."""


def _known(name: str) -> str:
    if name not in _NUMBERS:
        raise FaultError(f"no message is called {name!r}")
    return name


@dataclass
class CommandFault:
    """A fault of commands: command id or ALL_COMMANDS, and how often it still happens.

    `drop` concerns messages of any name; command narrows it to some commands.
    """

    command: int
    message: str = ""
    count: float = math.inf
    seconds: float = 0.0
    result: int = 0
    text: str = ""
    system: int = FOREIGN_SYSTEM
    component: int = FOREIGN_COMPONENT

    def take(self, command: int) -> bool:
        """Whether it happens to this command; counts it."""
        if self.count <= 0 or self.command not in (ALL_COMMANDS, command):
            return False
        self.count -= 1
        return True


@dataclass(frozen=True)
class PlannedAck:
    """A COMMAND_ACK to send at a time, from a system and component (None: the vehicle itself), or to lose."""

    at: float
    result: int
    source: tuple[int, int] | None = None
    is_lost: bool = False


class Faults:
    """Which faults are active."""

    KINDS = ("drop", "lose_acks", "delay_acks", "foreign_ack", "refuse", "in_progress")

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """End all faults."""
        self._mute_until = self._deaf_until = -math.inf
        self.gps_frozen_until = -math.inf
        self._spoilt: dict[str, tuple[float, tuple[str, ...]]] = {}
        self._command: dict[str, list[CommandFault]] = {kind: [] for kind in self.KINDS}

    def silence(self, now: float, seconds: float, *, sending: bool, receiving: bool) -> None:
        """Send nothing and/or hear nothing for seconds (inf: until cleared)."""
        if sending:
            self._mute_until = now + seconds
        if receiving:
            self._deaf_until = now + seconds

    def freeze_gps(self, now: float, seconds: float) -> None:
        """Keep reporting the present position for seconds, wherever the vehicle goes."""
        self.gps_frozen_until = now + seconds

    def spoil(self, name: str, fields: Sequence[str], now: float, seconds: float) -> None:
        """Send NaN in float fields of the telemetry message NAME for seconds; without fields in all of them."""
        kind = mavlink.mavlink_map[_NUMBERS[_known(name)]]
        floats = [field for field, of in zip(kind.fieldnames, kind.fieldtypes, strict=True) if of in FLOATS]
        chosen = tuple(fields) or tuple(floats)
        if not chosen or not set(chosen) <= set(floats):
            raise FaultError(f"{name} has the float fields {floats}")
        self._spoilt[name] = now + seconds, chosen

    def spoilt(self, message: Any, now: float) -> Any:
        """The message as it is to be sent now."""
        until, fields = self._spoilt.get(message.get_type(), (-math.inf, ()))
        if now < until:
            for field in fields:
                value = getattr(message, field)
                setattr(message, field, [math.nan] * len(value) if isinstance(value, list) else math.nan)
        return message

    def add(self, kind: str, fields: Mapping[str, Any]) -> None:
        """Make a fault of commands active; FaultError when the fields make no sense."""
        if kind not in self._command:
            raise FaultError(f"no fault is called {kind!r}")
        try:
            command = fields.get("command", "all")
            fault = CommandFault(ALL_COMMANDS if command == "all" else int(command))
            fault.message = _known(str(fields["message"])) if kind == "drop" else ""
            fault.count = float(fields.get("count", math.inf))
            fault.seconds = float(fields.get("seconds", 0.0))
            fault.result = int(fields.get("result", mavlink.MAV_RESULT_FAILED))
            fault.text = str(fields.get("text", ""))
            fault.system = int(fields.get("system", FOREIGN_SYSTEM))
            fault.component = int(fields.get("component", FOREIGN_COMPONENT))
        except (KeyError, TypeError, ValueError) as error:
            raise FaultError(f"{kind}: {error}") from error
        self._command[kind].append(fault)

    def mute(self, now: float) -> bool:
        """Whether nothing may be sent now."""
        return now < self._mute_until

    def deaf(self, now: float) -> bool:
        """Whether nothing is heard now."""
        return now < self._deaf_until

    def drops(self, message: Any) -> bool:
        """Whether this message is lost on its way to the vehicle; counts it."""
        name, command = message.get_type(), getattr(message, "command", ALL_COMMANDS)
        return any(fault.message == name and fault.take(command) for fault in self._command["drop"])

    def refusal(self, command: int) -> CommandFault | None:
        """The fault that refuses this command instead of doing it, if any."""
        return self._take_fault("refuse", command)

    def acks(self, command: int, result: int, now: float) -> list[PlannedAck]:
        """What is sent as acknowledgement of a command that ended with result."""
        planned = []
        foreign = self._take_fault("foreign_ack", command)
        if foreign is not None:
            planned.append(PlannedAck(now, foreign.result, (foreign.system, foreign.component)))
        at = now
        progress = self._take_fault("in_progress", command)
        if progress is not None:
            # As often as a long command reports: twice a second.
            reports = max(1, int(progress.seconds / 0.5))
            planned += [PlannedAck(now + 0.5 * report, mavlink.MAV_RESULT_IN_PROGRESS) for report in range(reports)]
            at += progress.seconds
        delay = self._take_fault("delay_acks", command)
        if delay is not None:
            at += delay.seconds
        is_lost = self._take_fault("lose_acks", command) is not None
        return [*planned, PlannedAck(at, result, is_lost=is_lost)]

    def _take_fault(self, kind: str, command: int) -> CommandFault | None:
        for fault in self._command[kind]:
            if fault.take(command):
                return fault
        return None
