import {test} from "node:test";
import assert from "node:assert/strict";
import {demandOf, isHeld, padOf, turned} from "#page/model/stick.js";

const pad = (axes = [0, 0, 0, 0], pressed = [], more = {}) => /** @type {any} */ ({axes, connected: true,
  mapping: "standard", buttons: Array.from({length: 16}, (_, n) => ({pressed: pressed.includes(n)})), ...more});

test("only a pad that is there and whose layout is known counts", () => {
  const [gone, odd, good] = [pad([], [], {connected: false}), pad([], [], {mapping: ""}), pad()];
  assert.deepEqual([padOf([null, gone, odd]), padOf([null, gone, odd, good])], [null, good]);
});

test("only a shoulder button is the dead man's, and no pad holds none", () => {
  const held = [pad([0], [0, 1, 2, 3, 6, 7]), pad([], [4]), pad([], [5]), null].map(isHeld);
  assert.deepEqual(held.map(Boolean), [false, true, true, false]);
});

test("sticks that rest ask for nothing; at their ends for all; up is minus down, and half as fast", () => {
  const ask = axes => {
    const {front, right, down, turn} = demandOf(pad(axes), 4);
    return [front, right, down, turn];
  };
  assert.deepEqual([ask([0.1, -0.11, 0.12, -0.09]), ask([1, -1, 1, -1]), ask([-1, 1, -1, 1]), ask([])],
    [[0, 0, 0, 0], [4, 4, -2, 60], [-4, -4, 2, -60], [0, 0, 0, 0]]);
  const [half] = ask([0, 0, 0, -0.56]);
  assert.ok(half > 0.9 && half < 1.1); // fine near the middle
  assert.deepEqual(ask([0, 0, 7, 0]), [0, 4, 0, 0]); // a pad that tells too much
});

test("a turn goes over north, and never runs far ahead of the vehicle", () => {
  assert.deepEqual([turned(355, 10, 350), turned(5, -10, 0), turned(90, 40, 45), turned(300, -40, 350)],
    [5, 355, 105, 290]);
});
