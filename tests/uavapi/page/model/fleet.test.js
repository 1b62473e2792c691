import {test} from "node:test";
import assert from "node:assert/strict";
import {Fleet, Vehicle} from "#page/model/fleet.js";

const curve = (v, key) => v.curves.series.get(key).levels[0];
const HOUR = 36_000; // events of a view at 10 Hz

test("what a vehicle is remembered by is bounded, however long the page is open", () => {
  const f = new Fleet(); let most = [0, 0, 0, 0, 0];
  for (let n = 0; n < HOUR; n += 1) {
    const position = {lat: -35 + n * 1e-5, lon: 149, relative_alt: 20};
    f.take({system: 1, view: "gps", info: {position}}, n * 100);
    f.take({system: 1, view: "general", info: {groundspeed: 5}}, n * 100);
    f.take({system: 1, view: "ned", info: {position: {x: 0, y: 0}}}, n * 100);
    if (n % 50 === 0) {
      f.take({system: 1, event: "statustext", time: n, info: {severity: 6, text: String(n)}}, n * 100);
      f.take({system: 1, event: "tag", info: {id: n, seen: true, ned: [1, 1, 0]}}, n * 100);
      const job = state => f.take({system: 1, event: "job", info: {job: String(n), state}}, n * 100);
      job("running"); job("failed");
    }
    const v = f.of(1), kept = [v.trail, curve(v, "alt"), curve(v, "speed"), v.texts, v.tags];
    most = most.map((one, k) => Math.max(one, kept[k].length));
  }
  assert.deepEqual([...most, f.jobs.size], [1000, 661, 661, 200, 50, 60]);
});

test("what stands still leaves one place", () => {
  const v = new Vehicle(1);
  for (let n = 0; n < 100; n += 1) v.moved({position: {lat: -35, lon: 149, relative_alt: 0}});
  assert.ok(v.trail.length === 1);
});

test("ArduPilot tells 0 N 0 E before it knows where it is; the height is one all the same", () => {
  const v = new Vehicle(1);
  v.take("gps", {position: {lat: 0, lon: 0, relative_alt: 3}}, 0);
  const before = [v.position, v.trail.length, curve(v, "alt").length];
  v.take("gps", {position: {lat: 0, lon: 9, relative_alt: 3}}, 1);
  assert.deepEqual([...before, v.position.lon, v.trail.length], [null, 0, 1, 9, 1]);
});

test("a text that is told again after a reconnection, when the wall clock was set meanwhile, is the same", () => {
  const f = new Fleet();
  const text = (time, clock) => f.take({system: 1, event: "statustext", time, clock, info: {text: "a"}}, 0);
  text(1, 7); text(3601, 7); text(3602, 8);
  assert.ok(f.of(1).texts.length === 2);
});

test("jobs that still run are kept, the oldest that ended is forgotten", () => {
  const f = new Fleet();
  const state = n => (n < 2 ? "running" : "succeeded");
  for (let n = 0; n < 100; n += 1) f.heardJob({system: 1, info: {job: n, state: state(n)}});
  assert.ok(f.jobs.size === 60 && f.jobs.has(0) && f.jobs.has(1) && !f.jobs.has(2) && f.jobs.has(99));
});

test("vehicles are added and taken away, the one that is shown stays, and one is always chosen", () => {
  const f = new Fleet(), heard = [];
  for (const id of [1, 2, 3]) f.of(id);
  for (const name of ["chosen", "grouped"]) f.addEventListener(name, () => heard.push(name));
  const state = () => [f.chosenId, ...f.several.map(one => one.id)];
  const seen = [];
  const acts = [() => f.choose(2), () => f.pick(1, true), () => f.toggle(2), () => f.toggle(1), () => f.chooseAll(),
    () => f.pick(3), () => f.choose(3), () => f.choose(9)];
  for (const act of acts) {
    act();
    seen.push(state());
  }
  assert.deepEqual(seen, [[2, 2], [2, 1, 2], [1, 1], [1, 1], [1, 1, 2, 3], [3, 3], [3, 3], [3, 3]]);
  assert.deepEqual(heard, ["chosen", "grouped", "grouped", "chosen", "grouped", "grouped", "chosen", "grouped"]);
});
