import {test} from "node:test";
import assert from "node:assert/strict";
import {freePlace, gridStep} from "#page/map/top_view_layers.js";

test("grid lines are round metres apart", () => {
  assert.ok(gridStep(1) === 100 && gridStep(10) === 10);
});

test("labels do not cover each other", () => {
  const taken = []; const ys = [0, 0, 3].map(y => freePlace(taken, 0, y, 50));
  assert.deepEqual(ys, [0, 15, 33]) || ys.every((y, n) => ys.slice(0, n).every(other => Math.abs(y - other) >= 15));
});
