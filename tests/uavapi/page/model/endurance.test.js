import {test} from "node:test";
import assert from "node:assert/strict";
import {Endurance} from "#page/model/endurance.js";

const MINUTE = 60000;

/** One percent is used in each half minute, from 90 % at 0. */
function used(percents) {
  const endurance = new Endurance();
  for (let n = 0; n <= percents; n += 1) endurance.take(n * MINUTE / 2, 90 - n, true);
  return endurance;
}

test("minutes left follow from the pace, and run down between two percents", () => {
  const endurance = used(10);
  assert.deepEqual([endurance.minutes(5 * MINUTE), endurance.minutes(5.25 * MINUTE)], [40, 39.75]);
});

test("nothing is said before there is a pace, on the ground, or after another battery", () => {
  const early = used(2), ground = used(10), another = used(10);
  ground.take(6 * MINUTE, 80, false);
  another.take(6 * MINUTE, 100, true);
  assert.deepEqual([early, ground, another, new Endurance()].map(one => one.minutes(6 * MINUTE)),
    [null, null, null, null]);
});

test("what is not known is no charge, and only the last ten minutes count", () => {
  const endurance = used(10);
  for (let n = 1; n <= 12; n += 1) endurance.take((5 + n) * MINUTE, 80 - n, true);
  assert.equal(Math.round(endurance.minutes(17 * MINUTE)), 68); // a percent in a minute
  endurance.take(18 * MINUTE, null, true);
  assert.equal(endurance.minutes(18 * MINUTE), null);
});
