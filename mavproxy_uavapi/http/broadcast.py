"""Passes each arriving message to all subscribers, encoded once and only when somebody reads it. Pure."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.http.responses import dumps
from mavproxy_uavapi.http.telemetry_views import fields

QUEUED = 1000  # messages; a client that reads slower than that loses the oldest
TOGETHER = 100  # messages that a client gets at once

Listener = Callable[[VehicleState, Any, float], None]


class Event:
    """A message on its way to its subscribers.

    Args:
        message: the MAVLink message.
        at: its arrival, s since 1970.
    """

    def __init__(self, message: Any, at: float) -> None:
        self.message, self._at = message, at
        self.name: str = message.get_type()

    @cached_property
    def _members(self) -> str:
        members = {
            "system": self.message.get_srcSystem(),
            "component": self.message.get_srcComponent(),
            "name": self.name,
            "time": round(self._at, 3),
            "fields": fields(self.message),
        }
        return dumps(members)[1:]

    def json(self, dropped: int) -> str:
        """The event as JSON, for a client that has lost `dropped` messages so far."""
        return f'{{"dropped": {dropped}, {self._members}'


class Subscription:
    """One client's filter, and its messages that are not yet read.

    Args:
        names: of the wanted messages; empty for all.
        system: the system id; None for all.
        rate: highest rate of each name of each component in Hz; None for all messages.

    Attributes:
        dropped: messages lost because the client reads too slowly.
    """

    def __init__(self, names: frozenset[str], system: int | None, rate: float | None) -> None:
        self._names = names
        self._system = system
        self._interval = 1.0 / rate if rate else 0.0
        self._last: dict[tuple[int, int, str], float] = {}
        self._queue: deque[Event] = deque(maxlen=QUEUED)
        self._news = asyncio.Event()
        self.dropped = 0

    def offer(self, state: VehicleState, event: Event, now: float) -> None:
        """Queue a message that arrived at `now` (s), if it is wanted; a full queue loses its oldest."""
        if (self._names and event.name not in self._names) or self._system not in (None, state.system):
            return
        if self._interval:
            key = state.system, event.message.get_srcComponent(), event.name
            if now - self._last.get(key, -self._interval) < self._interval:
                return
            self._last[key] = now
        if len(self._queue) == QUEUED:
            self.dropped += 1
        self._queue.append(event)
        self._news.set()

    async def next(self) -> list[Event]:
        """The next events, at least one."""
        while not self._queue:
            self._news.clear()
            await self._news.wait()
        return [self._queue.popleft() for _ in range(min(len(self._queue), TOGETHER))]


class TelemetryBroadcast:
    """Passes arriving messages to every subscription.

    Args:
        listeners: the host's; the broadcast is in it while there is a subscription.
    """

    def __init__(self, listeners: list[Listener]) -> None:
        self._listeners = listeners
        self._subscriptions: list[Subscription] = []

    @contextmanager
    def heard_by(self, subscription: Subscription) -> Iterator[Subscription]:
        """Offer all messages to a subscription for as long as the context lasts."""
        if not self._subscriptions:
            self._listeners.append(self._offer)
        self._subscriptions.append(subscription)
        try:
            yield subscription
        finally:
            self._subscriptions.remove(subscription)
            if not self._subscriptions:
                self._listeners.remove(self._offer)

    def _offer(self, state: VehicleState, message: Any, now: float) -> None:
        event = Event(message, time.time())
        for subscription in self._subscriptions:
            subscription.offer(state, event, now)
