"""Does the page at / leak? An hour of ten vehicles in a few minutes, in headless Chromium, without a vehicle.

    python benchmarks/page_memory.py [--minutes 60] [--each 10]

The page's own stream gets events of ten vehicles at 10 Hz, with times of that rate, as fast as it takes them. The
heap is what V8 uses after a forced garbage collection; now and then 1 MB more of compiled code is in it.
"""

from __future__ import annotations

import argparse
import asyncio
import functools
import http.server
import json
import sys
import tempfile
import threading
from pathlib import Path

from bench_page import heap
from figures import machine, table

from mavproxy_uavapi.http.handlers.page import FOLDER
from tests.support.chromium import Page, chromium

# Every answer of the stream is one that we write.
OPEN = """(async () => {
  const {stream} = document.querySelector('top-view').context, encoder = new TextEncoder();
  const open = async () => new Response(new ReadableStream({start(out) {
    window.send = text => out.enqueue(encoder.encode(text)); }}));
  window.seconds = 1e6;
  stream.api = {open};
  while (!window.send) await new Promise(resolve => setTimeout(resolve, 100));
})()"""
FEED = """(async () => {
  const random = () => Math.random(), VEHICLES = 10, RATE = 10;
  for (let second = 0; second < %d; second += 1) {
    const events = [{event: 'alive', system: 0, info: {}, time: window.seconds}];
    for (let n = 0; n < RATE; n += 1) {
      window.seconds += 1 / RATE;
      for (let system = 1; system <= VEHICLES; system += 1) {
        const turn = window.seconds / 6 + system;
        const lat = -35.36 + 3e-4 * Math.cos(turn), lon = 149.16 + 3e-4 * Math.sin(turn);
        const position = {lat, lon, relative_alt: 20 + random()};
        const link = {alive: true, packet_loss: 0}, type = 'copter', mode = 'GUIDED';
        const views = {gps: {position, velocity: {vx: random(), vy: random(), vz: 0}, heading: 360 * random()},
          general: {groundspeed: 5 * random()}, ned: {position: {x: random(), y: random(), z: -20}},
          attitude: {roll: random(), pitch: random(), yaw: 90},
          vehicle: {type, mode, link, armed: true, landed_state: 'in_air', ekf_ok: true, why_not: [],
            current: system === 1}};
        for (const [view, info] of Object.entries(views)) events.push({system, view, info, time: window.seconds});
      }
    }
    window.send(events.map(event => 'data: ' + JSON.stringify(event) + '\\n\\n').join(''));
    await new Promise(resolve => setTimeout(resolve, 0));
  }
  await new Promise(resolve => setTimeout(resolve, 1000));
  const {fleet, stream} = document.querySelector('top-view').context, [one] = fleet.all;
  const nodes = document.querySelectorAll('*').length;
  return JSON.stringify([one.trail.length, one.curves.since('alt', 0, 12e4).length, nodes, stream.why]);
})()"""


class Files(http.server.SimpleHTTPRequestHandler):
    """The page's folder as the API has it, and nothing else."""

    def translate_path(self, path: str) -> str:
        """The file of an address."""
        return super().translate_path(path.removeprefix("/page"))

    def log_message(self, *_: object) -> None:
        """Say nothing."""


async def measure(page: Page, address: str, minutes: int, each: int) -> list[list[str]]:
    """A row after each part: the minute, MB, places of a trail, points of a curve, nodes of the document."""
    await page.visit(f"{address}/page/index.html")
    await page.until("document.querySelector('top-view').context")
    await page.evaluate(OPEN)
    rows = [["0", f"{await heap(page):.2f}", "0", "0", ""]]
    for minute in range(each, minutes + 1, each):
        *counts, trouble = json.loads(await page.evaluate(FEED % (60 * each)))
        assert trouble == "", trouble
        rows.append([str(minute), f"{await heap(page):.2f}", *map(str, counts)])
    return rows


async def look(directory: Path, address: str, options: argparse.Namespace) -> None:
    """Open the page and measure."""
    async with chromium(directory) as page:
        rows = await measure(page, address, options.minutes, options.each)
    print(table(["minute", "heap MB", "trail", "curve", "nodes"], rows))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=int, default=60, help="of the vehicles (%(default)s)")
    parser.add_argument("--each", type=int, default=10, help="minutes between two looks (%(default)s)")
    options = parser.parse_args()
    print(f"page_memory: {machine()}", flush=True)
    handler = functools.partial(Files, directory=str(FOLDER))
    with (
        tempfile.TemporaryDirectory(prefix="uavapi-bench-") as directory,
        http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server,
    ):
        threading.Thread(target=server.serve_forever, daemon=True).start()
        asyncio.run(look(Path(directory), f"http://127.0.0.1:{server.server_address[1]}", options))
        server.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
