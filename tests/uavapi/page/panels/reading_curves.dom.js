import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/reading_curves.js";
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
