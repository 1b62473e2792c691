import {test} from "node:test";
import assert from "node:assert/strict";
import {Fleet} from "#page/model/fleet.js";
import {Replay} from "#page/model/replay.js";
import {ReplayApi} from "#page/net/replay_api.js";

globalThis.sessionStorage ??= {getItem: () => null};
const BEGAN = 1000, METRE = 1 / 111318.845;
const seconds = [...Array(61).keys()];
const overview = {began: BEGAN, seconds: 60, events: [
  {event: "statustext", system: 1, time: BEGAN + 10, clock: 10, info: {severity: 6, text: "ten"}},
  {event: "mode", system: 1, time: BEGAN + 40, clock: 40, info: {mode: "LAND"}},
], vehicles: [{vehicle: 1, seconds, lat: seconds.map(n => 50 + n * 2 * METRE), lon: seconds.map(() => 7),
  relative_alt: seconds.map(n => n)}]};

const gps = time => ({view: "gps", system: 1, time: BEGAN + time, clock: time,
  info: {position: {lat: 50 + time * 2 * METRE, lon: 7, relative_alt: time}, velocity: {}, heading: 0}});

/** A replay of a vehicle that climbs 1 m/s; `wanted` are the spans that were fetched. */
async function opened(views = time => [gps(time)]) {
  const wanted = [], fleet = new Fleet();
  const api = {get: async path => {
    if (path.endsWith("/overview")) return overview;
    const query = new URLSearchParams(path.split("?")[1]), at = Number(query.get("at"));
    const end = at + Number(query.get("seconds"));
    wanted.push([at, end]);
    const times = seconds.flatMap(n => [n, n + 0.5]).filter(n => n >= at && n < end);
    return {events: times.flatMap(views)};
  }};
  const timer = globalThis.setInterval;
  globalThis.setInterval = () => 0; // the tests turn it themselves
  const replay = new Replay(/** @type {any} */ (api), fleet, "it");
  await replay.open();
  globalThis.setInterval = timer;
  return {replay, fleet, wanted};
}

/** Act while the page's clock stands: a busy machine is slower than a moment of a fast replay. */
async function atOnce(act) {
  const at = performance.now();
  performance.now = () => at;
  try {
    await act();
  } finally {
    delete performance.now; // the prototype's own one is there again
  }
}

test("a jump shows what was told last before it, where it had been, and nothing of what comes later", async () => {
  const {replay, fleet} = await opened();
  await replay.jump(30.2);
  const vehicle = fleet.of(1);
  assert.deepEqual([vehicle.get("gps").position.relative_alt, vehicle.views.gps.at], [30, 30000]);
  assert.equal(vehicle.trail.length, 31);
  assert.deepEqual(vehicle.texts.map(one => one.text), ["ten"]);
  assert.ok(Math.abs(vehicle.curves.newest("speed").value - 2) < 0.01);
  await replay.jump(5);
  assert.deepEqual([vehicle.get("gps").position.relative_alt, vehicle.trail.length, vehicle.texts.length], [5, 6, 0]);
});

test("a jump that is overtaken by another one shows nothing", async () => {
  const {replay, fleet} = await opened();
  const first = replay.jump(50), second = replay.jump(20);
  await Promise.all([first, second]);
  assert.equal(fleet.of(1).get("gps").position.relative_alt, 20);
});

test("playing tells each event when its time comes, and asks for what follows before that", async () => {
  const {replay, fleet, wanted} = await opened();
  await atOnce(async () => {
    replay.play();
    await new Promise(resolve => setTimeout(resolve));
    await replay.turn();
    await replay.turn();
    const ahead = wanted.at(-1)[1];
    replay.base = 3.2;
    await replay.turn();
    assert.ok(ahead >= 5);
    assert.equal(fleet.of(1).get("gps").position.relative_alt, 3);
  });
  replay.stand();
  const {time} = replay;
  await new Promise(resolve => setTimeout(resolve, 30));
  assert.equal(replay.time, time);
  assert.equal(replay.clock(), time * 1000);
});

test("a fast replay goes from moment to moment, and its clock is that of the moment which is shown", async () => {
  const {replay, fleet} = await opened();
  await atOnce(async () => {
    replay.hurry(20);
    replay.play();
    await new Promise(resolve => setTimeout(resolve));
    replay.base = 41;
    await replay.turn();
    const {position} = fleet.of(1).get("gps");
    assert.ok(position.relative_alt >= 40.5 && replay.clock() >= 41000 && replay.clock() < 42000);
    replay.base = 42; // not a moment's time later
    await replay.turn();
    assert.equal(fleet.of(1).get("gps").position.relative_alt, position.relative_alt);
  });
});

test("the clock waits while what is to be shown is on its way, and stands at the end", async () => {
  const {replay} = await opened();
  replay.play();
  replay.isFetching = true;
  replay.fetched = 4;
  replay.base = 9;
  await replay.turn();
  assert.ok(replay.time >= 4 && replay.time < 4.5);
  replay.isFetching = false;
  replay.base = 60;
  await replay.turn();
  assert.deepEqual([replay.isPlaying, replay.time], [false, 60]);
});

test("a log of another program has no report of ours: its mode makes one", async () => {
  const status = {vehicle_type: "plane", mode: "AUTO", armed: true};
  const {replay, fleet} = await opened(time => [{view: "status", system: 1, time: BEGAN + time, clock: time,
    info: status}, {view: "unheard_of", system: 1, time: BEGAN + time, clock: time, info: {}}]);
  await replay.jump(20);
  const report = fleet.of(1).get("vehicle");
  assert.deepEqual([report.type, report.mode, report.armed], ["plane", "AUTO", true]);
  assert.ok(fleet.of(1).isAlive(replay.clock()));
});

test("a record that cannot be read says why", async () => {
  const api = {get: async () => { throw new Error("there is no flight 'x'"); }};
  const replay = new Replay(/** @type {any} */ (api), new Fleet(), "x");
  await replay.open();
  assert.equal(replay.trouble(0), "there is no flight 'x'");
});

test("nothing but a reading goes out of a replay", async () => {
  const sent = [], own = globalThis.fetch;
  globalThis.fetch = async address => { sent.push(address); return new Response("{}"); };
  const api = new ReplayApi();
  await api.get("/flights");
  const refused = [() => api.command("/vehicles/1/command/land"), () => api.call("DELETE", "/jobs/1"),
    () => api.urgent("/fleet/brake"), () => api.stop("/movement/stop"), () => api.urgently("POST", "/x")];
  for (const id of ["../command/arm#", "..%2fcommand%2farm", "x/../../command/arm?", "//evil/x", "x y"]) {
    refused.push(() => api.get(`/flights/${id}/overview`));
  }
  refused.push(() => api.get("/command/arm"), () => api.blob("/vehicles/1/command/takeoff?alt=5"));
  for (const call of refused) {
    assert.equal(await call().catch(error => error.message), "this is a replay: nothing can be commanded");
  }
  globalThis.fetch = own;
  assert.deepEqual(sent, ["./flights"]);
});
