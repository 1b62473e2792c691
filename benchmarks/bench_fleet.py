"""How many readings a second a station stores, by one to four workers.

Real Mosquitto, real PostgreSQL (a private cluster, fsync on), real workers; the readings are a generator's
(benchmarks/fleet_generator.py), without MAVProxy and spool. Delay is from sampling to the transaction that makes the
row, by this machine's one clock; a commit takes what the column beside it says. Everything runs on this machine, so
CPU is counted by program: 100 % is one core.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

import psutil
from figures import machine, table
from rig import ROOT, harness

from tests.support.fleet import MOSQUITTO, Fleet
from tests.support.postgres import program

WARM_UP = 3.0  # s that do not count
TIMEOUT = 60.0  # s for the backlog
DELAYS = """
SELECT count(*), percentile_disc(0.5) WITHIN GROUP (ORDER BY received - time), percentile_disc(0.99) WITHIN GROUP
    (ORDER BY received - time) FROM (SELECT extract(epoch FROM received) AS received, extract(epoch FROM time) AS time
        FROM readings) AS moments WHERE time >= {0} AND time < {1}
"""


class Usage:
    """CPU and memory of a program with all its children."""

    def __init__(self, *pids: int) -> None:
        self._pids = pids

    def _all(self) -> list[psutil.Process]:
        roots = [psutil.Process(pid) for pid in self._pids]
        return [one for root in roots for one in (root, *root.children(recursive=True))]

    def cpu(self) -> float:
        """s of all cores so far."""
        return sum(sum(one.cpu_times()[:4]) for one in self._all())

    def memory(self) -> float:
        """MB resident, of the root processes."""
        return sum(psutil.Process(pid).memory_info().rss for pid in self._pids) / 1e6


def measure(rate: float, workers: int, options: argparse.Namespace) -> list[str]:
    """One row of the table."""
    with tempfile.TemporaryDirectory(prefix="uavapi-fleet-") as name:
        fleet = Fleet(Path(name), workers)
        try:
            fleet.start()
            return loaded(fleet, Path(name), rate, options)
        finally:
            fleet.stop()


def loaded(fleet: Fleet, directory: Path, rate: float, options: argparse.Namespace) -> list[str]:
    """A row, with everything running."""
    usages = {
        "workers": Usage(*(worker.pid for worker in fleet.workers)),
        "broker": Usage(fleet.broker.pid),
        "database": Usage(fleet.database.pid),
    }
    command = [sys.executable, str(ROOT / "benchmarks" / "fleet_generator.py"), str(fleet.broker.port)]
    command += [f"--vehicles={options.vehicles}", f"--rate={rate}", f"--seconds={options.seconds + WARM_UP}"]
    generator = harness.Process([*command, *["--reply"] * options.reply], directory / "generator.log", directory)
    usages["generator"] = Usage(generator.pid)
    time.sleep(WARM_UP)
    began, cpu = time.time(), {name: usage.cpu() for name, usage in usages.items()}
    time.sleep(options.seconds - 1.0)
    ended = time.time()
    used = {name: (usage.cpu() - cpu[name]) / (ended - began) for name, usage in usages.items()}
    memory = max(Usage(worker.pid).memory() for worker in fleet.workers)
    stored = int(fleet.database.sql("SELECT sum(stored) FROM workers"))
    generator.says("acknowledged", timeout=TIMEOUT)
    report = json.loads(generator.output().splitlines()[-1])
    generator.stop()
    missing = still_missing(fleet, report["sent"])
    count, p50, p99 = fleet.database.sql(DELAYS.format(began, ended)).split("|")
    metrics = [worker.metrics() for worker in fleet.workers]
    commits = sum(one["station_commit_seconds_sum"] for one in metrics)
    batches = sum(one["station_batches_total"] for one in metrics)
    backlog = max(0, round((ended - began + WARM_UP) * rate * options.vehicles) - stored)
    delays = [f"{float(p50) * 1e3:.0f}", f"{float(p99) * 1e3:.0f}", f"{commits / batches * 1e3:.0f}"]
    shares = [f"{100 * used[name]:.0f} %" for name in ("workers", "broker", "database", "generator")]
    per_second = [f"{options.vehicles * rate:.0f}", f"{int(count) / (ended - began):.0f}"]
    return [
        str(len(fleet.workers)),
        *per_second,
        *delays,
        str(backlog),
        *shares,
        f"{memory:.0f}",
        f"{report['late']:.2f}",
        str(missing),
    ]


def still_missing(fleet: Fleet, sent: int) -> int:
    """How many readings are no row yet when nothing more has come for a while."""
    stored, deadline = -1, time.monotonic() + TIMEOUT
    while stored < sent and time.monotonic() < deadline:
        time.sleep(0.5)
        stored = int(fleet.database.sql("SELECT sum(stored) FROM workers") or 0)
    return sent - stored


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=1000, help="(%(default)s)")
    parser.add_argument("--rates", type=float, nargs="+", default=[1.0, 10.0], help="readings/s of each")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 3, 4], help="how many")
    parser.add_argument("--seconds", type=float, default=15.0, help="of each case (%(default)g)")
    parser.add_argument("--reply", action="store_true", help="vehicles want the station's word (#ack=station)")
    options = parser.parse_args()
    print(f"fleet: {machine()}")
    if MOSQUITTO is None or shutil.which(program("initdb")) is None:
        print("fleet: Mosquitto or PostgreSQL is not installed (apt-get install mosquitto postgresql)")
        return 0
    rows = [measure(rate, workers, options) for rate in options.rates for workers in options.workers]
    headings = ["workers", "sampled/s", "stored/s", "p50 ms", "p99 ms", "commit ms", "backlog"]
    headings += ["workers CPU", "broker", "database", "generator", "MB a worker", "generator late s", "missing"]
    print(f"{options.vehicles} vehicles, {options.seconds:g} s each")
    print(table(headings, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
