import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/actions.js";
import {Fleet} from "#page/model/fleet.js";

test("what stops takes no turn", async () => {
  const fleet = new Fleet(), calls = [];
  fleet.of(3); fleet.choose(3);
  const kept = name => path => { calls.push([name, path]); return new Promise(() => {}); };
  const panel = document.createElement("flight-actions");
  panel.start({fleet, preferences: {alt: 10}, api: {stop: kept("stop"), command: kept("command")}});
  for (const one of [panel.brake, panel.stop]) one.click();
  for (const one of [panel.land, panel.rtl, panel.disarm, panel.takeoff]) {
    one.dispatchEvent(new Event("confirmed"));
  }
  assert.deepEqual(calls, [["stop", "command/brake"], ["stop", "movement/stop"], ["stop", "command/land"],
    ["stop", "command/rtl"], ["stop", "command/disarm"], ["command", "command/takeoff"]]
    .map(([way, path]) => [way, `/vehicles/3/${path}`]));
});
