"""uavapi's thread in MAVProxy beside a prototype that has HTTP in a process of its own (`http_apart.py`).

Both take turns in one MAVProxy, with the same vehicle, the same clients and a bare aiohttp handler as the yardstick.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import socket
import sys
import time
from pathlib import Path
from typing import Any

from bench_commands import Connection
from bench_rest import memory
from figures import cpu_seconds, machine, percentile, put_first, table
from http_clients import Bare, Clients
from rig import fly, harness, rig
from tap import Forwarding, Tap, message_id

BARE, THREAD, APART = "bare aiohttp handler", "uavapi, a thread", "prototype, a process"
MODULES = {THREAD: "uavapi", APART: "http_apart"}
SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED
SETPOINTS = 150  # in each round
PAUSE = 0.021  # s between two setpoints
SETTLE = 2.0  # s after a module was loaded


class Case:
    """What was measured of one way, by round."""

    def __init__(self) -> None:
        self.rates: dict[int, list[float]] = {1: [], 16: []}  # reads/s by number of clients
        self.slowest: dict[int, list[float]] = {1: [], 16: []}  # ms, 99th percentiles
        self.setpoints: list[float] = []  # ms from the request to the wire
        self.delays: list[float] = []  # ms of MAVProxy's forwarding under load
        self.cpu: list[float] = []  # %
        self.memory: list[float] = []  # MB


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    threads = [path.read_text(encoding="ascii") for path in Path(f"/proc/{pid}/task").glob("*/children")]
    return [int(child) for child in " ".join(threads).split()]


class Bench:
    """One run."""

    def __init__(self, made: Any, tap: Tap, forwarding: Forwarding, clients: Clients, bare: int) -> None:
        self._rig, self._tap, self._forwarding, self._clients = made, tap, forwarding, clients
        self._ports = {BARE: bare, THREAD: made.port, APART: made.port}
        self._loaded = THREAD
        self._sent = 0.0
        tap.to_vehicle = self._to_vehicle
        self.cases = {name: Case() for name in self._ports}

    def _to_vehicle(self, at: float, frame: bytes) -> None:
        if message_id(frame) == SETPOINT:
            self._sent = at

    def round(self, seconds: float) -> None:
        """Every case once."""
        for name, case in self.cases.items():
            if name in MODULES:
                self._load(name)
                self._rest(case, seconds)
                self._fly(case)
                self._forward(case, seconds)
            for number in case.rates:
                self._clients.begin(self._ports[name], seconds, pollers=number)
                times = self._clients.end()
                case.rates[number].append(len(times) / seconds)
                case.slowest[number].append(percentile(times, 0.99) * 1e3)

    def _load(self, name: str) -> None:
        if name != self._loaded:
            self._rig.mavproxy.ask(f"module unload {MODULES[self._loaded]}", "Unloaded")
            rate = ',"max_rate":100000' if name == THREAD else ""
            self._rig.mavproxy.ask(f'module load {MODULES[name]}:{{"port":{self._rig.port}{rate}}}', "Loaded module")
            self._loaded = name
        harness.eventually(self._is_up, what="the server's start")
        time.sleep(SETTLE)

    def _is_up(self) -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._rig.port), 1):
            return True
        return False

    def _rest(self, case: Case, seconds: float) -> None:
        pids = [self._rig.mavproxy.pid, *children(self._rig.mavproxy.pid)]
        before = sum(map(cpu_seconds, pids))
        time.sleep(2 * seconds)
        case.cpu.append(100 * (sum(map(cpu_seconds, pids)) - before) / (2 * seconds))
        case.memory.append(sum(map(memory, pids)))

    def _fly(self, case: Case) -> None:
        connection = Connection(self._rig.port)
        for number in range(SETPOINTS):
            self._sent = 0.0
            began = connection.send("POST", "/movement/travel_at_ned", {"vx": 0.1 * (number % 2), "vy": 0, "vz": 0})
            status, body = connection.answer()
            assert status == 200, body
            harness.eventually(lambda: self._sent, what="the setpoint")
            case.setpoints.append((self._sent - began) * 1e3)
            time.sleep(PAUSE)
        connection.close()

    def _forward(self, case: Case, seconds: float) -> None:
        self._clients.begin(self._rig.port, seconds + 1, pollers=4)
        time.sleep(0.5)
        start = time.time()
        time.sleep(seconds)
        end = time.time()
        self._clients.end()
        case.delays += [1e3 * delay for delay in self._forwarding.between(start, end)]


def report(cases: dict[str, Case]) -> str:
    """The table; medians over the rounds."""

    def median(values: list[float]) -> float:
        return percentile(values, 0.5)

    bare, rows = cases[BARE], []
    for name, case in cases.items():
        row = [name]
        for number, rates in case.rates.items():
            slowest = median(case.slowest[number])
            row += [f"{median(rates) / median(bare.rates[number]):.2f}", f"{slowest:.2f}"]
        if name in MODULES:
            row += [f"{median(case.setpoints):.2f} / {percentile(case.setpoints, 0.99):.2f}"]
            row += [f"{median(case.delays):.2f} / {percentile(case.delays, 0.99):.2f}"]
            row += [f"{median(case.cpu):.1f} %", f"{median(case.memory):.1f}"]
        rows.append(row + [""] * (9 - len(row)))
    headings = [
        "",
        "1 client : bare",
        "99 %, ms",
        "16 : bare",
        "99 %, ms",
        "setpoint, ms",
        "forwarding, ms",
        "CPU",
        "MB",
    ]
    return table(headings, rows)


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each measurement")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    options = parser.parse_args()
    print(f"apart: {machine()}")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    forwarding, clients, bare = Forwarding(), Clients(), Bare()
    try:
        with rig(outs=(f"udp:127.0.0.1:{forwarding.port}",), streamrate=10, max_rate=100000) as (made, tap):
            forwarding.attach(tap)
            if options.first:
                put_first(*(process.pid for process in made.processes))
            fly(made)
            bench = Bench(made, tap, forwarding, clients, bare.port)
            for _ in range(options.rounds):
                bench.round(options.seconds)
            report_of = report(bench.cases)
    finally:
        clients.close()
        bare.close()
    print(report_of + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
