import {test} from "node:test";
import assert from "node:assert/strict";
import {axisOf} from "#page/base/curve.js";

test("an axis fits its values", () => {
  assert.deepEqual(axisOf(0, 3), {bottom: 0, top: 3, step: 1});
});

test("an axis has at most four steps", () => {
  assert.deepEqual(axisOf(0, 12), {bottom: 0, top: 15, step: 5});
});

test("an axis reaches below zero", () => {
  assert.deepEqual(axisOf(-7, 3), {bottom: -10, top: 5, step: 5});
});

test("equal values have an axis, too", () => {
  assert.ok(axisOf(5, 5).top > axisOf(5, 5).bottom);
});

test("a fine axis has fine steps", () => {
  assert.ok(Math.abs(axisOf(21.5, 21.6).step - 0.05) < 1e-9);
});
