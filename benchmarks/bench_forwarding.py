"""What the API adds to MAVProxy's own forwarding, from the vehicle's link to an `--out`.

Four cases take turns in one run, so that a noisy machine is noisy for all of them: MAVProxy without our module,
with the module idle, with clients that do their worst, and with the same clients at another server on the same
machine (what the machine's being busy costs, without anything of ours in MAVProxy).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import Any

from figures import cpu_seconds, jitter, machine, percentile, put_first, table
from http_clients import Bare, Clients
from rig import fly, rig
from tap import Forwarding

BUDGET = 10.0  # ms at the 99th percentile
NONE, IDLE, LOAD, ELSEWHERE = "without uavapi", "uavapi idle", "uavapi under load", "load elsewhere"
CASES = (NONE, IDLE, LOAD, ELSEWHERE)
SETTLE = 0.7  # s after a change before it counts
LOAD_SHAPE = {"pollers": 4, "waiting": 50, "streams": 1}


class Case:
    """What was measured of one case, over all rounds."""

    def __init__(self) -> None:
        self.rounds: list[list[float]] = []  # delays (s) of each
        self.cpu = self.wall = 0.0
        self.reads = self.lost = 0

    def typical(self, number: Callable[[list[float]], float]) -> float:
        """The median over the rounds of a number of each round's delays, in ms: a burst spoils one round only."""
        return percentile([number(delays) * 1e3 for delays in self.rounds], 0.5)

    @property
    def p50(self) -> float:
        """Half of the messages are faster (ms)."""
        return self.typical(lambda delays: percentile(delays, 0.5))

    @property
    def p99(self) -> float:
        """One in a hundred messages is slower (ms)."""
        return self.typical(lambda delays: percentile(delays, 0.99))


class Bench:
    """One run: the rig and its four cases."""

    def __init__(
        self, made: Any, forwarding: Forwarding, clients: Clients, bare: Bare, options: argparse.Namespace
    ) -> None:
        self._rig, self._forwarding, self._clients, self._bare = made, forwarding, clients, bare
        self._seconds, self._rate = options.seconds, options.rate
        self._loaded = True
        self.cases = {name: Case() for name in CASES}

    def round(self) -> None:
        """Every case once."""
        for name in CASES:
            self._load_module(name != NONE)
            if name == LOAD:
                self._clients.begin(self._rig.port, self._seconds + SETTLE, **LOAD_SHAPE)
            elif name == ELSEWHERE:
                self._clients.begin(self._bare.port, self._seconds + SETTLE, pollers=LOAD_SHAPE["pollers"])
            time.sleep(SETTLE)
            self._measure(self.cases[name])
            if name in (LOAD, ELSEWHERE):
                self.cases[name].reads += len(self._clients.end())

    def _load_module(self, expected: bool) -> None:
        if expected and not self._loaded:
            settings = f'{{"port":{self._rig.port},"max_rate":{self._rate}}}'
            self._rig.mavproxy.ask(f"module load uavapi:{settings}", "listening on")
            self._rig.wait_until_up()
        elif self._loaded and not expected:
            self._rig.mavproxy.ask("module unload uavapi", "Unloaded")
        self._loaded = expected

    def _measure(self, case: Case) -> None:
        pid = self._rig.mavproxy.pid
        cpu, start = cpu_seconds(pid), time.time()
        time.sleep(self._seconds)
        end = time.time()
        case.cpu += cpu_seconds(pid) - cpu
        case.wall += end - start
        time.sleep(0.2)  # for what is on its way
        delays = self._forwarding.between(start, end)
        case.rounds.append(delays)
        case.lost += self._forwarding.lost(start, end)


def report(cases: dict[str, Case]) -> str:
    """The table."""
    none = cases[NONE]
    rows = []
    for name, case in cases.items():
        rows.append(
            [
                name,
                str(sum(map(len, case.rounds))),
                str(case.lost),
                f"{case.p50:.2f}",
                f"{case.p99:.2f}",
                f"{case.typical(max):.1f}",
                f"{case.typical(jitter):.2f}",
                "" if case is none else f"{case.p50 - none.p50:+.2f}",
                "" if case is none else f"{case.p99 - none.p99:+.2f}",
                f"{100 * case.cpu / case.wall:.0f} %",
                f"{case.reads / case.wall:.0f}" if case.reads else "",
            ]
        )
    headings = ["delay in ms", "messages", "lost", "median", "p99", "max", "jitter"]
    headings += ["median added", "p99 added", "MAVProxy", "reads/s"]
    return table(headings, rows)


def main() -> int:
    """Run, print, and say whether the budget was kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each case in each round")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--rate", type=int, default=500, help="max_rate; 100000 lifts the limit")
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    parser.add_argument("--strict", action="store_true", help="fail when the budget is not kept")
    options = parser.parse_args()
    print(f"forwarding: {machine()}")
    forwarding, clients, bare = Forwarding(), Clients(), Bare()
    try:
        outs = (f"udp:127.0.0.1:{forwarding.port}",)
        with rig(outs=outs, streamrate=10, max_rate=options.rate) as (made, tap):
            forwarding.attach(tap)
            if options.first:
                put_first(*(process.pid for process in made.processes))
            fly(made)
            bench = Bench(made, forwarding, clients, bare, options)
            for _ in range(options.rounds):
                bench.round()
    finally:
        clients.close()
        bare.close()
    print(report(bench.cases))
    added = bench.cases[LOAD].p99 - bench.cases[NONE].p99
    kept = added <= BUDGET
    verdict = "kept" if kept else "not kept, or the machine was too busy to tell (see `load elsewhere`)"
    print(f"budget of {BUDGET:g} ms added at the 99th percentile: {verdict}\n")
    return 1 if options.strict and not kept else 0


if __name__ == "__main__":
    sys.exit(main())
