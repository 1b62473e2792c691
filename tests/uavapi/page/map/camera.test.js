import {test} from "node:test";
import assert from "node:assert/strict";
import {Camera} from "#page/map/camera.js";

test("pixels are metres and back", () => {
  const c = Object.assign(new Camera(), {width: 400, height: 300});
  assert.deepEqual(c.metres(...c.pixels([7, 9])), [7, 9]);
});

test("to zoom keeps the place under the pointer", () => {
  const c = Object.assign(new Camera(), {width: 400, height: 300}), before = c.metres(30, 40);
  c.zoom(2, 30, 40);
  const after = c.metres(30, 40);
  assert.ok(Math.hypot(before[0] - after[0], before[1] - after[1]) < 1e-9);
});

test("all places are brought in sight", () => {
  const c = Object.assign(new Camera(), {width: 400, height: 300}); c.keep([[0, 0], [900, 900]]);
  while (c.step(true));
  assert.ok(c.shows([900, 900]) && c.shows([0, 0]));
});

test("a view that controls cover, or of no size, has a scale all the same", () => {
  for (const height of [20, 0]) {
    const c = Object.assign(new Camera(), {width: 400, height, top: 50});
    c.keep([[0, 0], [900, 900]]);
    c.step(true);
    assert.ok(c.scale > 0 && Number.isFinite(c.north), String(c.scale));
  }
});
