import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/flight_list.js";
import {rig} from "../support/rig.js";

const flight = {id: "20260504-132007-survey", name: "<b>survey</b>", notes: "", vehicles: [1, 2],
  began: "2026-05-04T13:20:07+00:00", ended: "2026-05-04T13:30:07+00:00", state: "complete", bytes: 910113};

test("a flight is shown with its vehicles and size, and what may be done with it as far as it has come", async () => {
  const {asked, panels: [list]} = await rig("flight-list");
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({flights: [flight, {...flight, id: "a", state: "ended", bytes: 0},
    {...flight, id: "b", name: "", state: "recording", ended: ""}]});
  const rows = [...list.rows.children],
    buttons = rows.map(row => [...row.querySelectorAll("button")].map(one => one.textContent));
  assert.deepEqual(buttons, [["MCAP", "Tables"], ["MCAP"], ["End"]]);
  const links = rows.map(row => row.querySelector("a")?.getAttribute("href"));
  assert.deepEqual(links, ["#replay=20260504-132007-survey", undefined, undefined]);
  assert.ok(rows[0].innerText.includes("<b>survey</b>") && rows[0].innerText.includes("vehicle 1, 2"));
  assert.ok(rows[0].innerText.includes("910 kB") && rows[2].innerText.includes("Vehicle 1, 2"));
});

test("a record is begun under its name, and why it is not is said", async () => {
  const {asked, panels: [list]} = await rig("flight-list");
  list.name.value = "survey 3";
  list.form.requestSubmit();
  assert.deepEqual([asked[0].path, asked[0].method], ["/flights", "POST"]);
  await asked[0].refuse("the disk is full");
  assert.ok(list.answer.textContent.includes("the disk is full"));
});
