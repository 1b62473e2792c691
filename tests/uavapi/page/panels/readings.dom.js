import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/readings.js";
import {rig} from "../support/rig.js";

test("at a lost link what the report tells is as old as the last heartbeat", async () => {
  const {fleet, panels: [readings]} = await rig("vehicle-readings");
  const link = {alive: false, heartbeat_age_s: 12, packet_loss: 0};
  fleet.take({system: 1, view: "vehicle", info: {link, ekf_ok: true}}, 9000);
  readings.render(9000);
  const age = label => readings.tiles.find(({tile}) => tile.firstChild.textContent === label).age.textContent;
  assert.deepEqual([age("EKF"), age("Link loss")], ["12 s old", "12 s old"]);
});
