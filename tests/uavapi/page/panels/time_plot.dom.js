import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/time_plot.js";
import {at, rig} from "../support/rig.js";

test("a curve says its newest value, and its age once that is old", async () => {
  const {fleet, tell, alive} = await rig(), plot = document.createElement("time-plot");
  plot.setAttribute("curve", "alt"); plot.setAttribute("label", "Height, m");
  plot.start({fleet, stream: {trouble: () => ""}}); document.body.append(plot);
  tell(1, "gps", at(-35, 149), 0);
  plot.render(100);
  const fresh = plot.canvas.ariaLabel;
  alive(9000); plot.render(9000);
  assert.deepEqual([fresh, plot.canvas.ariaLabel], ["Height, m: 20.0", "Height, m: 20.0, 9.0 s old"]);
});
