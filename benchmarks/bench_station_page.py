"""The station's page with a large fleet in Chromium: does it stutter?

A station with SQLite is told of `--vehicles` vehicles, each with five quantities, once a second. Headless Chromium
shows the page. The distances between its frames say whether it stutters: at 60 Hz a frame is due every 16.7 ms. The
page's CPU is that of its main thread, which other load on the machine does not change.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

import aiohttp
from figures import cpu_seconds, machine, percentile, table
from rig import ROOT, harness

from tests.support.chromium import Page, chromium
from tests.support.fleet_vehicles import flight
from tests.support.ports import free_port

FRAMES = """
new Promise(done => {
  const times = [], tasks = [], end = performance.now() + %d;
  new PerformanceObserver(list => tasks.push(...list.getEntries().map(entry => entry.duration)))
    .observe({entryTypes: ["longtask"]});
  const frame = at => {
    times.push(at);
    if (at < end) requestAnimationFrame(frame); else done(JSON.stringify([times, tasks]));
  };
  requestAnimationFrame(frame);
})
"""
SHOWN = "document.getElementById('summary').textContent.startsWith('%d vehicles')"
CHOOSE = "document.querySelector('#rows .row').click()"
SCROLL = "setInterval(() => { document.getElementById('scroller').scrollTop += 40; }, 50)"

MAP = "document.getElementById('map')"
PAN = f"""
(() => {{
  const map = {MAP}, place = map.getBoundingClientRect();
  let turn = 0;
  setInterval(() => {{
    turn += 0.1;
    const clientX = place.x + place.width / 2 + 60 * Math.sin(turn);
    const clientY = place.y + place.height / 2 + 60 * Math.cos(turn);
    map.dispatchEvent(new PointerEvent("pointermove", {{clientX, clientY}}));
  }}, 16);
}})()
"""


async def tell(url: str, vehicles: int, over: asyncio.Event) -> None:
    """Post what all vehicles measure, once a second."""
    seq = 0
    async with aiohttp.ClientSession() as session:
        while not over.is_set():
            began, at = time.monotonic(), round(time.time(), 3)
            readings = []
            for number in range(1, vehicles + 1):
                for quantity, (value, unit) in flight(number, at).items():
                    seq += 1
                    reading = {"device": f"uav-{number}", "id": str(number), "seq": seq, "quantity": quantity}
                    readings.append({**reading, "representation": unit, "value": value, "time": at})
            async with session.post(f"{url}/readings", json={"readings": readings}) as answer:
                assert answer.status == 200, await answer.text()
            await asyncio.sleep(max(0.0, began + 1.0 - time.monotonic()))


async def measure(directory: Path, options: argparse.Namespace) -> list[list[str]]:
    """Rows of the table."""
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", f"--database={directory}/s.db"]
    station = harness.Process(command, directory / "station.log", directory, {"PYTHONPATH": str(ROOT)})
    over = asyncio.Event()
    try:
        station.says("listening on")
        sending = asyncio.ensure_future(tell(url, options.vehicles, over))
        async with chromium(directory) as page:
            await page.ask("Performance.enable", timeDomain="threadTicks")
            await page.ask("Page.navigate", url=url)
            await page.until(SHOWN % options.vehicles)
            rows = [await frames(page, "looking", options, station.pid)]
            await page.evaluate(CHOOSE)
            rows.append(await frames(page, "with a history", options, station.pid))
            if options.picture is not None:
                picture = await page.picture()
                await asyncio.to_thread(options.picture.write_bytes, picture)
            await page.evaluate(SCROLL)
            rows.append(await frames(page, "scrolling", options, station.pid))
            await page.press(*await page.middle(MAP))
            await page.evaluate(PAN)
            rows.append(await frames(page, "scrolling and panning", options, station.pid))
        over.set()
        await sending
    finally:
        station.stop()
    return rows


async def frames(page: Page, name: str, options: argparse.Namespace, station: int) -> list[str]:
    """One row: frames for so many seconds."""
    cpu, own = cpu_seconds(station), await page_seconds(page)
    times, tasks = json.loads(await page.evaluate(FRAMES % round(options.seconds * 1000)))
    gaps = [after - before for before, after in zip(times, times[1:], strict=False)]
    each = 1e3 * (await page_seconds(page) - own) / len(gaps)
    used = [f"{each:.1f}", f"{100 * (cpu_seconds(station) - cpu) / options.seconds:.0f} %"]
    numbers = [percentile(gaps, 0.5), percentile(gaps, 0.99), max(gaps), max(tasks, default=0.0)]
    return [name, str(len(gaps)), *(f"{number:.0f}" for number in numbers), str(len(tasks)), *used]


async def page_seconds(page: Page) -> float:
    """s of CPU that the page's main thread has used."""
    metrics = (await page.ask("Performance.getMetrics"))["metrics"]
    return float(next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration"))


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=1000, help="(%(default)s)")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each look (%(default)g)")
    parser.add_argument("--picture", type=Path, help="PNG to write")
    options = parser.parse_args()
    print(f"page: {machine()}")
    if shutil.which("chromium") is None:
        print("page: Chromium is not installed (apt-get install chromium)")
        return 0
    with tempfile.TemporaryDirectory(prefix="uavapi-page-") as name:
        rows = asyncio.run(measure(Path(name), options))
    headings = [f"{options.vehicles} vehicles", "frames", "median ms", "p99 ms", "longest ms", "longest task ms"]
    print(table([*headings, "tasks > 50 ms", "CPU ms a frame", "station"], rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
