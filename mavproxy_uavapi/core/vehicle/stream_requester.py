"""Requests the messages that a vehicle should send but that do not arrive.

MAVProxy requests all streams of every vehicle at its `streamrate`, which stays as it is; for each vehicle after the
first one up to 15 s late. A message that does not arrive (EXTENDED_SYS_STATE is in no stream) is requested with
SET_MESSAGE_INTERVAL. Many vehicles may share one radio. So a vehicle that nobody uses is asked once, for what the
list of vehicles shows. If the operator has switched MAVProxy's streams off, only vehicles in use are asked, for what
flight needs.

It also asks for the vehicles' clocks (TIMESYNC), which measures the trip to each: see `Trip`.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from mavproxy_uavapi.core.errors import Expired, LinkLost
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.messages import MESSAGE_IDS, no_interval, set_interval
from mavproxy_uavapi.core.mainloop.permit import CLOCK_LASTS
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

LOOK_EVERY = 1.0  # s
GAP = 0.05  # s from one request to the next, so that they do not fill a radio's buffer
MISSING_AFTER = 3.0  # s without a message until it is requested
PAUSES = (2.0, 4.0, 8.0, 16.0)  # s from each request without effect to the next one; then there are no more
STEADY = 30.0  # s after a request; if the message still arrives then, the request has helped

COMPARE_EVERY, COMPARE_UNUSED_EVERY = 1.0, 10.0  # s between two questions for a vehicle's clock

# Hz: enough for flight (positions) and for a status (the rest), and few enough for a telemetry radio.
WANTED = {
    "GLOBAL_POSITION_INT": 4.0,
    "LOCAL_POSITION_NED": 4.0,
    "ATTITUDE": 4.0,
    "EXTENDED_SYS_STATE": 2.0,
    "SYS_STATUS": 2.0,
    "EKF_STATUS_REPORT": 2.0,
    "GPS_RAW_INT": 2.0,
    "VFR_HUD": 2.0,
    "POSITION_TARGET_LOCAL_NED": 2.0,
    "POSITION_TARGET_GLOBAL_INT": 2.0,
}
# Of a vehicle that nobody uses: what `GET /vehicles` shows, with what keeps it from being armed.
LISTED = dict.fromkeys(("GLOBAL_POSITION_INT", "SYS_STATUS", "EKF_STATUS_REPORT", "GPS_RAW_INT"), 0.5)
# Without MAVProxy's streams: only what flight needs, half as often.
NEEDED = {name: rate / 2 for name, rate in WANTED.items() if name not in ("GPS_RAW_INT", "VFR_HUD")}
RATES: Mapping[tuple[bool, bool], Mapping[str, float]] = {  # whether it is used, and the streams are off
    (True, False): WANTED,
    (False, False): LISTED,
    (True, True): NEEDED,
    (False, True): {},
}
IN_GUIDED = {"POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT"}  # in other modes they say nothing
IN_NO_STREAM = {"EXTENDED_SYS_STATE", "POSITION_TARGET_LOCAL_NED"}
AT_ONCE = IN_GUIDED | IN_NO_STREAM  # requested without waiting for MAVProxy's streams to bring them


async def request_rate(vehicle: Vehicle, name: str, rate: float) -> None:
    """Request a message at `rate` Hz; 0 for the rate of its stream.

    It waits for no ack: the arriving messages are the proof.

    Raises:
        LinkLost: MAVProxy has no link.
    """
    await vehicle.post(set_interval(MESSAGE_IDS[name], rate).to(vehicle.address, 0))


@dataclass
class RateRequests:
    """The requests of one message since a boot: the rate (Hz), and when (s), until one has a lasting effect."""

    rate: float
    at: list[float] = field(default_factory=list)


@dataclass
class StreamWatch:
    """One vehicle since a boot: the number of reboots, the start of the watch (s), and the requests."""

    reboots: int
    since: float
    requests: dict[str, RateRequests] = field(default_factory=dict)


class StreamRequester:
    """Watches what arrives from each vehicle that MAVProxy hears.

    Args:
        registry: the vehicles, and which are used.
    """

    def __init__(self, registry: VehicleRegistry) -> None:
        self._registry = registry
        self._watches: dict[int, StreamWatch] = {}  # by system id
        self._compared_at: dict[int, float] = {}  # s, by system id
        self._requested: set[tuple[int, str]] = set()  # system id and name of each message that was ever requested

    async def run(self) -> None:
        """Watch, until cancelled."""
        asks_from = -math.inf  # s; after a stand of MAVProxy's main loop all streams have the time to come
        while True:
            if self._registry.is_deaf:
                asks_from = self._registry.clock() + MISSING_AFTER
            else:
                await self._compare_clocks()
            request = next(self.due(), None) if self._registry.clock() >= asks_from else None
            if request is None:
                await asyncio.sleep(LOOK_EVERY)
            else:
                await self._send(*request)
                await asyncio.sleep(GAP)

    async def _send(self, vehicle: Vehicle, name: str, rate: float) -> None:
        system = vehicle.state.system
        requests = self._watches[system].requests
        if name not in requests or requests[name].rate != rate:
            requests[name] = RateRequests(rate)
        requests[name].at.append(vehicle.clock())
        self._requested.add((system, name))
        with contextlib.suppress(LinkLost, Expired):
            await request_rate(vehicle, name, rate)

    async def _compare_clocks(self) -> None:
        """Ask for the clocks of those whose turn it is; nothing on a serial link that is full."""
        for vehicle in self._registry.all():
            system, now = vehicle.state.system, vehicle.clock()
            unused = math.inf if self._registry.streams_are_off else COMPARE_UNUSED_EVERY
            period = COMPARE_EVERY if self._registry.is_used(system) else unused
            is_due = now - self._compared_at.get(system, -math.inf) >= period
            if is_due and self._registry.is_alive(vehicle) and not self._registry.link_is_full:
                self._compared_at[system] = now
                message = messages.time_question(vehicle.address, vehicle.state.trip.ask(now))
                with contextlib.suppress(LinkLost, Expired):
                    await vehicle.post(message, lasts=CLOCK_LASTS)

    def due(self) -> Iterator[tuple[Vehicle, str, float]]:
        """The requests that are due now, with their rate (Hz); those of vehicles that are used come first."""
        vehicles = self._registry.all()
        for vehicle in sorted(vehicles, key=lambda vehicle: not self._registry.is_used(vehicle.state.system)):
            if self._registry.is_alive(vehicle):
                yield from self._due_of(vehicle)
            elif self._registry.is_used(vehicle.state.system):
                self._watches.pop(vehicle.state.system, None)  # when it is back, it is asked again

    def _due_of(self, vehicle: Vehicle) -> Iterator[tuple[Vehicle, str, float]]:
        now, state = vehicle.clock(), vehicle.state
        watch = self._watches.get(state.system)
        if watch is None or watch.reboots != state.reboots:
            watch = self._watches[state.system] = StreamWatch(state.reboots, now)
        for name, rate in self._wanted(vehicle).items():
            requests = watch.requests.get(name)
            if requests is not None and requests.rate < rate:
                yield vehicle, name, rate  # nobody used the vehicle at that request
            elif self._is_missing(vehicle, name, now - watch.since):
                if requests is None or self._may_ask_again(vehicle, requests.at, now):
                    yield vehicle, name, rate
            elif requests is not None and requests.at and now - requests.at[-1] > STEADY:
                requests.at.clear()

    def _wanted(self, vehicle: Vehicle) -> Mapping[str, float]:
        used, guided = self._registry.is_used(vehicle.state.system), vehicle.state.armed and vehicle.mode == "GUIDED"
        wanted = RATES[used, self._registry.streams_are_off]
        return {name: rate for name, rate in wanted.items() if guided or name not in IN_GUIDED}

    def _is_missing(self, vehicle: Vehicle, name: str, watched_for: float) -> bool:
        age = vehicle.state.age(name, vehicle.clock())
        if age is not None:
            return age >= MISSING_AFTER
        return name in AT_ONCE or self._registry.streams_are_off or watched_for >= MISSING_AFTER

    def _may_ask_again(self, vehicle: Vehicle, asked_at: list[float], now: float) -> bool:
        pauses = PAUSES if self._registry.is_used(vehicle.state.system) else ()
        return not asked_at or (len(asked_at) <= len(pauses) and now - asked_at[-1] >= pauses[len(asked_at) - 1])

    def closing_messages(self) -> list[tuple[Any, int]]:
        """The messages that give all rates back, and their systems. A message in no stream is switched off."""
        closing_messages = []
        for system, name in sorted(self._requested):
            number = MESSAGE_IDS[name]
            command = no_interval(number) if name in IN_NO_STREAM else set_interval(number, 0)
            closing_messages.append((command.to(self._registry.find(system).address, 0), system))
        return closing_messages
