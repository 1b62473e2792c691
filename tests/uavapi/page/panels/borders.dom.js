import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/borders.js";
import {rig, settle} from "../support/rig.js";
import "#page/map/top_view.js";

const RING = [[149.16, -35.36], [149.17, -35.36], [149.17, -35.35], [149.16, -35.36]];
const FIELD = {properties: {kind: "inclusion", name: "field", ceiling: 60}, geometry: {type: "Polygon",
  coordinates: [RING]}};
const ENVELOPE = {type: "FeatureCollection", features: [FIELD], limits: {speed: 5}};

async function editing(kind = "envelope") {
  localStorage.clear();
  const made = await rig("top-view", "border-editor"), {context, panels: [, panel]} = made;
  panel.what.value = kind;
  panel.what.dispatchEvent(new Event("change"));
  panel.render(0);
  const asked = method => made.asked.filter(one => one.method === method);
  const can = () => { panel.render(0); return !panel.put.hasAttribute("disabled"); };
  const confirm = async button => { button.dispatchEvent(new Event("confirmed")); await settle(); };
  return {...made, panel, sketch: context.sketch, calls: asked, can, confirm};
}

test("a file is drawn before it counts, goes to the vehicle that it is for, and is kept for that only",
  async () => {
  const {fleet, panel, sketch, calls, can, confirm} = await editing();
  const files = [{arrayBuffer: async () => new ArrayBuffer(2)}];
  Object.defineProperty(panel.file, "files", {get: () => files});
  const choose = async () => { panel.file.dispatchEvent(new Event("change")); await settle(); };
  const seen = [can()], see = (...more) => seen.push(...more, can(), sketch.areas.length);
  await choose(); await calls("PUT")[0].answer({result: "read", envelope: ENVELOPE});
  see(calls("PUT")[0].path, panel.answer.textContent);
  fleet.choose(2); see(panel.answer.textContent);
  fleet.choose(1); see();
  await choose(); await calls("PUT")[1].answer({result: "read", envelope: ENVELOPE});
  await confirm(panel.put); await calls("PUT")[2].answer({result: "in force"});
  see(calls("PUT")[2].path, calls("PUT")[2].options.json.limits.speed, panel.answer.textContent);
  await choose(); await calls("PUT")[3].refuse("no areas");
  see(panel.answer.textContent);
  assert.deepEqual(seen, [false, "/vehicles/1/envelope?preview=true", "read", true, 1, "", false, 0, true, 1,
    "/vehicles/1/envelope", 5, "in force", false, 0, "no areas", false, 0]);
});

test("an area that is drawn, with its ceiling, is put in force as GeoJSON", async () => {
  const {panel, sketch, calls, can, confirm} = await editing();
  panel.pens.area.click();
  for (const [lat, lon] of [[0, 0], [1, 0], [1, 1]]) sketch.tool.add({lat, lon});
  const input = panel.rows.querySelector("[aria-label^=ceiling]");
  input.value = "40";
  input.dispatchEvent(new Event("change"));
  const ready = can();
  await confirm(panel.put);
  const [{path, options: {json}}] = calls("PUT");
  assert.deepEqual([ready, path, json.features.map(one => one.properties),
    json.features[0].geometry.coordinates[0].length],
    [true, "/vehicles/1/envelope", [{kind: "inclusion", ceiling: 40}], 4]);
});

test("a fence of two areas to stay in says that both count, and is read anew when it is uploaded", async () => {
  const {fleet, panel, sketch, calls, confirm, job} = await editing("fence");
  panel.take([1, 2].map(id => ({id, name: "", inclusion: true, rings: [[[0, 0], [1, 0], [1, 1]]], centre: null,
    radius: 0,
    floor: -Infinity, ceiling: Infinity})), {limits: {height: null}});
  await confirm(panel.put);
  const [{path, options: {json}, answer}] = calls("POST");
  await answer({job: "4"});
  job(1, "4", "/mission/fence", "succeeded");
  assert.deepEqual([path, json.every, json.limits, fleet.chosen.mission.isWanted, sketch.areas],
    ["/vehicles/1/mission/fence?wait=false", true, undefined, true, []]);
});

test("rally points that the vehicle holds are moved and sent again", async () => {
  const {panel, sketch, calls, confirm} = await editing("rally");
  panel.edit();
  await calls("GET").at(-1).answer({points: [{seq: 1, frame: "relative", lat: 1, long: 2, alt: 30}]});
  panel.pens.point.click();
  sketch.tool.move(sketch.tool.handles()[0].key, {lat: 3, lon: 4});
  sketch.tool.keep();
  await confirm(panel.put);
  assert.deepEqual([calls("POST")[0].path, calls("POST")[0].options.json],
    ["/vehicles/1/mission/rally?wait=false", {points: [{lat: 3, long: 4, alt: 30}]}]);
});

test("whose role is fly may put rally points, and no envelope; what stands under the button says why", async () => {
  const {context, panel, can} = await editing();
  context.caller.take({name: "anna", role: "fly"});
  panel.take([{id: 1, name: "", inclusion: true, rings: [[[0, 0], [1, 0], [1, 1]]], centre: null}]);
  assert.deepEqual([can(), panel.put.getAttribute("why")], [false, "needs the role admin"]);
});
