"""How quickly the page shows another moment of an hour's record of ten vehicles, and what that costs MAVProxy.

    python benchmarks/bench_replay.py [--minutes 60] [--seeks 40]

The record is that of `bench_flights.py`. Chromium opens its replay and jumps to random moments, each from the hand to
the first number shown; the yardstick in the same run is reading the same span from the file in this process. Then it
plays a minute of ours at 1, 5 and 50 times.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from bench_flights import PERIOD, events
from figures import cpu_seconds, machine, percentile, table
from rig import rig

from mavproxy_uavapi.flights.flight_reader import events_of, overview_of
from mavproxy_uavapi.flights.flight_store import ENDED, Flight, FlightStore
from mavproxy_uavapi.flights.topics import Topics
from tests.support.chromium import chromium

BEGAN = 1_778_500_800.0  # s since 1970
LOOK_BACK = 3.0  # s, as the page's own
PLAYED = 20.0  # s of ours at each speed
READY = "document.querySelector('replay-bar')?.context.replay.overview.seconds > 1"
SEEK = """(async () => {
  const {replay, fleet} = document.querySelector('replay-bar').context, began = performance.now();
  replay.jump(%f);
  const shown = () => [...fleet.vehicles.values()].every(one => Math.abs(one.views.gps.at / 1000 - %f) < 1);
  while (!shown()) await new Promise(resolve => setTimeout(resolve, 1));
  return performance.now() - began;
})()"""


def hour(folder: Path, minutes: float) -> Flight:
    """A complete flight of so many minutes."""
    store, topics = FlightStore(folder), Topics()
    flight, file = store.begin(range(1, 11), BEGAN, "an hour")
    for step in range(round(minutes * 60 / PERIOD)):
        told = events(BEGAN + step * PERIOD, PERIOD)
        file.write([message for event in told for message in topics.records(event)])
    flight = replace(flight, ended="2026-05-11T13:00:00+00:00", state=ENDED)
    file.close(flight.about())
    store.save(flight)
    return store.pack(flight.id)


async def look(
    made: Any, directory: Path, flight: Flight, moments: list[float]
) -> tuple[list[float], list[list[str]]]:
    """Seek and play; ms of each seek, and a row for each speed."""
    rows = []
    async with chromium(directory) as page:
        await page.visit(f"{made.url}/#replay={flight.id}")
        await page.until(READY)
        seeks = [await page.evaluate(SEEK % (moment, moment)) for moment in moments]
        for speed in (1, 5, 50):
            await page.evaluate(f"document.querySelector('replay-bar').context.replay.hurry({speed})")
            await page.evaluate("document.querySelector('replay-bar').context.replay.jump(60)")
            used, began = cpu_seconds(made.mavproxy.pid), time.monotonic()
            await page.evaluate("document.querySelector('replay-bar').context.replay.play()")
            await asyncio.sleep(PLAYED)
            share = (cpu_seconds(made.mavproxy.pid) - used) / (time.monotonic() - began)
            reached = await page.evaluate("document.querySelector('replay-bar').context.replay.time - 60")
            rows.append([f"{speed} x", f"{100 * share:.1f} %", f"{reached / PLAYED:.1f} x"])
    return seeks, rows


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0, help="of the record (%(default)g)")
    parser.add_argument("--seeks", type=int, default=40, help="(%(default)d)")
    options = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory(prefix="uavapi-replay-") as name:
        began = time.monotonic()
        flight = hour(Path(name), options.minutes)
        path = FlightStore(Path(name)).file(flight)
        print(f"{flight.messages} messages, {flight.bytes / 1e6:.1f} MB, made in {time.monotonic() - began:.0f} s")
        print(f"overview: {len(overview_of(path)) / 1e3:.0f} kB")
        chance = random.Random(1)
        moments = [chance.uniform(5.0, options.minutes * 60 - 5.0) for _ in range(options.seeks)]
        read = []
        for moment in moments:
            began = time.perf_counter()
            json.loads(events_of(path, moment - LOOK_BACK, LOOK_BACK + 0.1))
            read.append(1000 * (time.perf_counter() - began))
        with rig(flights=name) as (made, _):
            seeks, rows = asyncio.run(look(made, Path(name), flight, moments))
    told = [
        [what, *(f"{percentile(values, share):.0f}" for share in (0.5, 0.95, 1.0))]
        for what, values in (("shown in Chromium", seeks), ("read from the file", read))
    ]
    print(table(["ms", "median", "95 %", "most"], told))
    print(table(["speed", "processor of MAVProxy", "reached"], rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
