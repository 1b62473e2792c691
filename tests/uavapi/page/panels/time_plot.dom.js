import {test} from "node:test";
import assert from "node:assert/strict";
import {TimePlot} from "#page/panels/time_plot.js";
import {at, rig} from "../support/rig.js";

test("a plot says its newest value, and its age once that is old", async () => {
  const {context, tell, alive} = await rig(), plot = new TimePlot();
  plot.start(context); document.body.append(plot);
  plot.show({key: "alt", label: "Height", unit: "m"});
  plot.render(0);
  const none = plot.canvas.ariaLabel;
  tell(1, "gps", at(-35, 149), 0);
  plot.render(100);
  const fresh = [plot.canvas.ariaLabel, plot.value.className];
  alive(9000); plot.render(9000);
  assert.deepEqual([none, ...fresh, plot.canvas.ariaLabel, plot.value.className],
    ["Height, m: nothing was told yet", "Height, m: 20", "value", "Height, m: 20, 9.0 s old", "value old"]);
});
