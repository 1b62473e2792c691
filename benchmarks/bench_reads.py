"""Reads per second, what waiting calls cost them, and the way of a command through MAVProxy's main loop and back.

All cases take turns in one run; the yardstick is an aiohttp server that does nothing, on the same machine at the
same time.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from figures import machine, percentile, put_first, table
from http_clients import Bare, Client, Clients
from rig import fly, rig
from tap import Tap, message_id

BARE, OURS = "bare aiohttp handler", "uavapi"
WAITING = 200
POLLERS = 4  # beside the commands
COMMAND_LONG, COMMAND_ACK = 76, 77
COMMANDS = 150  # in each round and case


class Reads:
    """What was measured of one case, by round."""

    def __init__(self) -> None:
        self.rates: list[float] = []  # Hz
        self.times: list[list[float]] = []  # s

    def take(self, times: list[float], seconds: float) -> None:
        """Note a round."""
        self.rates.append(len(times) / seconds)
        self.times.append(times)

    @property
    def rate(self) -> float:
        """Reads per second, the median of the rounds."""
        return percentile(self.rates, 0.5)

    def latency(self, share: float) -> float:
        """That percentile of the answers' times in ms, the median of the rounds."""
        return percentile([percentile(times, share) * 1e3 for times in self.times], 0.5)


@dataclass(frozen=True)
class Case:
    """Clients that read `/telemetry/gps` as fast as they get answers.

    Attributes:
        server: whom they ask.
        clients: how many they are.
        waiting: calls that wait meanwhile.
    """

    server: str
    clients: int
    waiting: int = 0

    def __str__(self) -> str:
        return self.server + (f", {self.waiting} waiting calls" if self.waiting else "")


CASES = [Case(BARE, 1), Case(OURS, 1), Case(BARE, 16), Case(OURS, 16), Case(OURS, 16, WAITING)]


def read(clients: Clients, ports: Mapping[str, int], cases: Mapping[Case, Reads], seconds: float) -> None:
    """One round of reads."""
    for case, reads in cases.items():
        clients.begin(ports[case.server], seconds, pollers=case.clients, waiting=case.waiting)
        reads.take(clients.end(), seconds)


class RoundTrips:
    """Commands on their way: request, command at the vehicle's link, acknowledgement, answer (times in s)."""

    def __init__(self) -> None:
        self.there: list[float] = []
        self.vehicle: list[float] = []
        self.back: list[float] = []
        self._sent = self._acked = 0.0

    def attach(self, tap: Tap) -> None:
        """Look at what passes the tap from now on."""
        tap.to_vehicle = self._to_vehicle
        tap.from_vehicle = self._from_vehicle

    def _to_vehicle(self, at: float, frame: bytes) -> None:
        if message_id(frame) == COMMAND_LONG:
            self._sent = at

    def _from_vehicle(self, at: float, frame: bytes) -> None:
        if message_id(frame) == COMMAND_ACK:
            self._acked = at

    async def run(self, port: int, count: int) -> None:
        """Set a servo again and again, each time after the last one's answer."""
        client = Client(port)
        await client.open()
        for number in range(count):
            before = time.time()
            status, body = await client.ask("/peripherical/servo_output", {"channel": 9, "pwm": 1000 + number})
            after = time.time()
            assert status == 200, body
            if before <= self._sent <= self._acked <= after:  # nothing else commanded meanwhile
                self.there.append(self._sent - before)
                self.vehicle.append(self._acked - self._sent)
                self.back.append(after - self._acked)
        client.close()

    @property
    def ours(self) -> list[float]:
        """The round trips without the vehicle's own time."""
        return [there + back for there, back in zip(self.there, self.back, strict=True)]


def reads_table(cases: Mapping[Case, Reads]) -> str:
    """The reads as a table."""
    rows = []
    for case, reads in cases.items():
        bare = cases[Case(BARE, case.clients)]
        row = [str(case), str(case.clients), f"{reads.rate:.0f}"]
        row += [f"{reads.latency(0.5):.2f}", f"{reads.latency(0.99):.2f}"]
        row += [f"{reads.rate / bare.rate:.2f}", f"{reads.latency(0.99) / bare.latency(0.99):.1f}"]
        rows.append(row)
    return table(["", "clients", "reads/s", "p50 ms", "p99 ms", "reads : bare", "p99 : bare"], rows)


def trips_table(trips: dict[str, RoundTrips]) -> str:
    """The round trips as a table."""
    rows = []
    for name, trip in trips.items():
        row = [name, str(len(trip.ours))]
        for part in (trip.there, trip.vehicle, trip.back, trip.ours):
            row.append(f"{percentile(part, 0.5) * 1e3:.2f} / {percentile(part, 0.99) * 1e3:.2f}")
        rows.append(row)
    headings = ["p50 / p99 in ms", "commands", "request to link", "vehicle", "ack to answer", "ours, there and back"]
    return table(headings, rows)


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each case in each round")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    options = parser.parse_args()
    print(f"reads: {machine()}")
    clients, bare = Clients(), Bare()
    cases = {case: Reads() for case in CASES}
    try:
        with rig(max_rate=100000, max_jobs=2 * WAITING, max_connections=2 * WAITING) as (made, tap):
            if options.first:
                put_first(*(process.pid for process in made.processes))
            fly(made)
            trips = {"alone": RoundTrips(), f"with {POLLERS} clients": RoundTrips()}
            for _ in range(options.rounds):
                read(clients, {BARE: bare.port, OURS: made.port}, cases, options.seconds)
                command(clients, made, tap, trips)
    finally:
        clients.close()
        bare.close()
    print(reads_table(cases))
    print(trips_table(trips))
    print()
    return 0


def command(clients: Clients, made: Any, tap: Tap, trips: dict[str, RoundTrips]) -> None:
    """One round of commands: alone, and while others read."""
    for name, trip in trips.items():
        busy = name != "alone"
        trip.attach(tap)
        if busy:
            clients.begin(made.port, 2.0, pollers=POLLERS)
            time.sleep(0.2)
        asyncio.run(trip.run(made.port, COMMANDS))
        if busy:
            clients.end()


if __name__ == "__main__":
    sys.exit(main())
