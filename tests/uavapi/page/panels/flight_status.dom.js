import {test} from "node:test";
import assert from "node:assert/strict";
import {commanderOf} from "#page/panels/flight_status.js";

test("in a mode of the pilot's own it is his", () => {
  assert.ok(commanderOf({mode: "LOITER", armed: true, commanded_by: null}) === "its pilot (LOITER)");
});

test("in guided without arms it is nobody's", () => {
  assert.ok(commanderOf({mode: "GUIDED", armed: false, commanded_by: null}) === "nobody");
});
