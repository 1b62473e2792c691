"""The telemetry that a flight needs, at the rate that it needs, for as long as it needs it.

MAVProxy asks for all streams at its own rate every 15 s, which overrides message intervals. So what arrives is
watched, and asked for again as soon as it has become slow; afterwards the default is asked for.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.vehicle.messages import MESSAGE_IDS, Command, set_interval
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

mavlink = mavutil.mavlink

FLIGHT = {"ATTITUDE": 25.0, "LOCAL_POSITION_NED": 25.0}  # Hz of the vehicle's clock
TRUTH = {"SIM_STATE": 50.0}
LOOK_EVERY = 0.1  # s
SLOW = 2.5  # intervals without a message until it is asked for again
ASK_AGAIN = 1.0  # s until it is asked for again, twice as long each time that it did not help …
RARELY = 15.0  # … up to so many s


class Rates:
    """Watches the rates of one vehicle."""

    def __init__(self, clock: Any) -> None:
        self._clock = clock
        self._needed: list[dict[str, float]] = []
        self._asked: dict[tuple[Vehicle, str], float] = {}  # when
        self._pause: dict[str, float] = {}

    @property
    def needed(self) -> dict[str, float]:
        """Message names and the rates (Hz) at which they are needed now."""
        return {name: rate for some in self._needed for name, rate in some.items()}

    @contextmanager
    def at(self, rates: dict[str, float]) -> Iterator[None]:
        """Need these for as long as the context lasts."""
        self._needed.append(rates)
        try:
            yield
        finally:
            self._needed.remove(rates)

    async def run(self, vehicle: Any) -> None:
        """Ask for what is needed, until cancelled; `vehicle()` gives the vehicle, or raises UavApiError."""
        while True:
            try:
                await self.look(vehicle())
            except UavApiError:
                self._asked.clear()  # nobody to ask just now; afterwards anew
            await asyncio.sleep(LOOK_EVERY)

    async def look(self, vehicle: Vehicle) -> None:
        """Ask for what is too slow, and let go of what is needed no more."""
        needed, now = self.needed, self._clock()
        ratio = max(vehicle.state.time_ratio.ratio, 0.1)
        for name, rate in needed.items():
            age = vehicle.state.age(name, now)
            received = vehicle.state.messages.get(name)
            slow = (
                received is None or max(age or 0.0, received.interval or 0.0) > SLOW / rate / ratio + LOOK_EVERY / 2
            )
            if not slow:
                self._pause[name] = ASK_AGAIN
            elif now - self._asked.get((vehicle, name), -RARELY) >= self._pause.get(name, ASK_AGAIN):
                if (vehicle, name) in self._asked:  # it did not help: a slow link, or a vehicle that cannot
                    self._pause[name] = min(2 * self._pause.get(name, ASK_AGAIN), RARELY)
                self._asked[vehicle, name] = now
                await self._send(vehicle, set_interval(MESSAGE_IDS[name], rate))
        for asked, name in [key for key in self._asked if key[0] is not vehicle or key[1] not in needed]:
            del self._asked[asked, name]
            self._pause.pop(name, None)
            await self._send(asked, default_interval(MESSAGE_IDS[name]))

    async def _send(self, vehicle: Vehicle, command: Command) -> None:
        # No ack is awaited: what arrives is the proof.
        await vehicle.link.send(command.to(vehicle.address, 0), vehicle.state.system)


def default_interval(message_id: int) -> Command:
    """Ask for a message at the rate of its stream."""
    return Command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (message_id, 0))
