"""How far apart a fleet's vehicles hear one verb, and what a heavy client of one vehicle costs another's stop.

    python benchmarks/bench_fleet_verbs.py [--vehicles 10] [--tries 20]

Embedded vehicles at speed 1, one MAVProxy. The spread is from the first vehicle's DO_SET_MODE to the last one's, as
each vehicle's process takes it from its socket.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import requests

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for `tests.support`
os.environ.setdefault("PYTEST_XDIST_WORKER", f"gw{10 + os.getpid() % 15}")  # ports of our own

from tests.support import processes as harness  # noqa: E402

DO_SET_MODE = 176
MODES = ("brake", "guided")  # by turns, so that each try changes the mode
READERS = 4


@contextlib.contextmanager
def fleet(count: int) -> Iterator[tuple[Any, list[Any]]]:
    """A MAVProxy with so many vehicles, and each vehicle's back door."""
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as directory:
        rig, masters = harness.Rig(Path(directory), harness.free_port()), []
        vehicles: list[Any] = []
        try:
            for number in range(1, count + 1):
                folder = Path(directory, str(number))
                folder.mkdir()
                vehicles.append(harness.Rig(folder, 0))
                instance = harness.start_embedded(vehicles[-1], f"--sysid={number}", speedup=1)
                masters.append(f"--master=tcp:127.0.0.1:{5760 + 10 * instance}")
            rig.mavproxy = rig.start("mavproxy", [*harness.MAVPROXY, *masters, harness.load(rig.port)])
            rig.wait_until_up()
            harness.eventually(lambda: len(rig.ok(rig.get("/vehicles"))["vehicles"]) == count, what="all vehicles")
            time.sleep(8)  # their estimators settle
            yield rig, [vehicle.control for vehicle in vehicles]
        finally:
            for made in (rig, *vehicles):
                made.stop()


def heard_at(control: Any, since: int) -> float:
    """Wall time at which the vehicle took its DO_SET_MODE from the socket, s."""
    messages = control.ask("received", since=since)["messages"]
    return next(float(m["wall"]) for m in messages if m["fields"].get("command") == DO_SET_MODE)


def spreads(rig: Any, controls: list[Any], tries: int) -> list[float]:
    """ms from the first vehicle to the last, for each try."""
    found = []
    for number in range(tries):
        marks = [control.ask("received", since=0)["last"] for control in controls]
        rig.ok(requests.post(f"{rig.url}/fleet/{MODES[number % 2]}", json={}, timeout=30))
        times = [heard_at(control, mark) for control, mark in zip(controls, marks, strict=True)]
        found.append(1000 * (max(times) - min(times)))
    return found


def latencies(rig: Any, control: Any, tries: int) -> list[float]:
    """ms from a request to brake vehicle 2 to its socket, for each try."""
    found = []
    with requests.Session() as session:
        for number in range(tries):
            mark, requested = control.ask("received", since=0)["last"], time.time()
            session.get(f"{rig.url}/vehicles/2/command/{MODES[number % 2]}", timeout=30)
            found.append(1000 * (heard_at(control, mark) - requested))
    return found


@contextlib.contextmanager
def heavy_client(rig: Any) -> Iterator[None]:
    """Readers of vehicle 1 without a pause, and a stream of everything of it."""
    ended = threading.Event()

    def read() -> None:
        with requests.Session() as session:
            while not ended.is_set():
                session.get(f"{rig.url}/vehicles/1/telemetry/gps", timeout=30)

    threads = [threading.Thread(target=read) for _ in range(READERS)]
    with requests.get(f"{rig.url}/vehicles/1/telemetry/stream", stream=True, timeout=30):
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            ended.set()
            for thread in threads:
                thread.join()


def row(name: str, values: list[float]) -> str:
    """Median, 99th percentile and maximum."""
    ordered = sorted(values)
    high = ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]
    return f"{name:44}{statistics.median(ordered):8.1f}{high:8.1f}{ordered[-1]:8.1f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--tries", type=int, default=20)
    chosen = parser.parse_args()
    with fleet(chosen.vehicles) as (rig, controls):
        print(f"{'ms':44}{'50 %':>8}{'99 %':>8}{'most':>8}")
        print(row(f"{chosen.vehicles} vehicles, first to last", spreads(rig, controls, chosen.tries)))
        print(row("brake of vehicle 2 on the wire, alone", latencies(rig, controls[1], chosen.tries)))
        with heavy_client(rig):
            print(row("the same, vehicle 1 with a heavy client", latencies(rig, controls[1], chosen.tries)))


if __name__ == "__main__":
    main()
