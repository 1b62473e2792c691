import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/flight_status.js";
import {rig} from "../support/rig.js";

test("a mode that nobody here has asked for is told with who switched it, until one is asked for", async () => {
  const {fleet, panels: [status]} = await rig("flight-status");
  const time = "2026-01-02T03:04:05+00:00";
  const say = (vehicle, by, sentence) =>
    fleet.take({event: "history", system: vehicle, info: {kind: "mode", vehicle, by, sentence, time}}, 0);
  const words = () => { status.render(0); return status.switched.textContent.replace(/^[\d:]+ /, ""); };
  const before = words();
  say(2, "pilot", "vehicle 2 changes from AUTO to RTL, by its pilot");
  const other = words();
  say(1, "failsafe", "vehicle 1 changes from AUTO to LAND, by a failsafe <b>");
  const its = words();
  say(1, "client", "vehicle 1 changes from LAND to GUIDED, by guided of anna");
  assert.deepEqual([before, other, its, words()],
    ["", "", "vehicle 1 changes from AUTO to LAND, by a failsafe <b>", ""]);
});
