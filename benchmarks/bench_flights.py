"""What the record of a flight costs, how large it is, and what a kill leaves of it.

Ten vehicles of 50 messages a second each are recorded as fast as it goes, in this process; the yardstick in the same
run is `json.dumps` of the same events. Then a process that records in real time is killed at random moments.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from figures import machine, percentile, put_first, table

put_first()

from mavproxy_uavapi.flights.flight_file import FlightFile, messages_of, pack  # noqa: E402
from mavproxy_uavapi.flights.recorder import QUEUED  # noqa: E402
from mavproxy_uavapi.flights.topics import Topics  # noqa: E402
from mavproxy_uavapi.http.stream.stream_event import When, of_info  # noqa: E402
from mavproxy_uavapi.http.stream.subscription import NamePatterns, Subscription, Wishes  # noqa: E402

VEHICLES, RATE, PERIOD = 10, 50, 0.5  # RATE: messages/s of a vehicle; PERIOD: s from one write to the next
ABOUT = {"name": "benchmark"}


def events(at: float, seconds: float) -> Iterator[Any]:
    """What so many seconds bring: a fifth each of positions, attitudes, places, speeds and batteries."""
    for number in range(round(seconds * RATE)):
        when = When(at + number / RATE, number / RATE)
        for system in range(1, VEHICLES + 1):
            place = {"lat": -35.36 + number * 1e-7, "lon": 149.16 + system * 1e-5, "alt": 594.2, "relative_alt": 10.4}
            speed = {"vx": 1.23, "vy": -0.4, "vz": 0.02}
            view, info = (
                ("gps", {"position": place, "velocity": speed, "heading": 91.2}),
                ("attitude", {"roll": 1.5, "pitch": -2.25, "yaw": number % 360, "rollspeed": 0.1, "pitchspeed": 0.2}),
                ("ned", {"position": {"x": number * 0.1, "y": system, "z": -10.4}, "velocity": speed}),
                ("general", {"airspeed": 5.1, "groundspeed": 5.0, "heading": 91, "throttle": 34, "alt": 594.2}),
                ("battery", {"voltage": 12_100, "current": 1_520, "battery_remaining": 80}),
            )[number % 5]
            yield of_info("view", view, system, when, info)


def record(path: Path, seconds: float, *, in_real_time: bool = False) -> float:
    """Record so many seconds; returns the processor time that it took (s)."""
    file, topics, used = FlightFile(path), Topics(), 0.0
    subscription = Subscription(Wishes(view=NamePatterns("*"), rate=10.0), queued=QUEUED, keeps_all=True)
    first = time.time()
    for turn in range(round(seconds / PERIOD)):
        began = time.time()
        arriving, processor = list(events(first + (turn - 1) * PERIOD, PERIOD)), time.process_time()
        for event in arriving:
            subscription.offer(event, event.at.time)
        file.write([message for event in subscription.take() for message in topics.records(event)])
        used += time.process_time() - processor
        if in_real_time:
            time.sleep(max(PERIOD - (time.time() - began), 0.0))
    file.close(ABOUT)
    return used


def killed(folder: Path, chance: random.Random) -> tuple[float, int]:
    """Kill a process that records; the age of the newest message that is left (s), and how many are."""
    path = folder / f"{time.monotonic_ns()}.journal"
    child = multiprocessing.get_context("fork").Process(
        target=record, args=(path, 60.0), kwargs={"in_real_time": True}
    )
    child.start()
    while not path.exists() or path.stat().st_size < 10_000:
        time.sleep(0.01)
    time.sleep(chance.uniform(0.0, 1.5))
    at = time.time()
    child.kill()
    child.join()
    times = [message.time for message in messages_of(path)]
    whole = pack(path, path.with_suffix(".mcap"), ABOUT)
    assert whole == len(times), "the packed file has what the journal has"
    path.unlink()
    return at - max(times), whole


def peak() -> float:
    """The most memory that this process has had, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=120.0, help="of the flight")
    parser.add_argument("--kills", type=int, default=200)
    arguments = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        journal, packed = folder / "it.journal", folder / "it.mcap"
        used, memory = record(journal, arguments.seconds), [peak()]
        began = time.process_time()
        for event in events(0.0, arguments.seconds):
            json.dumps(event.info)
        yardstick = time.process_time() - began
        began = time.process_time()
        messages = pack(journal, packed, ABOUT)
        packing = time.process_time() - began
        memory.append(peak())
        sizes = [path.stat().st_size / arguments.seconds * 3600 / 1e6 for path in (journal, packed)]
        print(
            table(
                ["", "ten vehicles, 50 messages/s each"],
                [
                    [
                        "processor time",
                        f"{used / arguments.seconds:.2%} of a core, {used / yardstick:.1f} × json.dumps",
                    ],
                    ["memory of this process at most", f"{memory[0]:.0f} MB, {memory[1]:.0f} MB with packing"],
                    ["messages of the file", f"{messages / arguments.seconds:.0f}/s"],
                    ["an hour, as it is written", f"{sizes[0]:.0f} MB"],
                    ["an hour, packed", f"{sizes[1]:.0f} MB, {packing / arguments.seconds * 3600:.0f} s to pack"],
                ],
            )
        )
        chance = random.Random(1)
        left = [killed(folder, chance) for _ in range(arguments.kills)]
        ages = sorted(age for age, _ in left)
        if ages:
            print(
                f"{len(ages)} kills: every file read to its last whole record; the newest message was at most "
                f"{ages[-1]:.2f} s old, {percentile(ages, 0.5):.2f} s in the middle"
            )


if __name__ == "__main__":
    main()
