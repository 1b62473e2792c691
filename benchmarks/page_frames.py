"""What many vehicles cost the page itself: its frames, and the time of its own scripts in each drawing.

    python benchmarks/page_frames.py [--vehicles 30] [--points 3000] [--seconds 12] [--profile]

The API is played, so that no vehicles take the machine's processor time; each vehicle circles, and has flown a trail
before. `drawing` is the time of the page's scripts in each drawing, of which there are fewer than frames; `busy` the
processor time of the page's main thread.
"""

from __future__ import annotations

import argparse
import asyncio
import collections
import math
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from bench_page import SHAKE, frames, heap
from figures import machine, table

from tests.support.chromium import Page, chromium
from tests.support.page_pilot import Pilot
from tests.support.played_api import HOME, METRES_PER_DEGREE, SHRUNK, PlayedApi, played_api, vehicle

FLEET = "document.querySelector('top-view').context.fleet"
FLOWN = """for (const one of %s.all) {
  const [lat, lon] = one.trail.at(-1), part = n => 4e-4 * n / %d;
  one.trail = [];
  for (let n = 0; n < %d; n += 1) {
    one.moved({position: {lat: lat + part(n) * Math.sin(n / 30), lon: lon + part(n) * Math.cos(n / 30)}});
    for (const key of ['alt', 'speed', 'climb', 'roll', 'charge', 'volts']) {
      one.curves.add(key, performance.now() - 6e5 + n * 200, 10 + Math.sin(n / 50)); } } }"""
PLOTS = f"{{{FLEET}.chooseAll(); for (const _ of [3, 4, 5, 6]) document.querySelector('plot-shelf').adder.click(); }}"
TIMED = """{window.drawings = []; const {painter} = document.querySelector('top-view').context;
  const {paint} = painter;
  painter.paint = at => {
    const began = performance.now(); paint(at); drawings.push(performance.now() - began); }; }"""
TOLD = """(() => { const all = drawings.sort((a, b) => a - b); window.drawings = [];
  return [all.length, all[all.length >> 1], all[Math.floor(all.length * 0.99)], all.at(-1)]; })()"""
HEADINGS = ["frames/s", "median ms", "p99 ms", "longest ms", "longest task ms", "tasks > 50 ms", "busy"]
OURS = ["drawings", "median ms", "p99 ms", "longest ms"]
RING, OWN = 90.0, 18.0  # m from home to the middle of a vehicle's circle, and its radius


def fly(api: PlayedApi) -> None:
    """Move the vehicles until it is over."""
    while not api.over:
        now, count = time.time(), len(api.vehicles)
        for number, views in api.vehicles.items():
            place, own = 2 * math.pi * number / count, now / 5 + number
            north, east = RING * math.sin(place) + OWN * math.sin(own), RING * math.cos(place) + OWN * math.cos(own)
            lat, lon = HOME[0] + north / METRES_PER_DEGREE, HOME[1] + east / METRES_PER_DEGREE / SHRUNK
            views["gps"]["position"].update(lat=lat, lon=lon, relative_alt=12 + number + 2 * math.sin(now / 7))
            views["general"]["groundspeed"] = 2.5 + math.sin(now / 9 + number)
        time.sleep(0.1)


async def row(page: Page, name: str, seconds: float) -> list[str]:
    """The frames of so many seconds, and what our own scripts took of them."""
    await page.evaluate(TOLD)
    found = await frames(page, name, seconds)
    count, *times = await page.evaluate(TOLD)
    return [*found, str(count), *(f"{one:.1f}" for one in times)]


async def profile(page: Page, seconds: float) -> list[list[str]]:
    """Where the main thread is, in %: by function, the idle time and the browser's own code too."""
    await page.ask("Profiler.enable")
    await page.ask("Profiler.start")
    await asyncio.sleep(seconds)
    told = (await page.ask("Profiler.stop"))["profile"]
    calls = {node["id"]: node["callFrame"] for node in told["nodes"]}
    spent: collections.Counter[str] = collections.Counter()
    for sample, elapsed in zip(told["samples"], told["timeDeltas"], strict=True):
        file = calls[sample]["url"].rpartition("/page/")[2]
        spent[f"{calls[sample]['functionName']} {file}"] += elapsed
    total = sum(told["timeDeltas"])
    return [[name, f"{100 * time / total:.1f}"] for name, time in spent.most_common(12)]


async def look(options: argparse.Namespace, directory: Path) -> None:
    """Open the page and measure."""
    fleet: dict[int, dict[str, dict[str, Any]]] = {n: vehicle(n) for n in range(1, options.vehicles + 1)}
    with played_api(fleet) as api:
        threading.Thread(target=fly, args=(api,), daemon=True).start()
        async with chromium(directory) as page:
            await page.visit(f"{api.address}/")
            await page.ask("Performance.enable", timeDomain="threadTicks")
            await Pilot(page, None).sees_live()
            await page.until(f"{FLEET}.all.filter(one => one.trail.length).length === {options.vehicles}")
            await page.evaluate(FLOWN % (FLEET, options.points, options.points))
            await page.evaluate(TIMED)
            rows = []
            for name, act in (("looking", "0"), ("zooming", SHAKE), ("all in six plots", PLOTS)):
                await page.evaluate(act)
                rows.append(await row(page, name, options.seconds))
            print(table([f"{options.vehicles} vehicles", *HEADINGS, *OURS], rows))
            print(f"heap {await heap(page):.1f} MB; complaints {page.complaints}")
            if options.profile:
                print(table(["function", "% of the time"], await profile(page, options.seconds)))


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=30, help="(%(default)s)")
    parser.add_argument("--points", type=int, default=3000, help="places that each has flown through (%(default)s)")
    parser.add_argument("--seconds", type=float, default=12.0, help="of each look (%(default)g)")
    parser.add_argument("--profile", action="store_true", help="say where the time goes")
    options = parser.parse_args()
    print(f"page: {machine()}", flush=True)
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as folder:
        asyncio.run(look(options, Path(folder)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
