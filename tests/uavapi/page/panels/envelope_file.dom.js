import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/envelope_file.js";
import {rig, settle} from "../support/rig.js";
import "#page/map/top_view.js";

test("a file is drawn before it counts, goes to the vehicle that it is for, and is gone with another choice",
  async () => {
  const {fleet, asked, panels: [, panel]} = await rig("top-view", "envelope-file");
  const can = () => !panel.put.hasAttribute("disabled"), areas = id => fleet.vehicles.get(id).areas;
  const puts = () => asked.filter(one => one.method === "PUT");
  const ring = [[149.16, -35.36], [149.17, -35.36], [149.17, -35.35], [149.16, -35.36]];
  const geometry = {type: "Polygon", coordinates: [ring]};
  const envelope = {features: [{properties: {kind: "exclusion", name: "a"}, geometry}]};
  const files = [{arrayBuffer: async () => new ArrayBuffer(2)}];
  Object.defineProperty(panel.file, "files", {get: () => files});
  const choose = async () => { panel.file.dispatchEvent(new Event("change")); await settle(); };
  const seen = [can()], see = (...more) => seen.push(...more, can(), areas(1).proposed.length);
  await choose(); await puts()[0].answer({result: "read", envelope});
  see(puts()[0].path, panel.answer.textContent);
  fleet.choose(2); see(panel.answer.textContent);
  fleet.choose(1);
  await choose(); await puts()[1].answer({result: "read", envelope});
  panel.put.dispatchEvent(new Event("confirmed")); await puts()[2].answer({result: "in force"});
  see(puts()[2].path, areas(1).envelope.length, panel.answer.textContent);
  await choose(); await puts()[3].refuse("no areas");
  see(panel.answer.textContent);
  assert.deepEqual(seen, [false, "/vehicles/1/envelope?preview=true", "read", true, 1, "", false, 0,
    "/vehicles/1/envelope", 1, "in force", false, 0, "no areas", false, 0]);
});
