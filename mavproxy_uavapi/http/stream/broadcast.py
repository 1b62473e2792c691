"""Passes what arrives to all clients of streams: messages, views of them, and events."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.http.stream.stream_event import Event, When, of_info, of_message
from mavproxy_uavapi.http.stream.stream_news import NewsWatch
from mavproxy_uavapi.http.stream.stream_views import BY_MESSAGE, OF_A_MESSAGE, OF_A_VEHICLE
from mavproxy_uavapi.http.stream.subscription import Subscription

TICK = 0.5  # s from one summary of a vehicle to the next


class TelemetryBroadcast:
    """Passes what arrives to every subscription.

    Args:
        host: its listeners call the broadcast while there is a subscription.
    """

    def __init__(self, host: Host) -> None:
        self._host = host
        self._subscriptions: list[Subscription] = []
        self._wishes: dict[tuple[str, str], bool] = {}  # whether any client wants that; filled when asked
        self._watch = NewsWatch(host)
        self._ticks: asyncio.TimerHandle | None = None

    @contextmanager
    def heard_by(self, subscription: Subscription) -> Iterator[Subscription]:
        """Offer everything to a subscription for as long as the context lasts; first what is known already."""
        if not self._subscriptions:
            self._host.listeners.append(self._take)
            self._host.observers.append(self._tell)
        self._subscriptions.append(subscription)
        self._wishes.clear()
        try:
            self._tell_first(subscription)
            if subscription.wishes.needs_ticks and self._ticks is None:
                self._watch.everything()
                self._tick()
            yield subscription
        finally:
            subscription.close()
            self._subscriptions.remove(subscription)
            self._wishes.clear()
            if not self._subscriptions:
                self._host.listeners.remove(self._take)
                self._host.observers.remove(self._tell)

    def _when(self, at: float) -> When:
        """What was at `at` of the monotonic clock, on both clocks."""
        return When(time.time() - (self._host.clock() - at), at)

    def _offer(self, event: Event) -> None:
        now = self._host.clock()
        for subscription in self._subscriptions:
            subscription.offer(event, now)

    def _wanted(self, kind: str, name: str) -> bool:
        wanted = self._wishes.get((kind, name))
        if wanted is None:
            wanted = any(name in getattr(subscription.wishes, kind) for subscription in self._subscriptions)
            self._wishes[kind, name] = wanted
        return wanted

    def _take(self, state: VehicleState, message: Any, now: float) -> None:
        """A message has arrived."""
        at, name = self._when(now), message.get_type()
        if self._wanted("name", name):
            self._offer(of_message(message, at))
        for view in BY_MESSAGE.get(name, ()):
            newest = state.newest(name)
            # Another component's message is no view if the autopilot sends the same.
            if newest is not None and newest.message is message and self._wanted("view", view):
                self._offer(_view_of(view, state.system, message, at))
        if self._ticks is not None:
            changes = self._watch.of_vehicle(state)
            for change in [*changes, *(self._watch.of_jobs() if changes else ())]:
                self._announce(*change)
            if changes:
                self._summarize(state.system)

    def _tick(self) -> None:
        """Twice a second: what no message announces, such as silence."""
        if not any(subscription.wishes.needs_ticks for subscription in self._subscriptions):
            self._ticks = None
            return
        self._ticks = asyncio.get_running_loop().call_later(TICK, self._tick)
        self._offer(self._alive())
        for change in self._watch.everything():
            self._announce(*change)
        for system in list(self._host.fleet.vehicles):
            self._summarize(system)

    def _alive(self) -> Event:
        systems = sorted(self._host.fleet.vehicles)
        return of_info("event", "alive", 0, self._when(self._host.clock()), {"vehicles": systems})

    def _tell(self, name: str, system: int, ago: float, info: Mapping[str, Any]) -> None:
        """Pass an event on; it happened `ago` s ago."""
        self._announce(name, system, self._host.clock() - ago, info)

    def _announce(self, name: str, system: int, at: float, info: Mapping[str, Any]) -> None:
        if self._wanted("event", name):
            self._offer(of_info("event", name, system, self._when(at), info))

    def _summarize(self, system: int) -> None:
        vehicle = self._host.registry.find(system)
        for name, make in OF_A_VEHICLE.items():
            info = make(self._host, vehicle) if self._wanted("view", name) else None
            if info is not None:
                self._offer(of_info("view", name, system, self._when(self._host.clock()), info))

    def _tell_first(self, subscription: Subscription) -> None:
        """Offer what was known before it came, with the time of its arrival."""
        now = self._host.clock()
        subscription.offer(self._alive(), now)  # its time shows how old the others are
        if subscription.wishes.view:
            for system, state in self._host.fleet.vehicles.items():
                for view, (name, _) in OF_A_MESSAGE.items():
                    newest = state.newest(name)
                    if newest is not None:
                        subscription.offer(_view_of(view, system, newest.message, self._when(newest.at)), now)
        if subscription.wishes.event:
            for event, system, at, info in self._watch.first():
                subscription.offer(of_info("event", event, system, self._when(at), info), now)


def _view_of(view: str, system: int, message: Any, at: When) -> Event:
    make = OF_A_MESSAGE[view][1]
    return Event("view", view, system, at, lambda: {"info": make(message)})
