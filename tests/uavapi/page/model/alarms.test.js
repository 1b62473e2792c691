import {test} from "node:test";
import assert from "node:assert/strict";
import {Alarms} from "#page/model/alarms.js";
import {Caller} from "#page/model/caller.js";
import {Fleet} from "#page/model/fleet.js";

function heard() {
  const fleet = new Fleet(), caller = new Caller(), told = [];
  caller.take({name: "anna", role: "fly"});
  const made = {fleet, told, at: 100000};
  made.alarms = new Alarms(fleet, caller, () => made.at);
  made.alarms.addEventListener("alarm", ({detail: {kind, text}}) => told.push(`${kind}: ${text}`));
  made.take = (event, info, age = 0, system = 1) => fleet.take({event, system, info}, made.at - age);
  made.left = percent => fleet.take({view: "vehicle", system: 1, info: {battery_remaining: percent}}, made.at);
  return made;
}

test("a mode that no job has switched is told; that of a job, the same one again, and an old one are not", () => {
  const {take, told} = heard();
  const job = (number, state) => ({job: number, verb: "/command/land", client: "bo", state, progress: {},
    result: ""});
  take("mode", {mode: "GUIDED"}, 20000);
  take("job", job("1", "running"));
  take("mode", {mode: "LAND"});
  take("job", job("1", "succeeded"), 4500);
  take("mode", {mode: "QLOITER_X"});
  take("mode", {mode: "QLOITER_X"});
  assert.deepEqual(told, ["mode: vehicle 1 was switched to QLOITER X"]);
});

test("the end of one's own job is told, not that of another's, nor an old one that is told after a reconnection",
  () => {
  const {take, told} = heard();
  const job = more => ({job: "1", verb: "/command/takeoff", client: "anna", state: "succeeded", progress: {},
    result: "Vehicle at 10.000001 m", ...more});
  take("job", job({state: "running"}));
  take("job", job({}));
  take("job", job({client: "script"}));
  take("job", job({}), 20000);
  take("job", job({state: "failed", error: {detail: "`arm` first"}}));
  assert.deepEqual(told, ["job: vehicle 1: take-off: Vehicle at 10.0 m", "job: vehicle 1: take-off: Arm first"]);
});

test("a battery is told at each limit once, and again after another one is put in", () => {
  const {left, told} = heard();
  for (const percent of [40, 24, 23, 25, 24, 14, 9, 8, 100, 20, null]) left(percent);
  assert.deepEqual(told.map(one => one.match(/(\d+) percent/)[1]), ["24", "24", "14", "9", "20"]);
});

test("a link that is lost and back, and data that no longer come, are told once each", () => {
  const {take, left, told, alarms} = heard();
  left(90);
  take("link", {alive: false});
  take("link", {alive: true});
  for (const trouble of ["", "silent", "silent", "", ""]) alarms.look(trouble);
  assert.deepEqual(told, ["link: vehicle 1: link lost", "link: vehicle 1: the link is back",
    "link: no live data: silent", "link: live data again"]);
});
