"""The page's modules that only compute, in a real browser; nothing flies."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.chromium import chromium
from tests.support.page_checks import failures

pytestmark = pytest.mark.needs("chromium")

# The page's strips as index.html has them, and what panels are given; `at` is the time of a vehicle's report.
STRIPS = """
  const {Fleet} = await import('/page/fleet.js'), fleet = new Fleet();
  const told = (mode, at, armed = true) => fleet.of(1).take('vehicle',
    {type: 'copter', mode, armed, link: {alive: true, heartbeat_age_s: 0}}, at);
  const strip = id => {
    const made = document.createElement('div');
    document.body.append(Object.assign(made, {id}));
    return made;
  };
  const trouble = strip('trouble'), result = strip('hold-result');
  const drop = () => { for (const one of [trouble, result]) one.remove(); };
  let why = '';
  const stream = {heardAt: 0, trouble: () => why};
  const spoken = one => [...one.querySelectorAll(':not([aria-hidden])')].filter(e => !e.children.length)
    .map(e => e.textContent).join('|');
"""

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
    "hold_button": [
        # one that was disabled under a finger takes the next press
        """{const b = document.createElement('hold-button'); b.setAttribute('label', 'Arm'); document.body.append(b);
           b.button.dispatchEvent(new PointerEvent('pointerdown', {button: 0}));
           b.toggleAttribute('disabled'); b.toggleAttribute('disabled');
           b.button.click(); b.remove(); b.button.ariaLabel.includes('press again')}""",
        # it may move under the pointer, which may not leave the place of the press
        """{const b = document.createElement('hold-button'); b.setAttribute('label', 'Arm'); document.body.prepend(b);
           const {left, top, bottom} = b.button.getBoundingClientRect();
           const point = (kind, clientX, clientY) => b.button.dispatchEvent(
             new PointerEvent(kind, {button: 0, clientX, clientY, bubbles: true}));
           point('pointerdown', left, top);
           b.style.marginTop = '100px';
           point('pointermove', left + 1, bottom); point('pointerleave', left + 1, bottom);
           const moved = b.matches('.held');
           point('pointermove', left + 1, bottom + 1);
           const left_it = !b.matches('.held');
           point('pointerdown', left, top); point('pointerup', left, top);
           b.remove(); moved && left_it && !b.matches('.held')}""",
    ],
    "hold_order": [
        # an answer of the API counts until the vehicle tells of another mode; then nothing is said of now
        f"""(async () => {{{STRIPS} drop();
           told('GUIDED', 900);
           const o = new m.HoldOrder(fleet, 1000);
           o.answered({{1: {{status: 200}}}}, 1500);
           const kinds = [o.standing(1500).kind];
           told('GUIDED', 1600); kinds.push(o.standing(1700).kind); // on its way before the answer
           told('BRAKE', 2000); kinds.push(o.standing(2100).kind, / held/.test(o.standing(2100).head));
           told('GUIDED', 3000); kinds.push(o.standing(3100));
           return same(kinds, ['good', 'good', 'good', true, null]); }})()""",
        # no answer is bad after 3 s, and good when it comes
        f"""(async () => {{{STRIPS} drop();
           told('GUIDED', 900);
           const o = new m.HoldOrder(fleet, 1000), early = o.standing(3900).kind, late = o.standing(4100);
           o.answered({{1: {{status: 200}}}}, 9000);
           return same([early, late.kind, late.missing], ['', 'bad', ['vehicle 1: no answer']])
             && o.standing(9000).kind === 'good' && /NO ANSWER/.test(late.head); }})()""",
        # what another vehicle lacks stays said
        f"""(async () => {{{STRIPS} drop();
           told('BRAKE', 2000);
           const o = new m.HoldOrder(fleet, 1000);
           o.answered({{1: {{status: 200}}, 2: {{status: 503, detail: 'no heartbeat'}}}}, 1500);
           told('GUIDED', 3000);
           const missing = ['vehicle 1: flies again (GUIDED)', 'vehicle 2: no heartbeat'];
           return same(o.standing(3100).missing, missing); }})()""",
    ],
    "hold_all": [
        # a screen reader hears no running age; the button to close stays the same one
        f"""(async () => {{{STRIPS}
           told('GUIDED', 0);
           const panel = document.createElement('hold-all');
           panel.start({{fleet, painter: {{touch() {{}}}}, api: {{urgent: () => new Promise(() => {{}})}}}});
           panel.button.click();
           const at = panel.order.at, close = result.querySelector('button');
           panel.render(at + 100);
           const first = spoken(result), age = result.querySelector('.age').textContent;
           panel.render(at + 900);
           const kept = spoken(result) === first && result.querySelector('.age').textContent !== age
             && result.querySelector('button') === close && !result.hidden;
           close.click(); panel.render(at + 1000); drop();
           return kept && result.hidden; }})()""",
    ],
    "connection": [
        f"""(async () => {{{STRIPS}
           told('GUIDED', 0);
           const panel = document.createElement('connection-state'), said = [];
           panel.start({{fleet, stream}});
           const look = at => {{ panel.render(at); said.push([trouble.hidden, spoken(trouble)]); }};
           look(100); look(9000); look(9900); why = 'gone'; look(10000); look(11000); drop();
           return same(said, [[true, ''], [false, 'LINK LOST: vehicle 1'], [false, 'LINK LOST: vehicle 1'],
             [false, 'NO LIVE DATA: gone'], [false, 'NO LIVE DATA: gone']])
             && trouble.querySelector('.age').textContent === 'what is shown is 11 s old'; }})()""",
    ],
    "job_list": [
        # an old job that still runs keeps its row, and its button
        """{const jobs = new Map(Array.from({length: 60}, (_, n) => [String(n), {job: String(n), system: 1,
             verb: '/a', state: n === 3 ? 'running' : 'succeeded', result: '', seconds: 1, progress: {}}]));
           const list = new m.JobList(), fleet = {jobs, vehicles: new Map()};
           list.start({fleet, stream: {trouble: () => ''}}); list.render(0);
           list.rows.size === 26 && !list.rows.get('3').abort.hidden}""",
        # how far it is to go is grey and says its age when it is not live; how a job ended is not
        f"""(async () => {{{STRIPS} drop();
           told('GUIDED', 0);
           const tell = info => fleet.take({{system: 1, event: 'job', info: {{verb: 'go', ...info}}}}, 0);
           tell({{job: '1', state: 'succeeded', result: 'there', seconds: 1}});
           tell({{job: '2', state: 'running', progress: {{distance_to_go: 5}}}});
           const panel = document.createElement('job-list');
           panel.start({{fleet, stream}});
           const told_of = row => [row.className, row.querySelector('.age').textContent];
           const rows = () => [...panel.querySelectorAll('li')].map(told_of);
           panel.render(100); const live = rows();
           panel.render(9000); const lost = rows();
           told('GUIDED', 9000); why = 'gone'; panel.render(9000);
           const ended = ['succeeded', ''], grey = [['running old', '9.0 s old'], ended];
           return same(live, [['running', ''], ended]) && same(lost, grey) && same(rows(), grey); }})()""",
    ],
    "token_dialog": [
        # it leaves HOLD ALL to be clicked
        """{const panel = document.createElement('token-dialog');
           panel.start({api: Object.assign(new EventTarget(), {hasToken: false})});
           document.body.append(panel);
           panel.ask();
           const dialog = panel.querySelector('dialog'), found = dialog.open && !dialog.matches(':modal');
           panel.remove();
           found}""",
    ],
    # what stops takes no turn
    "actions": [
        """(async () => {
           const {Fleet} = await import('/page/fleet.js'), fleet = new Fleet(), calls = [];
           fleet.of(3); fleet.choose(3);
           const kept = name => path => { calls.push([name, path]); return new Promise(() => {}); };
           const panel = document.createElement('flight-actions');
           panel.start({fleet, preferences: {alt: 10}, api: {stop: kept('stop'), command: kept('command')}});
           for (const one of [panel.brake, panel.stop]) one.click();
           for (const one of [panel.land, panel.rtl, panel.disarm, panel.takeoff]) {
             one.dispatchEvent(new Event('confirmed'));
           }
           return same(calls, [['stop', 'command/brake'], ['stop', 'movement/stop'], ['stop', 'command/land'],
             ['stop', 'command/rtl'], ['stop', 'command/disarm'], ['command', 'command/takeoff']]
             .map(([way, path]) => [way, `/vehicles/3/${path}`])); })()""",
    ],
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
        # ArduPilot tells 0 N 0 E before it knows where it is; the height is one all the same
        """{const v = new m.Vehicle(1);
           v.take('gps', {position: {lat: 0, lon: 0, relative_alt: 3}}, 0);
           const before = [v.position, v.trail.length, v.history.alt.length];
           v.take('gps', {position: {lat: 0, lon: 9, relative_alt: 3}}, 1);
           same([...before, v.position.lon, v.trail.length], [null, 0, 1, 9, 1])}""",
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
        # with another token nothing more is heard of the stream from before
        """(async () => {
           const api = new EventTarget(), heard = [], bodies = [];
           const settle = () => new Promise(resolve => setTimeout(resolve, 5));
           let body;
           api.open = async (_, signal) => {
             const response = new Response(new ReadableStream({start(control) { body = control; }}));
             signal.addEventListener('abort', () => bodies.push('ended'));
             return response;
           };
           const stream = new m.TelemetryStream(api, {}, event => heard.push(event.n));
           const tell = n => body.enqueue(new TextEncoder().encode(`data: {"n": ${n}, "time": 0}\n\n`));
           stream.once();
           await settle(); tell(1);
           while (!heard.length) await settle();
           const live = stream.trouble(stream.heardAt) === '';
           api.dispatchEvent(new Event('token-changed'));
           const at_once = stream.trouble(stream.heardAt);
           tell(2); await settle(); await settle();
           return live && at_once === 'another token was given' && same(heard, [1]) && same(bodies, ['ended'])
             && stream.trouble(stream.heardAt) !== ''; })()""",
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
        # a lag that outlives its connection stays; a server that was started anew, or is another one, has none yet
        """{const ageAfter = begun => {const c = new m.StreamClock(); c.learn(0, 50, 7e9); c.reopen();
             c.learn(500 - begun, 20500, 7e9 + 500); return 20500 - c.happened(500 - begun, 20500)};
           ageAfter(0) > 19900 && ageAfter(0) < 20000 && ageAfter(9e6) === 0}""",
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


def test_modules_compute_what_they_say(address: str, tmp_path: Path) -> None:
    async def look() -> list[str]:
        async with chromium(tmp_path) as page:
            return await failures(page, address, CHECKS)

    assert asyncio.run(look()) == []
