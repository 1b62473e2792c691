import {test} from "node:test";
import assert from "node:assert/strict";
import {commanderOf, has} from "#page/model/verbs.js";

test("in a mode of the pilot's own it is his", () => {
  assert.equal(commanderOf({mode: "LOITER", armed: true, commanded_by: null}), "its pilot (LOITER)");
});

test("in guided without arms it is nobody's", () => {
  assert.equal(commanderOf({mode: "GUIDED", armed: false, commanded_by: null}), "nobody");
});

test("a job is told in words, with who asked for it", () => {
  const job = {verb: "/movement/go_to_gps_wait", client: "anna", job: "7"};
  assert.equal(commanderOf({paused: true, commanded_by: job}), "go to a place, asked by anna (job 7), stopped");
});

test("a rover has no take-off; a type that was not told yet has everything", () => {
  assert.deepEqual([has("takeoff", "rover"), has("rtl", "rover"), has("takeoff", undefined)], [false, true, true]);
});
