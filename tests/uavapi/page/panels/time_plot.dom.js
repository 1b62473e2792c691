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
    ["Height, m: nothing was told yet", "Height, m: 20.0", "value", "Height, m: 20.0, 9.0 s old", "value old"]);
});

test("what is counted has no decimals, what is small has more", async () => {
  const {fleet, context} = await rig(), plot = new TimePlot();
  plot.start(context); document.body.append(plot);
  const says = (key, unit, value) => {
    plot.show({key, label: key, unit});
    fleet.of(1).curves.add(key, 0, value);
    plot.render(0);
    return plot.value.textContent;
  };
  const said = [says("satellites", "", 14), says("charge", "%", 93), says("alt", "m", 12), says("heading", "°", 233),
    says("climb", "m/s", 0), says("speed", "m/s", 0.25)];
  assert.deepEqual(said, ["14", "93", "12.0", "233", "0.0", "0.250"]);
});
