import {test} from "node:test";
import assert from "node:assert/strict";
import {CommandPanel} from "#page/base/command_panel.js";
import {rig} from "../support/rig.js";

test("a job of the vehicle before ends nothing here, whether it was begun before or after the switch", async () => {
  let ended = 0;
  if (!customElements.get("a-panel")) customElements.define("a-panel", class extends CommandPanel {
    build() { this.append(this.answer); }
    succeeded() { ended += 1; } });
  const {fleet, api, asked, job, panels: [panel]} = await rig("a-panel");
  const begin = () => panel.begin(() => api.get("/begin"));
  begin(); await asked[0].answer({job: 1}); job(1, 1, "/a", "succeeded");
  const own = ended;
  begin(); await asked[1].answer({job: 2}); fleet.choose(2); job(1, 2, "/a", "succeeded");
  begin(); fleet.choose(1); await asked[2].answer({job: 3}); job(2, 3, "/a", "succeeded");
  begin(); fleet.choose(2); await asked[3].refuse("no");
  assert.deepEqual([own, ended, panel.answer.textContent], [1, 1, "vehicle 1: no"]);
});
