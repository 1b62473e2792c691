import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/parameter_list.js";
import {rig} from "../support/rig.js";

test("another vehicle's parameters are not shown: not until the answer, and not by a late one", async () => {
  const {fleet, asked, panels: [list]} = await rig("parameter-list"), shown = () => list.rows.innerText;
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({parameters: {OF_1: 1}});
  const first = shown();
  fleet.choose(2);
  const cleared = shown();
  fleet.choose(1);
  await asked[1].answer({parameters: {OF_2: 2}});
  assert.ok(first.includes("OF_1") && cleared === "" && shown() === "" &&
    asked[2].path.startsWith("/vehicles/1/"));
});

test("a value goes to the vehicle whose row it is, and what became of it is told as that one's", async () => {
  const {fleet, asked, panels: [list]} = await rig("parameter-list");
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({parameters: {OF_1: 1}});
  const set = list.querySelector("hold-button");
  fleet.choose(2);
  set.dispatchEvent(new Event("confirmed"));
  const put = asked.find(one => one.method === "PUT");
  await put.answer({value: 1, result: "set"});
  assert.ok(put.path === "/vehicles/1/parameters/OF_1" && list.answer.textContent === "vehicle 1: set");
});
