"""Sends the vehicle's messages to its links, at once or later, unless a fault loses them."""

from __future__ import annotations

import heapq
from itertools import count
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .events import Broadcast, Event, ItemReached, StatusTextEvent
from .faults import Faults
from .link import PeerLink
from .telemetry import TelemetryMessages
from .vehicle import EmbeddedVehicle

TEXT_LENGTH = 50


class Transmitter:
    """Sends for one vehicle from one boot to the next; links is its owner's list, which may change meanwhile."""

    def __init__(
        self, vehicle: EmbeddedVehicle, telemetry: TelemetryMessages, faults: Faults, links: list[PeerLink]
    ) -> None:
        self._vehicle = vehicle
        self._telemetry = telemetry
        self._faults = faults
        self._links = links
        self._planned: list[tuple[float, int, PeerLink, Any, tuple[int, int] | None]] = []
        self._order = count()
        self._long_texts = 0

    def send(self, link: PeerLink, name: str) -> None:
        """Queue a message about the present state for one link, if there is something to say."""
        message = self._telemetry.build(name)
        if message is not None:
            link.send(self._faults.spoilt(message, self._vehicle.now))

    def send_soon(self, link: PeerLink, name: str) -> None:
        """The same with the next step."""
        message = self._telemetry.build(name)
        if message is not None:
            self.plan(self._vehicle.now, link, self._faults.spoilt(message, self._vehicle.now))

    def broadcast(self, name: str) -> None:
        """Queue a message about the present state for all links."""
        for link in self._links:
            self.send(link, name)

    def emit(self, event: Event) -> None:
        """Queue what the flight code reports, for all links."""
        if isinstance(event, Broadcast):
            self.broadcast(event.name)
            return
        messages = self._texts(event) if isinstance(event, StatusTextEvent) else [_reached(event)]
        for link in self._links:
            for message in messages:
                link.send(message)

    def _texts(self, event: StatusTextEvent) -> list[Any]:
        """A long text goes in pieces, which a number of their own joins."""
        text = event.text.encode()
        if len(text) <= TEXT_LENGTH:
            return [mavlink.MAVLink_statustext_message(event.severity, text)]
        self._long_texts = self._long_texts % 0xFFFF + 1
        return [
            mavlink.MAVLink_statustext_message(
                event.severity, text[start : start + TEXT_LENGTH], self._long_texts, start // TEXT_LENGTH
            )
            for start in range(0, len(text), TEXT_LENGTH)
        ]

    def plan(self, at: float, link: PeerLink, message: Any, source: tuple[int, int] | None = None) -> None:
        """Send message at `at` seconds since boot; source makes it come from another system and component."""
        heapq.heappush(self._planned, (at, next(self._order), link, message, source))

    def send_planned(self) -> None:
        """Queue the planned messages whose time has come."""
        while self._planned and self._planned[0][0] <= self._vehicle.now:
            _, _, link, message, source = heapq.heappop(self._planned)
            link.send(message, source)


def _reached(event: ItemReached) -> Any:
    return mavlink.MAVLink_mission_item_reached_message(event.seq)
