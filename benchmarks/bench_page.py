"""The page at / with a fleet in flight, in headless Chromium: does it stutter, does it leak?

    python benchmarks/bench_page.py [--vehicles 10] [--seconds 20] [--minutes 0] [--pictures docs/pictures]

Embedded vehicles at speed 1 and one MAVProxy; each vehicle flies around its own place. requestAnimationFrame tells
when a frame is drawn: at 60 Hz one is due every 16.7 ms. `busy` is the processor time of the page's main thread;
other programs do not lengthen it: below 100 % the page itself can keep 60 Hz.

The heap is what V8 uses after a forced garbage collection.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import math
import sys
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from bench_station_page import FRAMES
from figures import machine, percentile, table
from rig import harness

from tests.support.chromium import Page, chromium
from tests.support.several_vehicles import several_vehicles

ALT = 20.0  # m
RING, OWN = 60.0, 18.0  # m from home to the middle of a vehicle's flight, and from there to its corners
TRIES = 6
LEG = 6.0  # s from one corner to the next
LIVE = "document.querySelector('connection-state').innerText.trim() === 'live' "
LIVE += "&& Boolean(document.querySelector('tab-bar').context)"
SHAKE = """{const view = document.querySelector('top-view');
setInterval(() => view.zoom(1 + 0.02 * Math.sin(Date.now() / 300)), 16)}"""
THEME = """{document.querySelector('page-preferences').context.preferences.set('theme', '%s');
document.querySelector('top-view').camera.fit()}"""
PICTURES = {
    "light": ("light", 1440, 900),
    "dark": ("dark", 1440, 900),
    "phone": ("light", 390, 844),
}
MEGABYTE = 1e6


def corner(number: int, count: int, turn: int) -> tuple[float, float]:
    """Metres north and east of home: corner `turn` of the square that a vehicle flies."""
    around, own = 2 * math.pi * number / count, math.pi / 2 * turn + number
    return RING * math.cos(around) + OWN * math.cos(own), RING * math.sin(around) + OWN * math.sin(own)


def lift(rig: Any, number: int) -> None:
    """Bring a vehicle into the air; on a busy machine its link may be lost meanwhile."""
    for _ in range(TRIES):
        rig.post(f"/vehicles/{number}/command/arm")
        answer = rig.post(f"/vehicles/{number}/command/takeoff", alt=ALT)
        if answer.status_code == 200 or "flying already" in answer.text:  # the try before had no answer in time
            return
    raise AssertionError(answer.text)


@contextlib.contextmanager
def flying(rig: Any, count: int) -> Iterator[None]:
    """All vehicles in the air, each on its square."""
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(lambda number: lift(rig, number), range(1, count + 1)))
    over = threading.Event()

    def lead() -> None:
        for turn in range(1_000_000):
            for number in range(count):
                north, east = corner(number, count, turn)
                target = {"x": north, "y": east, "z": -ALT - number}
                rig.post(f"/vehicles/{number + 1}/movement/go_to_ned", **target)
            if over.wait(LEG):
                return

    leader = threading.Thread(target=lead)
    leader.start()
    try:
        yield
    finally:
        over.set()
        leader.join()


async def frames(page: Page, name: str, seconds: float) -> list[str]:
    """One row: the frames of so many seconds."""
    before = await busy(page)
    times, tasks = json.loads(await page.evaluate(FRAMES % round(1000 * seconds)))
    share = 100 * (await busy(page) - before) / seconds
    gaps = [later - sooner for sooner, later in zip(times, times[1:], strict=False)]
    rate = 1000 * len(gaps) / (times[-1] - times[0])
    numbers = [percentile(gaps, 0.5), percentile(gaps, 0.99), max(gaps), max(tasks, default=0.0)]
    return [name, f"{rate:.1f}", *(f"{number:.0f}" for number in numbers), str(len(tasks)), f"{share:.0f} %"]


async def busy(page: Page) -> float:
    """Processor time of the page's main thread in s, since some moment."""
    metrics = (await page.ask("Performance.getMetrics"))["metrics"]
    return next(float(one["value"]) for one in metrics if one["name"] == "TaskDuration")


async def heap(page: Page) -> float:
    """MB in use after a garbage collection."""
    await page.ask("HeapProfiler.collectGarbage")
    return float((await page.ask("Runtime.getHeapUsage"))["usedSize"]) / MEGABYTE


async def leak(page: Page, minutes: int) -> list[list[str]]:
    """The heap and the number of the document's nodes, each minute."""
    rows = []
    for minute in range(minutes + 1):
        nodes = await page.evaluate("document.querySelectorAll('*').length")
        rows.append([str(minute), f"{await heap(page):.2f}", str(nodes)])
        if minute < minutes:
            await asyncio.sleep(60)
    return rows


async def take_pictures(page: Page, folder: Path, beginning: str) -> None:
    """The page with its fleet, in both themes and on a phone; `beginning` is that of the files' names."""
    for name, (theme, width, height) in PICTURES.items():
        await page.resize(width, height)
        await page.evaluate(THEME % theme)
        await asyncio.sleep(3)  # the camera comes to rest
        picture = await page.picture()
        await asyncio.to_thread((folder / f"{beginning}-{name}.png").write_bytes, picture)


async def look(rig: Any, directory: Path, options: argparse.Namespace) -> None:
    """Open the page and measure."""
    async with chromium(directory) as page:
        await page.visit(f"{rig.url}/")
        await page.ask("Performance.enable", timeDomain="threadTicks")
        await page.until(LIVE)
        await page.until(f"document.querySelectorAll('.chip b').length === {options.vehicles}")
        rows = [await frames(page, "looking", options.seconds)]
        if options.pictures:
            await take_pictures(page, options.pictures, "fleet")
            await page.resize(1440, 900)
        if options.minutes:
            print(table(["minute", "heap MB", "nodes"], await leak(page, options.minutes)), flush=True)
        await page.evaluate(SHAKE)
        rows.append(await frames(page, "zooming", options.seconds))
        headings = [
            f"{options.vehicles} vehicles",
            "frames/s",
            "median ms",
            "p99 ms",
            "longest ms",
            "longest task ms",
        ]
        print(table([*headings, "tasks > 50 ms", "busy"], rows))


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=10, help="(%(default)s)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each look (%(default)g)")
    parser.add_argument("--minutes", type=int, default=0, help="to watch the heap (%(default)s)")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the fleet")
    options = parser.parse_args()
    print(f"page: {machine()}", flush=True)
    systems = range(1, options.vehicles + 1)
    with (
        tempfile.TemporaryDirectory(prefix="uavapi-bench-") as folder,
        several_vehicles(Path(folder), systems, speedup=1, arguments=["--streamrate=4"]) as (rig, _),
    ):
        harness.eventually(lambda: all(one["ready_to_arm"] for one in rig.ok(rig.get("/vehicles"))["vehicles"]))
        with flying(rig, options.vehicles):
            asyncio.run(look(rig, rig.directory, options))
    return 0


if __name__ == "__main__":
    sys.exit(main())
