import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/mission.js";
import {rig, settle} from "../support/rig.js";
import "#page/map/top_view.js";

test("not read is not \"none\", and no start is offered on it", async () => {
  const {asked, panels: [, plan]} = await rig("top-view", "mission-plan");
  const look = () => { plan.render(0); return plan.held.textContent; };
  const last = end => asked.filter(one => one.path.endsWith(end)).at(-1);
  const can = () => !plan.starter.hasAttribute("disabled");
  const words = [look(), can()];
  plan.dispatchEvent(new Event("opened")); words.push(look());
  await last("waypoints").refuse("no answer"); words.push(look(), can());
  await last("fence").answer({fence: null});
  plan.read(); await last("waypoints").answer({items: [{seq: 1}]}); words.push(look(), can());
  await last("fence").refuse("lost");
  plan.read(); await last("waypoints").answer({items: []}); words.push(look(), can());
  assert.deepEqual(words, ["The mission was not read yet.", false, "The mission is being read.",
    "The mission could not be read: no answer", false, "The vehicle holds 1 items.", true,
    "The vehicle holds no items.", false]);
});

test("somebody else's upload, or another number of items: the route goes, and is read anew", async () => {
  const {fleet, asked, job, tell, panels: [, plan]} = await rig("top-view", "mission-plan");
  const {mission} = fleet.chosen, reads = () => asked.filter(one => one.path.endsWith("waypoints"));
  const items = count => ({items: Array.from({length: count}, (_, n) => ({seq: n + 1}))});
  const answer = async count => {
    await reads().at(-1).answer(items(count));
    await asked.at(-1).answer({fence: null}); };
  plan.read(); await answer(2);
  plan.hidden = true;
  job(1, 1, "/mission/waypoints", "running");
  const during = mission.items.length;
  job(1, 1, "/mission/waypoints", "succeeded");
  const gone = mission.items;
  tell(1, "mission", {total: 2}, 0);
  tell(1, "mission", {total: 3}, 1); // it comes while the mission is read
  await answer(3);
  const byJob = [reads().length, mission.items.length];
  tell(1, "mission", {total: 3}, 2);
  job(2, 2, "/mission/waypoints", "succeeded");
  const same3 = reads().length;
  tell(1, "mission", {total: 5}, 3); await answer(5);
  assert.deepEqual([during, gone, byJob, same3, reads().length, mission.items.length],
    [2, null, [2, 3], 2, 3, 5]);
});

test("rally points are read after the fence, and one lost read takes none away", async () => {
  const {fleet, asked, panels: [, plan]} = await rig("top-view", "mission-plan");
  const last = end => asked.filter(one => one.path.endsWith(end)).at(-1);
  const read = async () => {
    plan.read(); await last("waypoints").answer({items: []}); await last("fence").refuse("lost"); };
  await read(); await last("rally").answer({points: [{seq: 1, lat: 1, long: 2, alt: 3}]});
  const held = () => fleet.chosen.rally.map(one => [one.seq, Boolean(one.isOld)]);
  const first = held();
  await read(); await last("rally").refuse("lost");
  assert.deepEqual([first, held()], [[[1, false]], [[1, true]]]);
});

test("what the vehicle holds can be edited, and goes out as it was read", async () => {
  localStorage.clear();
  const {asked, panels: [, plan]} = await rig("top-view", "mission-plan");
  plan.render(0);
  const none = plan.editor.disabled;
  plan.read();
  await asked.at(-1).answer({items: [{seq: 1, command: "NAV_TAKEOFF", frame: "relative", lat: 0, long: 0, alt: 9},
    {seq: 2, command: "NAV_WAYPOINT", frame: "relative", param1: 4, lat: 1, long: 2, alt: 9},
    {seq: 3, command: "DO_SPRAYER", frame: "mission", param1: 1}]});
  plan.render(0);
  plan.edit();
  plan.upload.dispatchEvent(new Event("confirmed"));
  await settle();
  const {path, options} = asked.find(one => one.method === "POST");
  assert.deepEqual([none, path, options.json.items.map(one => [one.command, one.frame, ...one.params])],
    [true, "/vehicles/1/mission/waypoints?wait=false", [[22, 3, 0, 0, 0, 0, 0, 0, 9], [16, 3, 4, 0, 0, 0, 1, 2, 9],
      ["DO_SPRAYER", 2, 1, 0, 0, 0, 0, 0, 0]]]);
});

test("a draft is tried on a simulated vehicle once it is uploaded, and the way that it took is drawn", async () => {
  localStorage.clear();
  const {fleet, asked, job, context, panels: [, plan]} = await rig("top-view", "mission-plan");
  const tries = () => asked.filter(one => one.path.endsWith("/rehearsals"));
  const confirm = async button => {
    plan.drawn.take([{command: 22, frame: 3, params: [0, 0, 0, 0, 0, 0, 9]}]);
    button.dispatchEvent(new Event("confirmed"));
    await settle();
    const number = asked.length;
    await asked.findLast(one => one.method === "POST").answer({job: number});
    return number;
  };
  job(1, await confirm(plan.upload), "/mission/waypoints", "succeeded");
  const plain = tries().length;
  const number = await confirm(plan.trial), before = tries().length;
  job(1, number, "/mission/waypoints", "succeeded");
  const [tried] = tries();
  await tried.answer({under_way: "", newest: {name: "mission.waypoints", verdict: "broken", way: [[1, 2, 9]],
    broken: [{rule: "envelope", at: 4, sentence: "out of it"}], duration_s: 9, distance_m: 8, highest_m: 7}});
  const {tried: way} = context.sketch;
  assert.deepEqual([plain, before, tried.method, tried.path, way, plan.answer.textContent.includes("out of it")],
    [0, 0, "POST", "/vehicles/1/rehearsals", [[1, 2, 9]], true]);
  fleet.choose(2);
  assert.deepEqual(context.sketch.tried, []);
});

test("progress that comes no longer is grey and says its age", async () => {
  const {tell, alive, panels: [, plan]} = await rig("top-view", "mission-plan");
  tell(1, "mission", {current: 3, total: 5, state: "active", distance_m: 20}, 0);
  plan.render(100);
  const fresh = [plan.progress.textContent, plan.progress.className];
  alive(9000); plan.render(9000);
  assert.deepEqual([...fresh, plan.progress.textContent, plan.progress.className],
    [" Item 3 of 5, active, 20 m to go", "", " Item 3 of 5, active, 20 m to go, 9.0 s old", "old"]);
});
