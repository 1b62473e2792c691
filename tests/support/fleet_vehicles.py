"""Vehicles of a fleet in one process: `python -m tests.support.fleet_vehicles`.

Each has what a vehicle's companion has from the reading on: spool, sender and sink of mavproxy_gradys, all as they
are. It has no MAVProxy and no MAVLink: the readings are of a circle that it flies on paper.

SIGUSR1 ends the sampling; it exits when the spools are empty. SIGUSR2 sets their clocks back by an hour, and the next
one right again. What was sampled goes to a file, a line each: device, number, ms since 1970.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import math
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any, TextIO

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.quantities import POSITION, POSITION_REPRESENTATION
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.sender import Sender
from mavproxy_gradys.forwarding.sink_address import sink_address
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_thread import SpoolThread, uptime
from mavproxy_gradys.settings import GradysModuleSettings
from mavproxy_uavapi.core.held_tasks import HeldTasks

HOME = -35.363261, 149.165230  # degrees
METRES = 111318.845  # of a degree of latitude
APART = 60.0  # m between the circles of two vehicles
RADIUS, SPEED = 20.0, 5.0  # m, m/s
ENDURANCE = 1500.0  # s of a battery
STEP = 3600.0  # s by which SIGUSR2 sets the clocks back


def flight(number: int, at: float) -> dict[str, tuple[Any, str]]:
    """What vehicle `number` measures at `at` (s): values and units by quantity."""
    side = 40
    north, east = APART * (number // side), APART * (number % side)
    turn = SPEED / RADIUS * at + number
    lat = HOME[0] + (north + RADIUS * math.cos(turn)) / METRES
    lng = HOME[1] + (east + RADIUS * math.sin(turn)) / METRES / math.cos(math.radians(HOME[0]))
    alt = 20 + number % 30 + math.sin(at / 20)
    battery = 100 * (1 - (at + 37 * number) % ENDURANCE / ENDURANCE)
    return {
        POSITION: ([round(lat, 7), round(lng, 7), round(alt, 2)], POSITION_REPRESENTATION),
        "heading": (round(math.degrees(turn) + 90) % 360, "deg"),
        "ground_speed": (round(SPEED + 0.3 * math.sin(at), 2), "m/s"),
        "battery": (round(battery), "%"),
        "voltage": (round(10.5 + 2.1 * battery / 100, 2), "V"),
    }


class SpooledVehicle:
    """One vehicle.

    Args:
        number: names it, `uav-7`, and says where it flies.
        directory: for its spool.
        sink: URL.
        ledger: where it notes what it has sampled.
        shift: s by which its clock is wrong.
    """

    def __init__(self, number: int, directory: Path, sink: str, ledger: TextIO, shift: float) -> None:
        self._number = number
        self._shift = self._usual_shift = shift
        self._ledger = ledger
        address = sink_address(sink)
        settings = GradysModuleSettings({"sink": sink, "spool": str(directory / f"spool-{number}.db")}).snapshot()
        self.thread = SpoolThread(lambda: Spool(settings.spool, settings.spool_mb * 1e6, settings.spool_hours * 3600))
        self.thread.start([address.name])
        self.sender = Sender(address, self.thread, uptime)
        self.sampled = 0
        self._sending = self.sender.run(settings)

    def start(self, tasks: HeldTasks) -> None:
        """Begin to send."""
        tasks.start(self._sending, f"the delivery of {self._number}")

    async def sample(self, count: int) -> None:
        """Take `count` readings, one quantity after the other."""
        at = round(time.time() + self._shift, 3)
        values = list(flight(self._number, at).items())
        picked = [values[(self.sampled + n) % len(values)] for n in range(count)]
        readings = [
            Reading(f"uav-{self._number}", self._number, name, unit, value, at) for name, (value, unit) in picked
        ]
        numbers = await self.thread.keep(readings)
        self.sampled += len(numbers)
        self._ledger.writelines(f"uav-{self._number},{seq},{round(at * 1000)}\n" for seq in numbers)

    def step_clock(self) -> None:
        """Set its clock back, or right again."""
        self._shift = self._usual_shift - STEP if self._shift == self._usual_shift else self._usual_shift

    async def delivered(self) -> None:
        """Wait until all is acknowledged."""
        while self.thread.count != 0 or self.thread.waiting:  # noqa: ASYNC110  the spool tells nobody
            await asyncio.sleep(0.1)


async def sampling(vehicle: SpooledVehicle, rate: float, offset: float, over: asyncio.Event) -> None:
    """Sample `rate` readings a second, until `over`; several at once where the rate is high."""
    at_once = max(1, round(rate / 5))
    due = asyncio.get_running_loop().time() + offset
    while not over.is_set():
        await asyncio.sleep(max(due - asyncio.get_running_loop().time(), 0.0))
        due += at_once / rate
        with contextlib.suppress(NotStored):
            await vehicle.sample(at_once)


async def run(options: argparse.Namespace) -> None:
    """Fly them all."""
    over, tasks = asyncio.Event(), HeldTasks()
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, over.set)
    with options.ledger.open("w", encoding="ascii") as ledger:
        vehicles = [
            SpooledVehicle(
                number, options.directory, options.sinks[number % len(options.sinks)], ledger, options.shift
            )
            for number in range(options.first, options.first + options.count)
        ]
        for vehicle in vehicles:
            vehicle.start(tasks)

        def step_clocks() -> None:
            for vehicle in vehicles:
                vehicle.step_clock()

        asyncio.get_running_loop().add_signal_handler(signal.SIGUSR2, step_clocks)
        print(f"{options.count} vehicles fly", flush=True)
        share = 1.0 / options.count
        flights = [sampling(one, options.rate, n * share, over) for n, one in enumerate(vehicles)]
        await asyncio.gather(*flights)
    print(json.dumps({"sampled": sum(one.sampled for one in vehicles)}), flush=True)
    for vehicle in vehicles:
        await vehicle.delivered()
    await tasks.end()
    dropped = sum((Counter(one.thread.dropped) for one in vehicles), Counter())
    for vehicle in vehicles:
        await vehicle.thread.stop()
    sent = sum(one.sender.sent for one in vehicles)
    print(json.dumps({"drained": True, "dropped": dict(dropped), "sent": sent}), flush=True)


def main() -> int:
    """Fly until SIGUSR1, or at once until SIGTERM."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sinks", nargs="+", help="URLs; the vehicles take turns with them")
    parser.add_argument("--count", type=int, default=10, help="vehicles (%(default)s)")
    parser.add_argument("--first", type=int, default=1, help="number of the first one (%(default)s)")
    parser.add_argument("--rate", type=float, default=5.0, help="readings/s of each (%(default)g)")
    parser.add_argument("--shift", type=float, default=0.0, help="s by which their clocks are wrong (%(default)g)")
    parser.add_argument("--directory", type=Path, required=True, help="for the spools")
    parser.add_argument("--ledger", type=Path, required=True, help="where it is noted what was sampled")
    asyncio.run(run(parser.parse_args()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
