import {test} from "node:test";
import assert from "node:assert/strict";
import {Painter} from "#page/base/painter.js";

const frame = () => new Promise(resolve => requestAnimationFrame(resolve));

test("what a hand moves is drawn in each frame, once", async () => {
  let drawn = 0;
  const painter = new Painter(() => { drawn += 1; });
  painter.touch();
  await frame();
  await frame();
  const before = drawn;
  for (let n = 0; n < 10; n += 1) {
    painter.touch(); // as a pointer that moves does, once or more in each frame
    painter.touch();
    await frame();
  }
  await frame();
  assert.deepEqual([before, drawn - before], [1, 10]);
});

test("news are drawn soon, and a drawing by hand does not draw them once more", async () => {
  let drawn = 0;
  const painter = new Painter(() => { drawn += 1; });
  painter.news();
  painter.touch();
  await frame();
  await frame();
  assert.equal(drawn, 1);
});
