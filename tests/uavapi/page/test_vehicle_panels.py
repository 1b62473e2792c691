"""Panels with an API and a fleet that a script plays: what is of one vehicle stays with it, what is old says so."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.chromium import chromium
from tests.support.page_checks import failures

pytestmark = pytest.mark.needs("chromium")

# `rig(...tags)` gives panels of vehicles 1 and 2, of which 1 is chosen; `asked` are calls to be answered.
RIG = """
const settle = () => new Promise(resolve => setTimeout(resolve));
const rig = async (...tags) => {
  const {Fleet} = await import('/page/fleet.js'), fleet = new Fleet(), asked = [];
  const call = (method, path, options) => new Promise((answer, refuse) =>
    asked.push({method, path, answer: async body => { answer(body); await settle(); await settle(); },
                refuse: async why => { refuse(new Error(why)); await settle(); await settle(); }}));
  const api = Object.assign(new EventTarget(), {
    call, get: path => call('GET', path), command: path => call('POST', path)});
  const context = {fleet, api, stream: {trouble: () => ''}, preferences: {alt: 10}, painter: {touch() {}}};
  const tell = (system, view, info, at) => fleet.take({system, view, info}, at);
  const alive = at => { for (const id of [1, 2]) tell(id, 'vehicle', {link: {alive: true}, armed: true,
    mode: 'GUIDED', landed_state: 'in_air', current: id === 1}, at); };
  alive(0);
  document.body.replaceChildren(...tags.map(tag => document.createElement(tag)));
  for (const panel of document.body.children) panel.start(context);
  const job = (system, number, verb, state) =>
    fleet.take({system, event: 'job', info: {job: number, verb, state, result: 'done', progress: {}}}, 0);
  return {fleet, api, asked, context, tell, alive, job, panels: [...document.body.children]};
};
const at = (lat, lon) => ({position: {lat, lon, relative_alt: 20}, velocity: {}, heading: 0});
"""

CHECKS = {
    "parameter_list": [
        # another vehicle's parameters are not shown: not until the answer, and not by a late one
        """(async () => {
           const {fleet, asked, panels: [list]} = await rig('parameter-list'), shown = () => list.rows.innerText;
           list.dispatchEvent(new Event('opened'));
           await asked[0].answer({parameters: {OF_1: 1}});
           const first = shown();
           fleet.choose(2);
           const cleared = shown();
           fleet.choose(1);
           await asked[1].answer({parameters: {OF_2: 2}});
           return first.includes('OF_1') && cleared === '' && shown() === '' &&
             asked[2].path.startsWith('/vehicles/1/'); })()""",
        # a value goes to the vehicle whose row it is, and what became of it is told as that one's
        """(async () => {
           const {fleet, asked, panels: [list]} = await rig('parameter-list');
           list.dispatchEvent(new Event('opened'));
           await asked[0].answer({parameters: {OF_1: 1}});
           const set = list.querySelector('hold-button');
           fleet.choose(2);
           set.dispatchEvent(new Event('confirmed'));
           const put = asked.find(one => one.method === 'PUT');
           await put.answer({value: 1, result: 'set'});
           return put.path === '/vehicles/1/parameters/OF_1' && list.answer.textContent === 'vehicle 1: set'; })()""",
    ],
    "command_panel": [
        # a job of the vehicle before ends nothing here, whether it was begun before or after the switch
        """(async () => {
           let ended = 0;
           if (!customElements.get('a-panel')) customElements.define('a-panel', class extends m.CommandPanel {
             build() { this.append(this.answer); }
             succeeded() { ended += 1; } });
           const {fleet, api, asked, job, panels: [panel]} = await rig('a-panel');
           const begin = () => panel.begin(() => api.get('/begin'));
           begin(); await asked[0].answer({job: 1}); job(1, 1, '/a', 'succeeded');
           const own = ended;
           begin(); await asked[1].answer({job: 2}); fleet.choose(2); job(1, 2, '/a', 'succeeded');
           begin(); fleet.choose(1); await asked[2].answer({job: 3}); job(2, 3, '/a', 'succeeded');
           begin(); fleet.choose(2); await asked[3].refuse('no');
           return same([own, ended, panel.answer.textContent], [1, 1, 'vehicle 1: no']); })()""",
    ],
    "envelope_file": [
        # a file is drawn before it counts, goes to the vehicle that it is for, and is gone with another choice
        """(async () => {
           await import('/page/top_view.js');
           const {fleet, asked, panels: [, panel]} = await rig('top-view', 'envelope-file');
           const can = () => !panel.put.hasAttribute('disabled'), areas = id => fleet.vehicles.get(id).areas;
           const puts = () => asked.filter(one => one.method === 'PUT');
           const ring = [[149.16, -35.36], [149.17, -35.36], [149.17, -35.35], [149.16, -35.36]];
           const geometry = {type: 'Polygon', coordinates: [ring]};
           const envelope = {features: [{properties: {kind: 'exclusion', name: 'a'}, geometry}]};
           const files = [{arrayBuffer: async () => new ArrayBuffer(2)}];
           Object.defineProperty(panel.file, 'files', {get: () => files});
           const choose = async () => { panel.file.dispatchEvent(new Event('change')); await settle(); };
           const seen = [can()], see = (...more) => seen.push(...more, can(), areas(1).proposed.length);
           await choose(); await puts()[0].answer({result: 'read', envelope});
           see(puts()[0].path, panel.answer.textContent);
           fleet.choose(2); see(panel.answer.textContent);
           fleet.choose(1);
           await choose(); await puts()[1].answer({result: 'read', envelope});
           panel.put.dispatchEvent(new Event('confirmed')); await puts()[2].answer({result: 'in force'});
           see(puts()[2].path, areas(1).envelope.length, panel.answer.textContent);
           await choose(); await puts()[3].refuse('no areas');
           see(panel.answer.textContent);
           return same(seen, [false, '/vehicles/1/envelope?preview=true', 'read', true, 1, '', false, 0,
             '/vehicles/1/envelope', 1, 'in force', false, 0, 'no areas', false, 0]); })()""",
    ],
    "mission": [
        # not read is not "none", and no start is offered on it
        """(async () => {
           await import('/page/top_view.js');
           const {asked, panels: [, plan]} = await rig('top-view', 'mission-plan');
           const look = () => { plan.render(0); return plan.held.textContent; };
           const last = end => asked.filter(one => one.path.endsWith(end)).at(-1);
           const can = () => !plan.starter.hasAttribute('disabled');
           const words = [look(), can()];
           plan.dispatchEvent(new Event('opened')); words.push(look());
           await last('waypoints').refuse('no answer'); words.push(look(), can());
           await last('fence').answer({fence: null});
           plan.read(); await last('waypoints').answer({items: [{seq: 1}]}); words.push(look(), can());
           await last('fence').refuse('lost');
           plan.read(); await last('waypoints').answer({items: []}); words.push(look(), can());
           return same(words, ['The mission was not read yet.', false, 'The mission is being read.',
             'The mission could not be read: no answer.', false, 'The vehicle holds 1 items.', true,
             'The vehicle holds no items.', false]); })()""",
        # somebody else's upload, or another number of items: the route goes, and is read anew
        """(async () => {
           await import('/page/top_view.js');
           const {fleet, asked, job, tell, panels: [, plan]} = await rig('top-view', 'mission-plan');
           const {mission} = fleet.chosen, reads = () => asked.filter(one => one.path.endsWith('waypoints'));
           const items = count => ({items: Array.from({length: count}, (_, n) => ({seq: n + 1}))});
           const answer = async count => {
             await reads().at(-1).answer(items(count));
             await asked.at(-1).answer({fence: null}); };
           plan.read(); await answer(2);
           plan.hidden = true;
           job(1, 1, '/mission/waypoints', 'running');
           const during = mission.items.length;
           job(1, 1, '/mission/waypoints', 'succeeded');
           const gone = mission.items;
           tell(1, 'mission', {total: 2}, 0);
           tell(1, 'mission', {total: 3}, 1); // it comes while the mission is read
           await answer(3);
           const byJob = [reads().length, mission.items.length];
           tell(1, 'mission', {total: 3}, 2);
           job(2, 2, '/mission/waypoints', 'succeeded');
           const same3 = reads().length;
           tell(1, 'mission', {total: 5}, 3); await answer(5);
           return same([during, gone, byJob, same3, reads().length, mission.items.length],
             [2, null, [2, 3], 2, 3, 5]); })()""",
        # rally points are read after the fence, and one lost read takes none away
        """(async () => {
           await import('/page/top_view.js');
           const {fleet, asked, panels: [, plan]} = await rig('top-view', 'mission-plan');
           const last = end => asked.filter(one => one.path.endsWith(end)).at(-1);
           const read = async () => {
             plan.read(); await last('waypoints').answer({items: []}); await last('fence').refuse('lost'); };
           await read(); await last('rally').answer({points: [{seq: 1, lat: 1, long: 2, alt: 3}]});
           const held = () => fleet.chosen.rally.map(one => [one.seq, Boolean(one.isOld)]);
           const first = held();
           await read(); await last('rally').refuse('lost');
           return same([first, held()], [[[1, false]], [[1, true]]]); })()""",
        # a file that was chosen for one vehicle is not sent to the other
        """(async () => {
           await import('/page/top_view.js');
           const {fleet, asked, panels: [, plan]} = await rig('top-view', 'mission-plan');
           let read;
           const file = {arrayBuffer: () => new Promise(resolve => { read = resolve; })};
           Object.defineProperty(plan.file, 'files', {get: () => [file]});
           plan.sendFile(); fleet.choose(2); read(new ArrayBuffer(3));
           await settle();
           const refused = asked.filter(one => one.method === 'POST').length;
           plan.sendFile(); read(new ArrayBuffer(3));
           await settle();
           return same([refused, asked.at(-1).path], [0, '/vehicles/2/mission/waypoints?wait=false']); })()""",
        # progress that comes no longer is grey and says its age
        """(async () => {
           await import('/page/top_view.js');
           const {tell, alive, panels: [, plan]} = await rig('top-view', 'mission-plan');
           tell(1, 'mission', {current: 3, total: 5, state: 'active', distance_m: 20}, 0);
           plan.render(100);
           const fresh = [plan.progress.textContent, plan.progress.className];
           alive(9000); plan.render(9000);
           return same([...fresh, plan.progress.textContent, plan.progress.className],
             [' Item 3 of 5, active, 20 m to go', '', ' Item 3 of 5, active, 20 m to go, 9.0 s old', 'old']); })()""",
    ],
    "history_list": [
        # entries stand where their times are, one is there once, and older ones come when they are asked for
        """(async () => {
           const {fleet, asked, panels: [list]} = await rig('history-list');
           const entry = (id, seconds, vehicle = 1) =>
             ({id, time: `2026-05-04T13:20:0${seconds}.000+00:00`, kind: 'mode', vehicle, sentence: id});
           const shown = () =>
             [...list.list.children].filter(row => !row.hidden).map(row => row.lastChild.textContent).join(' ');
           const hear = one => fleet.take({system: one.vehicle, event: 'history', info: one}, 0);
           hear(entry('unseen', 9)); // the page is not read yet: it will be in it
           list.dispatchEvent(new Event('opened'));
           await asked[0].answer({entries: [entry('d', 4), entry('c', 3)], next: 'c'});
           hear(entry('e', 5, 2)); hear(entry('e', 5, 2)); hear(entry('late', 3));
           list.older.click();
           await asked[1].answer({entries: [entry('c', 3), entry('a', 1)], next: null});
           const all = shown();
           list.only.checked = true; list.filter();
           const one = shown();
           fleet.choose(2);
           return same([asked[1].path, all, one, shown(), list.older.hidden],
             ['/audit?limit=100&before=c', 'e d late c a', 'd late c a', 'e', true]); })()""",
        # both times are told, and what nobody has asked for stands out
        """(async () => {
           const {asked, panels: [list]} = await rig('history-list');
           const time = '2026-05-04T13:20:07.123+00:00';
           list.dispatchEvent(new Event('opened'));
           await asked[0].answer({next: null, entries: [
             {id: '3', time, kind: 'mode', vehicle: 1, sentence: 'by a failsafe', by: 'failsafe'},
             {id: '2', time, kind: 'mode', vehicle: 1, sentence: 'by land of anna', by: 'client'},
             {id: '1', time, kind: 'command', vehicle: 1, sentence: 'takeoff', outcome: 'ok'}]});
           const rows = [...list.list.children], local = new Date(time).toLocaleTimeString([], {hour12: false});
           const times = [local, '13:20:07 UTC'].map(text => rows[0].innerText.includes(text));
           return same([rows.map(row => row.className), times], [['bad', '', ''], [true, true]]); })()""",
    ],
    "readings": [
        # at a lost link what the report tells is as old as the last heartbeat
        """(async () => {
           const {fleet, panels: [readings]} = await rig('vehicle-readings');
           const link = {alive: false, heartbeat_age_s: 12, packet_loss: 0};
           fleet.take({system: 1, view: 'vehicle', info: {link, ekf_ok: true}}, 9000);
           readings.render(9000);
           const tile = label =>
             readings.tiles.find(({tile}) => tile.firstChild.textContent === label).age.textContent;
           return same([tile('EKF'), tile('Link loss')], ['12 s old', '12 s old']); })()""",
    ],
    "message_list": [
        # deliveries are the business of the tab Gradys
        """(async () => {
           const {fleet, panels: [list]} = await rig('message-list');
           fleet.take({system: 0, event: 'delivered', info: {count: 9, sink: 'x'}}, 0);
           fleet.take({system: 1, event: 'statustext', time: 0, clock: 1, info: {severity: 2, text: 'EKF'}}, 0);
           return same([...list.list.children].map(row => row.lastChild.textContent), ['EKF']); })()""",
    ],
    "api": [
        # a sentence that quotes the autopilot does not do so twice
        """(async () => {
           const says = m.sentence({detail: 'left (EKF)', change: {}, statustext: ['EKF', 'EKF variance']});
           const unsaid = m.sentence({detail: 'refused: no', statustext: ['no', 'also']});
           return same([says, unsaid], ['left (EKF)', 'refused: no (also)']); })()""",
    ],
    "held_mission": [
        # an autopilot that tells no number, always 0, is not asked again and again
        """(async () => {
           const held = new m.HeldMission(); let reads = 0;
           const read = () => held.read(async () => { reads += 1; return [1, 2]; });
           await read();
           const first = held.takeTotal(0);
           await read();
           const others = [held.takeTotal(0), held.takeTotal(null)];
           return first && !others.some(Boolean) && reads === 2 && held.items.length === 2; })()""",
        # what changes while it is read is read again
        """(async () => {
           const held = new m.HeldMission(); let reads = 0;
           await held.read(async () => { reads += 1; if (reads === 1) held.forget(); return Array(reads); });
           return reads === 2 && held.items.length === 2; })()""",
    ],
    "modules": [
        # one failed read takes no border away; it is an old one then
        """(async () => {
           const {fleet, asked, context} = await rig();
           m.watchModules(context, {offer() {}}, {});
           const look = () => { fleet.dispatchEvent(new Event('chosen')); return asked.slice(-2); };
           const geometry = {type: 'Polygon', coordinates: [[[1, 2]]]};
           let [fence, envelope] = look();
           await fence.answer({parameters: {FENCE_ENABLE: 1, FENCE_TYPE: 2, FENCE_RADIUS: 90}});
           await envelope.answer({envelopes: [{envelope: {features: [{properties: {}, geometry}]}}]});
           [fence, envelope] = look();
           await fence.refuse('no'); await envelope.refuse('no');
           const {fence: circle, areas} = fleet.chosen;
           const kept = [circle.radius, circle.isOld, areas.envelope.length, areas.envelope[0].isOld];
           [fence, envelope] = look();
           await fence.answer({parameters: {}}); await envelope.answer({envelopes: []});
           return same([...kept, fleet.chosen.fence, areas.envelope.length], [90, true, 1, true, null, 0]); })()""",
        # home is asked for once, and again after arming has moved it, or where no answer came
        """(async () => {
           const {fleet, tell, asked, context} = await rig();
           m.watchModules(context, {offer() {}}, {});
           const homes = () => asked.filter(one => one.path === '/vehicles/1/telemetry/home_info');
           const look = () => { fleet.dispatchEvent(new Event('chosen')); return homes().length; };
           const arm = armed => tell(1, 'vehicle', {armed}, 0), counts = [];
           arm(false);
           counts.push(look()); await homes()[0].refuse('no');
           counts.push(look()); await homes()[1].answer({lat: 1});
           counts.push(look());
           arm(true);
           counts.push(look()); await homes()[2].answer({lat: 1});
           counts.push(look());
           return same(counts, [1, 2, 2, 3, 3]); })()""",
    ],
    "top_view": [
        # a vehicle that does not know where it is, is nowhere: not on the equator
        """(async () => {
           const {fleet, tell, panels: [view]} = await rig('top-view');
           tell(1, 'gps', at(0, 0), 0); tell(2, 'gps', at(-35, 149), 0);
           view.render(0);
           return view.placeOf(fleet.of(1)) === null && view.plane.lat === -35 &&
             same(view.places(), [[0, 0], [0, 0]]); })()""",
        # an arrow only moves; Enter places where the cursor is, once however long it is held
        """(async () => {
           const {tell, panels: [view]} = await rig('top-view'), placed = [];
           tell(1, 'gps', at(-35, 149), 0);
           view.addEventListener('place', event => placed.push(event.detail));
           view.addEventListener('nudge', event => { view.cursor = event.detail; });
           const press = (key, repeat = false) =>
             view.canvas.dispatchEvent(new KeyboardEvent('keydown', {key, repeat}));
           press('ArrowUp'); press('ArrowUp'); press('ArrowRight');
           const moved = placed.length;
           press('Enter'); press('Enter', true);
           view.render(0);
           return moved === 0 && placed.length === 1 && Math.abs(placed[0].north - 2) < 1e-6 &&
             view.canvas.ariaLabel.includes('the cursor is 2 m north, 1 m east of home'); })()""",
        """(async () => {
           const {tell, alive, panels: [view]} = await rig('top-view');
           tell(1, 'gps', at(-35, 149), 0);
           view.render(100);
           const fresh = view.canvas.ariaLabel;
           alive(9000); view.render(9000);
           return fresh.includes('vehicle 1 is 0 m north') &&
             view.canvas.ariaLabel.includes('vehicle 1 was 0 m north, 0 m east of home 9.0 s ago'); })()""",
    ],
    "go_to": [
        """(async () => {
           await import('/page/top_view.js');
           const {tell, alive, panels: [view, go]} = await rig('top-view', 'go-to');
           tell(1, 'gps', at(-35, 149), 0);
           view.render(0);
           go.choose({lat: -35, lon: 149}); go.render(100);
           const fresh = [go.where.textContent.endsWith('0.0 m away'), go.where.classList.contains('old')];
           alive(9000); go.render(9000);
           const stale = [go.where.textContent.endsWith('0.0 m away 9.0 s ago'), go.where.classList.contains('old')];
           return same([...fresh, ...stale], [true, false, true, true]); })()""",
        # what was begun for one vehicle is not told as the other's, and closes nothing of the other
        """(async () => {
           await import('/page/top_view.js');
           const {fleet, asked, tell, panels: [, go]} = await rig('top-view', 'go-to'), told = [];
           const actions = Object.assign(document.createElement('flight-actions'), {await: job => told.push(job)});
           document.body.append(actions);
           for (const id of [1, 2]) tell(id, 'gps', at(-35, 149), 0);
           go.choose({lat: -35, lon: 149}); go.send();
           const sent = asked.at(-1);
           fleet.choose(2);
           go.choose({lat: -35, lon: 149});
           await sent.answer({job: 1});
           return same([sent.path, told, go.hidden], ['/vehicles/1/movement/go_to_gps_wait', [], false]); })()""",
    ],
    "time_plot": [
        """(async () => {
           const {fleet, tell, alive} = await rig(), plot = document.createElement('time-plot');
           plot.setAttribute('curve', 'alt'); plot.setAttribute('label', 'Height, m');
           plot.start({fleet, stream: {trouble: () => ''}}); document.body.append(plot);
           tell(1, 'gps', at(-35, 149), 0);
           plot.render(100);
           const fresh = plot.canvas.ariaLabel;
           alive(9000); plot.render(9000);
           return same([fresh, plot.canvas.ariaLabel], ['Height, m: 20.0', 'Height, m: 20.0, 9.0 s old']); })()""",
    ],
    "reading_curves": [
        """(async () => {
           const {asked, panels: [curves]} = await rig('reading-curves');
           const began = performance.now();
           const looking = curves.look();
           const points = [[1, 21.5]];
           await asked[0].answer({series: [{device: 'a', quantity: 'heat', representation: 'C', points}]});
           await looking;
           const figure = curves.querySelector('figure');
           curves.render(began + 200);
           const fresh = [figure.innerText.includes('old'), figure.classList.contains('old')];
           curves.render(began + 30000);
           const stale = [/21.50 C (29|30) s old/.test(figure.innerText), figure.classList.contains('old'),
             /heat: 21.50, (29|30) s old/.test(figure.querySelector('canvas').ariaLabel)];
           return same([...fresh, ...stale], [false, false, true, true, true]); })()""",
    ],
}


def test_panels_keep_vehicles_apart_and_tell_ages(address: str, tmp_path: Path) -> None:
    async def look() -> list[str]:
        async with chromium(tmp_path) as page:
            return await failures(page, address, CHECKS, RIG)

    assert asyncio.run(look()) == []
