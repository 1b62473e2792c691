import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/reading_curves.js";
import {StreamClock} from "#page/model/freshness.js";
import {rig} from "../support/rig.js";

test("a reading says its age", async () => {
  const {asked, panels: [curves]} = await rig("reading-curves");
  const began = performance.now();
  const looking = curves.look();
  const points = [[1, 21.5]];
  await asked[0].answer({series: [{device: "a", quantity: "heat", representation: "C", points}]});
  await looking;
  const figure = curves.querySelector("figure");
  curves.render(began + 200);
  const fresh = [figure.innerText.includes("old"), figure.classList.contains("old")];
  curves.render(began + 30000);
  const stale = [/21.50 C (29|30) s old/.test(figure.innerText), figure.classList.contains("old"),
    /heat: 21.50, (29|30) s old/.test(figure.querySelector("canvas").ariaLabel)];
  assert.deepEqual([...fresh, ...stale], [false, false, true, true, true]);
});

test("a browser's clock that is hours off, or a device's that is ahead, hides no reading", async () => {
  const {asked, context, panels: [curves]} = await rig("reading-curves"), clock = new StreamClock();
  Object.assign(context.stream, {clock});
  const wall = Date.now() - 5 * 3600_000, sent = 1000; // the server's clocks, ms
  clock.learn(sent, performance.now(), wall);
  const look = async series => {
    const looking = curves.look();
    await asked.at(-1).answer({series});
    await looking;
    return Number(asked.at(-1).path.split("=")[1]) * 1000 - wall;
  };
  const ahead = {device: "a", quantity: "heat", representation: "C", points: [[wall / 1000 + 3600, 1]]};
  const since = [await look([ahead]), await look([ahead]), await look([])];
  assert.ok(since[0] < -119_000 && since[0] > -125_000); // two minutes before the server's now
  assert.ok(since[2] < 60_000);
  assert.equal(curves.curves.get("a heat").points.length, 1);
});
