import {test} from "node:test";
import assert from "node:assert/strict";
import {JobList} from "#page/panels/job_list.js";
import {strips} from "../support/rig.js";
import {same} from "../support/same.js";

test("an old job that still runs keeps its row, and its button", () => {
  const jobs = new Map(Array.from({length: 60}, (_, n) => [String(n), {job: String(n), system: 1,
    verb: "/a", state: n === 3 ? "running" : "succeeded", result: "", seconds: 1, progress: {}}]));
  const list = new JobList(), fleet = {jobs, vehicles: new Map()};
  list.start({fleet, stream: {trouble: () => ""}}); list.render(0);
  assert.ok(list.rows.size === 26 && !list.rows.get("3").abort.hidden);
});

test("how far it is to go is grey and says its age when it is not live; how a job ended is not", async () => {
  const scene = strips(), {fleet, told, stream} = scene;
  told("GUIDED", 0);
  const tell = info => fleet.take({system: 1, event: "job", info: {verb: "go", ...info}}, 0);
  tell({job: "1", state: "succeeded", result: "there", seconds: 1});
  tell({job: "2", state: "running", progress: {distance_to_go: 5}});
  const panel = document.createElement("job-list");
  panel.start({fleet, stream});
  const told_of = row => [row.className, row.querySelector(".age").textContent];
  const rows = () => [...panel.querySelectorAll("li")].map(told_of);
  panel.render(100); const live = rows();
  panel.render(9000); const lost = rows();
  told("GUIDED", 9000); scene.why = "gone"; panel.render(9000);
  const ended = ["succeeded", ""], grey = [["running old", "9.0 s old"], ended];
  assert.ok(same(live, [["running", ""], ended]) && same(lost, grey) && same(rows(), grey));
});
