"""What the flight code reports to the ground station, whatever the link."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StatusTextEvent:
    """A line for people; severity is a MAV_SEVERITY."""

    severity: int
    text: str


@dataclass(frozen=True)
class Broadcast:
    """A message, by its MAVLink name, that goes to all links now instead of in its stream."""

    name: str


@dataclass(frozen=True)
class ItemReached:
    """The mission item with this number is done."""

    seq: int


Event = StatusTextEvent | Broadcast | ItemReached
