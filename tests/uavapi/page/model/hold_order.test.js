import {test} from "node:test";
import assert from "node:assert/strict";
import {HoldOrder} from "#page/model/hold_order.js";
import {Fleet} from "#page/model/fleet.js";

function copter() {
  const fleet = new Fleet(), link = {alive: true, heartbeat_age_s: 0};
  return {fleet, told: (mode, at) => fleet.of(1).take("vehicle", {type: "copter", mode, armed: true, link}, at)};
}

test("an answer of the API counts until the vehicle tells of another mode; then nothing is said of now", async () => {
  const {fleet, told} = copter();
  told("GUIDED", 900);
  const o = new HoldOrder(fleet, 1000);
  o.answered({1: {status: 200}}, 1500);
  const kinds = [o.standing(1500).kind];
  told("GUIDED", 1600); kinds.push(o.standing(1700).kind); // on its way before the answer
  told("BRAKE", 2000); kinds.push(o.standing(2100).kind, / held/.test(o.standing(2100).head));
  told("GUIDED", 3000); kinds.push(o.standing(3100));
  assert.deepEqual(kinds, ["good", "good", "good", true, null]);
});

test("no answer is bad after 3 s, and good when it comes", async () => {
  const {fleet, told} = copter();
  told("GUIDED", 900);
  const o = new HoldOrder(fleet, 1000), early = o.standing(3900).kind, late = o.standing(4100);
  o.answered({1: {status: 200}}, 9000);
  assert.deepEqual([early, late.kind, late.missing], ["", "bad", ["vehicle 1: no answer"]]);
  assert.ok(o.standing(9000).kind === "good" && /NO ANSWER/.test(late.head));
});

test("what another vehicle lacks stays said", async () => {
  const {fleet, told} = copter();
  told("BRAKE", 2000);
  const o = new HoldOrder(fleet, 1000);
  o.answered({1: {status: 200}, 2: {status: 503, detail: "no heartbeat"}}, 1500);
  told("GUIDED", 3000);
  const missing = ["vehicle 1: flies again (GUIDED)", "vehicle 2: no heartbeat"];
  assert.deepEqual(o.standing(3100).missing, missing);
});
