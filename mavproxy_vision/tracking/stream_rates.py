"""Keeps the telemetry that a flight needs at the rate that it needs.

Every 15 s MAVProxy requests all streams at its own rate, which overrides message intervals. So we watch what arrives,
and request a message again as soon as it becomes slow. Afterwards we request the default rate.

`StreamRequester` does not look at rates: of every vehicle it requests what does not arrive at all, and soon gives up.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.stream_requester import request_rate
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

FLIGHT = {"ATTITUDE": 25.0, "LOCAL_POSITION_NED": 25.0}  # Hz of the vehicle's clock
RANGE = {"DISTANCE_SENSOR": 10.0}  # … of one with a rangefinder
TRUTH = {"SIM_STATE": 50.0}
RANGEFINDER = 256  # MAV_SYS_STATUS_SENSOR_LASER_POSITION: with ArduPilot a rangefinder that looks down
LOOK_EVERY = 0.1  # s
SLOW = 2.5  # intervals without a message until it is requested again
RETRY = 1.0  # s until it is requested again; doubled after each request that did not help …
LONGEST_RETRY = 15.0  # … up to so many s


class Rates:
    """Watches the rates of one vehicle."""

    def __init__(self, clock: Any) -> None:
        self._clock = clock
        self._needed: list[dict[str, float]] = []
        self._requested_at: dict[tuple[Vehicle, str], float] = {}
        self._pause: dict[str, float] = {}  # s until the next request of a message

    @property
    def needed(self) -> dict[str, float]:
        """The rate (Hz) of each message that is needed now, by name."""
        return {name: rate for some in self._needed for name, rate in some.items()}

    @contextmanager
    def at(self, rates: dict[str, float]) -> Iterator[None]:
        """Need these rates for as long as the context lasts."""
        self._needed.append(rates)
        try:
            yield
        finally:
            self._needed.remove(rates)

    async def run(self, vehicle: Any) -> None:
        """Request what is needed, until cancelled; `vehicle()` returns the vehicle, or raises UavApiError."""
        while True:
            try:
                await self.look(vehicle())
            except UavApiError:
                self._requested_at.clear()  # there is no vehicle now; later everything is requested again
            await asyncio.sleep(LOOK_EVERY)

    async def look(self, vehicle: Vehicle) -> None:
        """Request messages that are too slow; restore the default rate of those that are no longer needed."""
        needed, now = self.needed, self._clock()
        ratio = max(vehicle.state.time_ratio.ratio, 0.1)
        for name, rate in needed.items():
            if not is_slow(vehicle.state, name, SLOW / rate / ratio + LOOK_EVERY / 2):
                self._pause[name] = RETRY
            elif now - self._requested_at.get((vehicle, name), -LONGEST_RETRY) >= self._pause.get(name, RETRY):
                if (vehicle, name) in self._requested_at:  # a slow link, or a vehicle that cannot send so fast
                    self._pause[name] = min(2 * self._pause.get(name, RETRY), LONGEST_RETRY)
                self._requested_at[vehicle, name] = now
                await request_rate(vehicle, name, rate)
        for other, name in [key for key in self._requested_at if key[0] is not vehicle or key[1] not in needed]:
            del self._requested_at[other, name]
            self._pause.pop(name, None)
            await request_rate(other, name, 0)


def in_flight(state: VehicleState) -> dict[str, float]:
    """The rates (Hz) that a flight of this vehicle needs, by message."""
    present = state.field("SYS_STATUS", "onboard_control_sensors_present") or 0
    return FLIGHT | RANGE if present & RANGEFINDER else FLIGHT


def is_slow(state: VehicleState, name: str, longest: float) -> bool:
    """Whether a message does not come every `longest` s.

    Its age counts up to the vehicle's newest message: when all of them are late, MAVProxy or the link was busy, and a
    request would not help. MAVProxy's console prints the ack of each request.
    """
    received = state.messages.get(name)
    if received is None:
        return True
    newest = max(other.at for other in state.messages.values())
    return max(newest - received.at, received.interval or 0.0) > longest
