import {test} from "node:test";
import assert from "node:assert/strict";
import {isInside} from "#page/plan/geometry.js";

test("a place in the notch of a ring is outside, one in its arm inside, in either order of the corners", () => {
  const ring = [[0, 0], [10, 0], [10, 10], [5, 5], [0, 10]], places = [[2, 2], [5, 8], [9, 8], [-1, 5], [11, 5]];
  const wanted = [true, false, true, false, false];
  assert.deepEqual(places.map(place => isInside(ring, place)), wanted);
  assert.deepEqual(places.map(place => isInside([...ring].reverse(), place)), wanted);
});
