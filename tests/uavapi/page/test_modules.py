"""The page's modules that only compute, in a real browser; nothing flies."""

from __future__ import annotations

import asyncio
import functools
import http.server
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.http.page import FOLDER
from tests.support.chromium import Page, chromium

pytestmark = pytest.mark.needs("chromium")

HOUR = 36_000  # events of a view at 10 Hz


def _ages(delay: str, right: str, step: int = 0) -> str:
    """A script: whether the age of each of an hour's events, two a second, is right at its arrival.

    Args:
        delay: how late event `n` comes, in ms; it is a function of JavaScript, as `right` is.
        right: whether an age is right for event `n`.
        step: ms by which the server's wall clock is set after a minute.
    """
    return f"""{{const c = new m.StreamClock(), delay = {delay}, right = {right};
        Array.from({{length: 7200}}, (_, n) => n).every(n => {{
          const sent = 9e6 + 500 * n, arrived = 500 * n + delay(n);
          c.learn(sent, arrived, 7e9 + sent + (n < 120 ? 0 : {step}));
          return right(arrived - c.happened(sent, arrived), n);
        }})}}"""


# module -> scripts that must give true; `m` is the module
CHECKS = {
    "areas": [
        "m.areasOf(null).length === 0",
        """{const [a] = m.areasOf({features: [{properties: {kind: 'exclusion', radius: 25},
              geometry: {type: 'Point', coordinates: [149, -35]}}]});
           same([a.inclusion, a.rings, a.centre, a.radius], [false, [], [-35, 149], 25])}""",
        """same(m.areasOf({features: [{properties: {kind: 'inclusion'}, geometry: {type: 'MultiPolygon',
           coordinates: [[[[1, 2]]], [[[3, 4]], [[5, 6]]]]}}]}).map(a => a.rings),
           [[[[2, 1]]], [[[4, 3]], [[6, 5]]]])""",
        "m.areasOfAll([{envelope: null}]).length === 0",
    ],
    "curve": [
        "same(m.axisOf(0, 3), {bottom: 0, top: 3, step: 1})",
        "same(m.axisOf(0, 12), {bottom: 0, top: 15, step: 5})",
        "same(m.axisOf(-7, 3), {bottom: -10, top: 5, step: 5})",
        "m.axisOf(5, 5).top > m.axisOf(5, 5).bottom",
        "Math.abs(m.axisOf(21.5, 21.6).step - 0.05) < 1e-9",
    ],
    # What a vehicle is remembered by is bounded, however long the page is open: an hour of ten events a second.
    "fleet": [
        f"""{{const f = new m.Fleet(); let most = [0, 0, 0, 0, 0];
           for (let n = 0; n < {HOUR}; n += 1) {{
             const position = {{lat: -35 + n * 1e-5, lon: 149, relative_alt: 20}};
             f.take({{system: 1, view: 'gps', info: {{position}}}}, n * 100);
             f.take({{system: 1, view: 'general', info: {{groundspeed: 5}}}}, n * 100);
             f.take({{system: 1, view: 'ned', info: {{position: {{x: 0, y: 0}}}}}}, n * 100);
             if (n % 50 === 0) {{
               f.take({{system: 1, event: 'statustext', time: n, info: {{severity: 6, text: String(n)}}}}, n * 100);
               f.take({{system: 1, event: 'tag', info: {{id: n, seen: true, ned: [1, 1, 0]}}}}, n * 100);
               const job = state => f.take({{system: 1, event: 'job', info: {{job: String(n), state}}}}, n * 100);
               job('running'); job('failed');
             }}
             const v = f.of(1), kept = [v.trail, v.history.alt, v.history.speed, v.texts, v.tags];
             most = most.map((one, k) => Math.max(one, kept[k].length));
           }}
           same([...most, f.jobs.size], [1000, 1200, 1200, 200, 50, 60])}}""",
        # what stands still leaves one place
        """{const v = new m.Vehicle(1);
           for (let n = 0; n < 100; n += 1) v.moved({position: {lat: -35, lon: 149, relative_alt: 0}}, n);
           v.trail.length === 1}""",
        # a text that is told again after a reconnection, when the wall clock was set meanwhile, is the same
        """{const f = new m.Fleet();
           const text = (time, clock) => f.take({system: 1, event: 'statustext', time, clock, info: {text: 'a'}}, 0);
           text(1, 7); text(3601, 7); text(3602, 8); f.of(1).texts.length === 2}""",
        # jobs that still run are kept, the oldest that ended is forgotten
        """{const f = new m.Fleet();
           const state = n => (n < 2 ? 'running' : 'succeeded');
           for (let n = 0; n < 100; n += 1) f.heardJob({system: 1, info: {job: n, state: state(n)}});
           f.jobs.size === 60 && f.jobs.has(0) && f.jobs.has(1) && !f.jobs.has(2) && f.jobs.has(99)}""",
    ],
    "stream": [
        """(async () => {
           const text = n => `data: {"n": ${n}}\n\n`, parts = Array.from({length: 300}, (_, n) => text(n)).join('');
           const body = new Blob([parts]).stream(), heard = [];
           await m.readEvents(new Response(body), event => heard.push(event.n));
           return heard.length === 300 && heard[299] === 299})()""",
    ],
    "setting_list": [
        """same(m.inOrder([{name: 'a', settable: false}, {name: 'b', settable: true}, {name: 'c', settable: true}])
           .map(one => one.name), ['b', 'c', 'a'])""",
    ],
    "freshness": [
        "m.ageText(Infinity) === 'never heard' && m.ageText(3210) === '3.2 s' && m.ageText(7.2e6) === '2 h'",
        "{const f = new m.Fresh(); f.set(1, 0); !f.isOld(2900) && f.isOld(3100)}",
        "{const f = new m.Fresh(); f.set(1, 1000); f.set(2, 900); f.value === 1}",  # older, and late
        """{const c = new m.StreamClock(); c.learn(0, 50, 0);
           c.happened(1000, 9000) === 1050 && c.happened(1000, 1040) === 1040}""",
        # a clock that has learnt nothing tells when an event came
        "new m.StreamClock().happened(5, 70) === 70",
        # a constant delay is taken for the difference of two clocks
        _ages("n => 300", "age => age < 1"),
        # a delay that lasts is shown for as long as it lasts, from 60 s on for an hour
        _ages("n => (n < 120 ? 50 : 20000)", "(age, n) => (n < 120 ? age < 1 : age > 19000 && age < 20000)"),
        # a lag that grows by 10 ms a second, for 20 minutes
        _ages("n => 5 * Math.min(n, 2400)", "(age, n) => Math.abs(age - 5 * Math.min(n, 2400)) < 800"),
        # a delay that ends is forgotten at once
        _ages("n => (n < 120 ? 20000 : 50)", "age => age < 1"),
        # the clocks part by 100 ppm, either way
        _ages("n => 1000 + 0.05 * n", "age => age < 1"),
        _ages("n => 1000 - 0.05 * n", "age => age < 1"),
        # the server's wall clock is set by an hour: no age changes, and what has only that time is placed anew
        *(
            _ages("n => (n < 120 ? 50 : 20000)", "(age, n) => (n < 120 ? age < 1 : age > 19000 && age < 20000)", step)
            for step in (3_600_000, -3_600_000)
        ),
        """[3.6e6, -3.6e6].every(step => {const c = new m.StreamClock(); c.learn(0, 50, 7e9);
           c.learn(500, 550, 7e9 + 500 + step); return c.happenedByWall(7e9 + 400 + step, 900) === 450})""",
    ],
    "job_list": [
        # an old job that still runs keeps its row, and its button
        """{const jobs = new Map(Array.from({length: 60}, (_, n) => [String(n), {job: String(n), system: 1,
             verb: '/a', state: n === 3 ? 'running' : 'succeeded', result: '', seconds: 1, progress: {}}]));
           const list = new m.JobList(); list.start({fleet: {jobs}}); list.render(0);
           list.rows.size === 26 && !list.rows.get('3').abort.hidden}""",
    ],
    "message_list": [
        """{const fleet = new EventTarget(), list = new m.MessageList(); list.start({fleet});
           const text = (time, clock) => list.heard(
             {event: 'statustext', system: 1, time, clock, info: {severity: 4, text: 'a'}});
           text(1, 7); text(3601, 7); text(3602, 8); list.list.children.length === 2}""",
    ],
    "projection": [
        """{const p = new m.Projection(-35, 149), [lat, lon] = p.degrees(100, -50), [n, e] = p.metres(lat, lon);
           Math.hypot(n - 100, e + 50) < 1e-6 && lat > -35 && lon < 149}""",
    ],
    "camera": [
        """{const c = Object.assign(new m.Camera(), {width: 400, height: 300});
           same(c.metres(...c.pixels([7, 9])), [7, 9])}""",
        """{const c = Object.assign(new m.Camera(), {width: 400, height: 300}), before = c.metres(30, 40);
           c.zoom(2, 30, 40);
           const after = c.metres(30, 40); Math.hypot(before[0] - after[0], before[1] - after[1]) < 1e-9}""",
        """{const c = Object.assign(new m.Camera(), {width: 400, height: 300}); c.keep([[0, 0], [900, 900]]);
           while (c.step(true)); c.shows([900, 900]) && c.shows([0, 0])}""",
    ],
    "flight_status": [
        "m.commanderOf({mode: 'LOITER', armed: true, commanded_by: null}) === 'its pilot (LOITER)'",
        "m.commanderOf({mode: 'GUIDED', armed: false, commanded_by: null}) === 'nobody'",
    ],
    "log_list": ["m.sizeText(999) === '999 B' && m.sizeText(1500) === '2 kB' && m.sizeText(2.54e6) === '2.5 MB'"],
    "tiles": [
        # of a map only so many pictures are kept; the memory of the others is given back
        """{const api = Object.assign(new EventTarget(), {get: async () => { throw 0; }});
           const layer = new m.TileLayer(api, {touch() {}});
           let closed = 0;
           for (let n = 0; n < 1000; n += 1) { layer.tiles.set(`${n}`, {close() { closed += 1; }}); layer.forget(); }
           layer.tiles.size === 300 && closed === 700 && layer.tiles.has('999')}""",
        "same(m.tileAt(0, 0, 1), [1, 1]) && same(m.tileAt(0, -180, 3), [0, 4])",
        "same(m.tileAt(51.5074, -0.1278, 10).map(Math.floor), [511, 340])",  # London
        """{const [lat, lon] = m.cornerOf(...m.tileAt(-35.36, 149.16, 17), 17);
           Math.abs(lat + 35.36) < 1e-9 && Math.abs(lon - 149.16) < 1e-9}""",
        "m.zoomFor(1, 0, {least: 0, most: 22}) === 17 && m.zoomFor(1, 0, {least: 0, most: 12}) === 12",
    ],
    "command_panel": [
        "m.sentenceOf({error: {detail: 'refused', statustext: ['a', 'b']}}) === 'refused (a; b)'",
        "m.sentenceOf({}) === 'failed'",
    ],
    "top_view_layers": [
        "m.gridStep(1) === 100 && m.gridStep(10) === 10",
        """{const taken = []; const ys = [0, 0, 3].map(y => m.freePlace(taken, 0, y, 50));
           same(ys, [0, 15, 33]) || ys.every((y, n) => ys.slice(0, n).every(other => Math.abs(y - other) >= 15))}""",
    ],
}


class Handler(http.server.SimpleHTTPRequestHandler):
    """The page's folder as the API has it."""

    def translate_path(self, path: str) -> str:
        """The file of an address."""
        return super().translate_path(path.removeprefix("/page"))

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@pytest.fixture
def address() -> Iterator[str]:
    """A server of the page's files, without the API."""
    handler = functools.partial(Handler, directory=str(FOLDER))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


async def failures(page: Page, address: str) -> list[str]:
    """The checks that did not give true."""
    await page.visit(f"{address}/page/theme.css")
    found = []
    for module, checks in CHECKS.items():
        for check in checks:
            script = f"import('/page/{module}.js').then(m => eval({json.dumps(check)}))"
            same = "const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);"
            if await page.evaluate(f"(() => {{ {same} return {script}; }})()") is not True:
                found.append(f"{module}: {check}")
    return found


def test_modules_compute_what_they_say(address: str, tmp_path: Path) -> None:
    async def look() -> list[str]:
        async with chromium(tmp_path) as page:
            return await failures(page, address)

    assert asyncio.run(look()) == []
