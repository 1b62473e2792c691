"""Whether each vehicle's link is alive: its heartbeats come within the link timeout."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

log = logging.getLogger("uavapi.copter")

LOOKS_WHILE_LOST = 5  # times per link timeout, whether the link is back
SHORTEST_DELAY = 0.05  # s from one look to the next


class LinkWatch:
    """Tells whether a link is alive, and ends the waits on a vehicle whose link is lost.

    Attributes:
        timeout: s without a heartbeat after which a link is lost.
        on_change: called when a link is lost, or is back: with the state, whether it is alive, and the s of silence.

    Args:
        pending: the waits.
        listening: a clock (s) that stands while nobody reads the links: that is no silence.
        loop: where the timers run.
    """

    def __init__(
        self, pending: PendingWaits, listening: Callable[[], float], loop: asyncio.AbstractEventLoop
    ) -> None:
        self.timeout = 5.0
        self.on_change: Callable[[VehicleState, bool, float], None] = lambda _state, _is_alive, _silent_for: None
        self._pending = pending
        self._listening = listening
        self._loop = loop
        self._heard: dict[int, tuple[float, float]] = {}  # the newest heartbeat, and when it was read, by system id
        self._lost: set[int] = set()
        self._timers: dict[int, asyncio.TimerHandle] = {}

    def silent_for(self, state: VehicleState) -> float:
        """Seconds of listening since the vehicle's newest heartbeat was read."""
        now = self._listening()
        _, read_at = self._heard.get(state.system, (0.0, now))
        return now - read_at

    def is_alive(self, state: VehicleState) -> bool:
        """Whether a heartbeat came within the link timeout."""
        return self.silent_for(state) < self.timeout

    def require_alive(self, state: VehicleState) -> None:
        """Raise LinkLost if the link is lost."""
        if not self.is_alive(state):
            raise LinkLost.since(state.system, self.silent_for(state))

    def watch(self, state: VehicleState) -> None:
        """A message of the vehicle was read; it is watched from now on."""
        if self._heard.get(state.system, (-math.inf,))[0] != state.heartbeat_at:
            self._heard[state.system] = state.heartbeat_at, self._listening()
        if state.system not in self._timers:
            self._look(state)

    def _look(self, state: VehicleState) -> None:
        silent_for = self.silent_for(state)
        lost = silent_for >= self.timeout
        if lost != (state.system in self._lost):
            self._lost ^= {state.system}
            log.warning("vehicle %d: %s", state.system, "link lost" if lost else "link is back")
            self.on_change(state, not lost, silent_for)
        if lost:
            self._pending.fail(state.system, lambda: LinkLost.since(state.system, silent_for))
        delay = self.timeout / LOOKS_WHILE_LOST if lost else self.timeout - silent_for
        self._timers[state.system] = self._loop.call_later(max(delay, SHORTEST_DELAY), self._look, state)
