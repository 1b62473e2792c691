import {test} from "node:test";
import assert from "node:assert/strict";
import {freePlace, gridStep} from "#page/map/top_view_layers.js";

test("grid lines are round metres apart", () => {
  assert.ok(gridStep(1) === 100 && gridStep(10) === 10);
});

test("labels cover neither each other nor a control", () => {
  const control = {x: 40, y: -10, width: 30, height: 60}, taken = [control];
  const ys = [0, 0, 3].map(y => freePlace(taken, 0, y, 50));
  const boxes = [control, ...ys.map(y => ({x: 0, y: y - 12, width: 50, height: 15}))];
  const clash = (a, b) => a.y < b.y + b.height && b.y < a.y + a.height;
  assert.ok(boxes.every((one, n) => boxes.slice(0, n).every(other => !clash(one, other))), JSON.stringify(ys));
  assert.equal(freePlace(taken, 100, 0, 50), 0);
});
