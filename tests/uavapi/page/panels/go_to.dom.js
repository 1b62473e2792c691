import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/go_to.js";
import {at, rig} from "../support/rig.js";
import "#page/map/top_view.js";

test("a distance says its age", async () => {
  const {tell, alive, panels: [view, go]} = await rig("top-view", "go-to");
  tell(1, "gps", at(-35, 149), 0);
  view.render(0);
  go.choose({lat: -35, lon: 149}); go.render(100);
  const fresh = [go.where.textContent.endsWith("0.0 m away"), go.where.classList.contains("old")];
  alive(9000); go.render(9000);
  const stale = [go.where.textContent.endsWith("0.0 m away 9.0 s ago"), go.where.classList.contains("old")];
  assert.deepEqual([...fresh, ...stale], [true, false, true, true]);
});

test("what was begun for one vehicle is not told as the other's, and closes nothing of the other", async () => {
  const {fleet, asked, tell, panels: [, go]} = await rig("top-view", "go-to"), told = [];
  go.addEventListener("begun", ({detail}) => told.push(detail.job));
  for (const id of [1, 2]) tell(id, "gps", at(-35, 149), 0);
  go.choose({lat: -35, lon: 149}); go.send();
  const sent = asked.at(-1);
  fleet.choose(2);
  go.choose({lat: -35, lon: 149});
  await sent.answer({job: 1});
  assert.deepEqual([sent.path, told, go.hidden], ["/vehicles/1/movement/go_to_gps_wait", [], false]);
});
