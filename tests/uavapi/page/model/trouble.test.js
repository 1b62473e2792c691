import {test} from "node:test";
import assert from "node:assert/strict";
import {Vehicle} from "#page/model/fleet.js";
import {troubleOf} from "#page/model/trouble.js";

function told(more) {
  const vehicle = new Vehicle(1), link = {alive: true, packet_loss: 0};
  vehicle.take("vehicle", {armed: true, ekf_ok: true, battery_remaining: 80, link, ...more}, 0);
  return vehicle;
}

test("a vehicle is in trouble for what it tells, and when it tells nothing", () => {
  const trouble = more => troubleOf(told(more), 100);
  const link = (alive, packet_loss) => ({link: {alive, packet_loss}});
  assert.deepEqual([{}, {battery_remaining: 24}, {battery_remaining: null}].map(trouble), ["", "battery low", ""]);
  assert.deepEqual([{ekf_ok: false}, {ekf_ok: false, armed: false}].map(trouble), ["EKF not ok", ""]);
  assert.deepEqual([link(true, 0.12), link(false, 0)].map(trouble), ["12 % lost", "silent"]);
  assert.equal(troubleOf(told({}), 60_000), "silent");
});

test("a critical text is trouble for half a minute, a warning is not", () => {
  const vehicle = told({});
  vehicle.texts.push({at: 0, severity: 2, text: "Crash"}, {at: 10, severity: 4, text: "Bad compass"});
  const report = vehicle.get("vehicle"), words = [100, 31_000].map(at => {
    vehicle.take("vehicle", report, at);
    return troubleOf(vehicle, at);
  });
  assert.deepEqual(words, ["Crash", ""]);
});

test("why it could not be armed is no trouble once it is", () => {
  const vehicle = told({armed: true});
  vehicle.texts.push({at: 1000, severity: 2, text: "PreArm: AHRS: waiting for home"});
  assert.equal(troubleOf(vehicle, 1000), "");
  vehicle.get("vehicle").armed = false;
  assert.equal(troubleOf(vehicle, 1000), "PreArm: AHRS: waiting for home");
});
