import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/mission.js";
import {rig, settle} from "../support/rig.js";

const CORNERS = [[0, 0], [0.001, 0], [0.001, 0.001], [0, 0.001]].map(([lat, lon]) => ({lat, lon}));

/** Two chosen vehicles, and a grid that is shared among them. */
async function shared(end = sketch => sketch) {
  localStorage.clear();
  const made = await rig("mission-plan"), {context, fleet, api, panels: [plan]} = made, sent = [];
  fleet.dispatchEvent(new Event("chosen"));
  fleet.chooseAll();
  plan.drawn.pattern.buttons.grid.click();
  for (const corner of CORNERS) context.sketch.tool.add(corner);
  plan.render(0);
  const {sharer} = plan.drawn.pattern, label = sharer.textContent;
  if (end(context.sketch)) sharer.click();
  plan.render(0);
  api.call = (method, path, {json}) => new Promise((answer, refuse) => {
    sent.push({path, json, answer, refuse: why => refuse(new Error(why))});
  });
  return {...made, plan, label, sent, sketch: context.sketch};
}

const why = button => button.getAttribute("why");

test("a grid is shared among the chosen vehicles, each with a take-off and a return, in its own draft", async () => {
  const {plan, label, sketch} = await shared(), commands = id => plan.drawn.of(id).items.map(item => item.command);
  const kept = JSON.parse(localStorage.getItem("uavapi-draft-2"));
  assert.deepEqual([label, commands(1), commands(2)], ["Share it among 1, 2", [22, ...Array(6).fill(16), 20],
    [22, ...Array(6).fill(16), 20]]);
  assert.deepEqual([kept.length, sketch.others.map(items => items.length), sketch.draft.length], [8, [8], 8]);
  assert.equal(plan.fleet.who.textContent, "Drafts of several: 1 (8 items), 2 (8 items)");
});

test("Done shares it, too, as several are chosen", async () => {
  const {plan} = await shared(sketch => sketch.tool.complete());
  assert.deepEqual([1, 2].map(id => plan.drawn.of(id).items.length), [8, 8]);
});

test("what another vehicle's draft has already stays in it", async () => {
  const {plan} = await shared();
  plan.drawn.fill(2, plan.drawn.of(2).items.slice(1, 3));
  assert.deepEqual(plan.drawn.of(2).items.map(item => item.command), [22, ...Array(8).fill(16), 20]);
});

test("drafts of several go up at once; one that was taken is empty, one that was refused stays", async () => {
  const {plan, sent, job} = await shared();
  plan.fleet.upload.dispatchEvent(new Event("confirmed"));
  const both = sent.map(({path, json}) => [path, json.items.length, json.items[1].command]);
  sent[0].answer({status: 202, job: "7"});
  sent[1].refuse("outside");
  await settle();
  job(1, "7", "/mission/waypoints", "succeeded");
  plan.render(0);
  const lengths = [1, 2].map(id => plan.drawn.of(id).items.length);
  const answers = [...plan.fleet.answers.children].map(one => [one.className, one.textContent]);
  assert.deepEqual(both, [1, 2].map(id => [`/vehicles/${id}/mission/waypoints?wait=false`, 8, 16]));
  assert.deepEqual(lengths, [0, 8]);
  assert.deepEqual(answers, [["good", "vehicle 1: upload: done"], ["bad", "vehicle 2: upload: outside"]]);
});

test("missions of several are started only when each was read, holds one and is armed", async () => {
  const {plan, fleet, tell, sent} = await shared(), said = [];
  const look = () => { plan.render(0); said.push(why(plan.fleet.starter)); };
  look();
  fleet.of(1).mission.items = [{}];
  fleet.of(2).mission.items = [];
  look();
  fleet.of(2).mission.items = [{}];
  tell(2, "vehicle", {...fleet.of(2).get("vehicle"), armed: false}, 1);
  look();
  tell(2, "vehicle", {...fleet.of(2).get("vehicle"), armed: true}, 2);
  look();
  plan.fleet.starter.dispatchEvent(new Event("confirmed"));
  assert.deepEqual(said, ["1, 2: not read yet", "2: holds none", "arm 2 first", null]);
  assert.deepEqual(sent.map(({path}) => path), [1, 2].map(id => `/vehicles/${id}/mission/start?wait=false`));
});

test("with one vehicle chosen there is one draft, and one start", async () => {
  const {plan, fleet} = await shared();
  const several = [plan.fleet.hidden, plan.one.hidden, plan.starter.hidden];
  fleet.choose(2);
  plan.render(0);
  const one = [plan.fleet.hidden, plan.one.hidden, plan.starter.hidden];
  assert.deepEqual([several, one, plan.drawn.draft.items.length], [[false, true, true], [true, false, false], 8]);
});
