import {test} from "node:test";
import assert from "node:assert/strict";
import {watchModules} from "#page/net/modules.js";
import {rig} from "../support/rig.js";

test("one failed read takes no border away; it is an old one then", async () => {
  const {fleet, asked, context} = await rig();
  watchModules(context, {offer() {}}, {});
  const look = () => { fleet.dispatchEvent(new Event("chosen")); return asked.slice(-2); };
  const geometry = {type: "Polygon", coordinates: [[[1, 2]]]};
  let [fence, envelope] = look();
  await fence.answer({parameters: {FENCE_ENABLE: 1, FENCE_TYPE: 2, FENCE_RADIUS: 90}});
  await envelope.answer({envelopes: [{envelope: {features: [{properties: {}, geometry}]}}]});
  [fence, envelope] = look();
  await fence.refuse("no"); await envelope.refuse("no");
  const {fence: circle, areas} = fleet.chosen;
  const kept = [circle.radius, circle.isOld, areas.envelope.length, areas.envelope[0].isOld];
  [fence, envelope] = look();
  await fence.answer({parameters: {}}); await envelope.answer({envelopes: []});
  assert.deepEqual([...kept, fleet.chosen.fence, areas.envelope.length], [90, true, 1, true, null, 0]);
});

test("home is asked for once, and again after arming has moved it, or where no answer came", async () => {
  const {fleet, tell, asked, context} = await rig();
  watchModules(context, {offer() {}}, {});
  const homes = () => asked.filter(one => one.path === "/vehicles/1/telemetry/home_info");
  const look = () => { fleet.dispatchEvent(new Event("chosen")); return homes().length; };
  const arm = armed => tell(1, "vehicle", {armed}, 0), counts = [];
  arm(false);
  counts.push(look()); await homes()[0].refuse("no");
  counts.push(look()); await homes()[1].answer({lat: 1});
  counts.push(look());
  arm(true);
  counts.push(look()); await homes()[2].answer({lat: 1});
  counts.push(look());
  assert.deepEqual(counts, [1, 2, 2, 3, 3]);
});
