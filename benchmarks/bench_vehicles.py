"""One, ten and thirty vehicles in one MAVProxy: CPU, memory, forwarding and commands, with and without our modules.

Two MAVProxys take turns with the same vehicles: one has uavapi and gradys loaded, the other has not. Telemetry goes
to one of them at a time, heartbeats to both. The vehicles are light programs (vehicle_generator.py), 50 messages/s
each; embedded vehicles would take the CPU. A command runs from the request (for MAVProxy alone: from the line at its
prompt) to the vehicle's socket, by the kernel's clock.
"""

from __future__ import annotations

import argparse
import contextlib
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
from bench_commands import Connection
from figures import cpu_seconds, machine, percentile, put_first, table
from rig import harness
from vehicle_generator import Copters

from tests.support.ports import free_port

PLAIN, OURS = 0, 1
NAMES = ("without our modules", "uavapi and gradys")
MODES = ("BRAKE", "GUIDED")  # by turns, so that each try changes the mode
SETTLE = 0.7  # s after a change before it counts
WARM_UP, BETWEEN_TRIES = 2.0, 0.02  # s


class Case:
    """What was measured of one MAVProxy, over all rounds."""

    def __init__(self) -> None:
        self.rounds: list[list[float]] = []  # delays (s) of each
        self.latencies: list[float] = []  # s
        self.cpu = self.wall = self.memory = 0.0
        self.lost = 0

    def typical(self, share: float) -> float:
        """The median over the rounds of a percentile of each round's delays, ms: a burst spoils one round only."""
        return percentile([percentile(delays, share) * 1e3 for delays in self.rounds], 0.5)


class Bench:
    """A number of vehicles and both MAVProxys."""

    def __init__(self, rigs: list[Any], copters: Copters, count: int, options: argparse.Namespace) -> None:
        self._rigs, self._copters, self._count = rigs, copters, count
        self._seconds, self._tries = options.seconds, options.tries
        self._order = [PLAIN, OURS]
        self.cases = [Case() for _ in NAMES]

    def round(self) -> None:
        """Every case once, in turn with the other one first: the start of thirty links takes time."""
        self._order.reverse()
        for number in self._order:
            case = self.cases[number]
            self._copters.speak_to(number)
            time.sleep(SETTLE)
            self._measure(self._rigs[number].mavproxy.pid, case)
            case.latencies += self._latencies(self._by_http if number == OURS else self._by_prompt)

    def _measure(self, pid: int, case: Case) -> None:
        cpu, start = cpu_seconds(pid), time.time()
        time.sleep(self._seconds)
        end = time.time()
        case.cpu += cpu_seconds(pid) - cpu
        case.wall += end - start
        case.memory = psutil.Process(pid).memory_info().rss / 1e6
        time.sleep(0.2)  # for what is on its way
        delays, lost = self._copters.forwarded(start, end)
        case.rounds.append(delays)
        case.lost += lost

    def _latencies(self, command: Callable[[int, str], float]) -> list[float]:
        """s from the command to the vehicle's socket, for each try."""
        latencies = []
        for number in range(self._tries):
            system = 1 if command == self._by_prompt else 1 + number % self._count
            turn = number if command == self._by_prompt else number // self._count
            self._copters.expect(system)
            requested_at = command(system, MODES[turn % 2])
            latencies.append(self._copters.commanded_at() - requested_at)
            time.sleep(BETWEEN_TRIES)
        return latencies

    def _by_http(self, system: int, mode: str) -> float:
        connection = Connection(self._rigs[OURS].port)
        requested_at = time.time()
        status, body = connection.ask("GET", f"/vehicles/{system}/command/{mode.lower()}")
        assert status == 200, body
        connection.close()
        return requested_at

    def _by_prompt(self, _system: int, mode: str) -> float:
        """MAVProxy's own command, for its current vehicle."""
        requested_at = time.time()
        self._rigs[PLAIN].mavproxy.type(f"mode {mode}")
        return requested_at


def free_ports(count: int) -> list[int]:
    """So many UDP ports that nobody has just now."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [int(one.getsockname()[1]) for one in sockets]


@contextlib.contextmanager
def bench(count: int, options: argparse.Namespace) -> Iterator[Bench]:
    """So many vehicles, and both MAVProxys."""
    ports = free_ports(2 * count)
    pairs = [ports[2 * n : 2 * n + 2] for n in range(count)]
    rigs: list[Any] = []
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as name:
        copters = Copters(pairs)
        try:
            for number in (PLAIN, OURS):
                directory = Path(name, str(number))
                directory.mkdir()
                rigs.append(start(directory, [pair[number] for pair in pairs], copters.out_port, number == OURS))
            for system in range(1, count + 1):
                rigs[PLAIN].mavproxy.says(f"Detected vehicle {system}:1")
            rigs[OURS].wait_until_up()
            harness.eventually(
                lambda: len(rigs[OURS].get("/vehicles").json()["vehicles"]) == count, what="all of them"
            )
            time.sleep(WARM_UP)
            if options.first:
                put_first(copters.process.pid or 0, *(rig.mavproxy.pid for rig in rigs))
            yield Bench(rigs, copters, count, options)
        finally:
            copters.close()
            for rig in rigs:
                rig.stop()


def start(directory: Path, links: list[int], out_port: int, with_modules: bool) -> Any:
    """A MAVProxy that listens for the vehicles at these ports."""
    rig = harness.Rig(directory, free_port())
    command = [
        *harness.MAVPROXY,
        f"--out=udp:127.0.0.1:{out_port}",
        *(f"--master=udp:127.0.0.1:{port}" for port in links),
    ]
    if with_modules:
        command += [harness.load(rig.port), f'--cmd=module load gradys:{{"spool":"{directory}/spool.db"}}']
    rig.mavproxy = rig.start("mavproxy", command, {"MAVLINK20": "1"})  # else one loads a second dialect
    return rig


def rows(count: int, cases: list[Case]) -> list[list[str]]:
    """Two lines of the table."""
    made = []
    for name, case in zip(NAMES, cases, strict=True):
        added = f"{case.typical(0.99) - cases[PLAIN].typical(0.99):+.2f}" if case is cases[OURS] else ""
        made.append(
            [
                f"{count}, {name}",
                f"{100 * case.cpu / case.wall:.0f} %",
                f"{case.memory:.0f}",
                f"{case.typical(0.5):.2f}",
                f"{case.typical(0.99):.2f}",
                added,
                str(case.lost),
                f"{percentile(case.latencies, 0.5) * 1e3:.2f}",
                f"{percentile(case.latencies, 0.99) * 1e3:.2f}",
            ]
        )
    return made


def main() -> int:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, nargs="+", default=[1, 10, 30], help="how many")
    parser.add_argument("--seconds", type=float, default=2.0, help="of each case in each round (%(default)g)")
    parser.add_argument("--rounds", type=int, default=3, help="(%(default)s)")
    parser.add_argument("--tries", type=int, default=30, help="commands in each round (%(default)s)")
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    options = parser.parse_args()
    print(f"vehicles: {machine()}")
    lines = []
    for count in options.vehicles:
        with bench(count, options) as made:
            for _ in range(options.rounds):
                made.round()
        lines += rows(count, made.cases)
    headings = ["vehicles", "CPU", "MB", "forwarding 50 %, ms", "99 %, ms", "99 % added", "lost"]
    headings += ["command 50 %, ms", "99 %, ms"]
    print(table(headings, lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
