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

test("the wind is shown where a vehicle tells it: from where, and how strong; an old one says so", async () => {
  const {fleet, alive, panels: [readings]} = await rig("vehicle-readings");
  const look = at => {
    readings.render(at);
    const {tile, value, age} = readings.tiles.find(one => one.tile.firstChild.textContent === "Wind");
    return [value.textContent, age.textContent, tile.classList.contains("old")];
  };
  const unknown = look(0);
  fleet.take({system: 1, name: "WIND", fields: {direction: -90, speed: 5.24, speed_z: 0}}, 0);
  const fresh = look(100);
  alive(9000);
  const old = look(9000);
  fleet.take({system: 1, name: "WIND", fields: {direction: null, speed: 5, speed_z: 0}}, 9000);
  assert.deepEqual([unknown, fresh, old, look(9000)], [["–", "", true], ["270° 5.2", "", false],
    ["270° 5.2", "9.0 s old", true], ["–° 5.0", "", false]]);
});
