import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/history_list.js";
import {rig} from "../support/rig.js";

test("entries stand where their times are, one is there once, older ones come when asked for", async () => {
  const {fleet, asked, panels: [list]} = await rig("history-list");
  const entry = (id, seconds, vehicle = 1) =>
    ({id, time: `2026-05-04T13:20:0${seconds}.000+00:00`, kind: "mode", vehicle, sentence: id});
  const shown = () =>
    [...list.list.children].filter(row => !row.hidden).map(row => row.lastChild.textContent).join(" ");
  const hear = one => fleet.take({system: one.vehicle, event: "history", info: one}, 0);
  hear(entry("unseen", 9)); // the page is not read yet: it will be in it
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({entries: [entry("d", 4), entry("c", 3)], next: "c"});
  hear(entry("e", 5, 2)); hear(entry("e", 5, 2)); hear(entry("late", 3));
  list.older.click();
  await asked[1].answer({entries: [entry("c", 3), entry("a", 1)], next: null});
  const all = shown();
  list.only.checked = true; list.filter();
  const one = shown();
  fleet.choose(2);
  assert.deepEqual([asked[1].path, all, one, shown(), list.older.hidden],
    ["/audit?limit=100&before=c", "e d late c a", "d late c a", "e", true]);
});

test("both times are told, and what nobody has asked for stands out", async () => {
  const {asked, panels: [list]} = await rig("history-list");
  const time = "2026-05-04T13:20:07.123+00:00";
  list.dispatchEvent(new Event("opened"));
  await asked[0].answer({next: null, entries: [
    {id: "3", time, kind: "mode", vehicle: 1, sentence: "by a failsafe", by: "failsafe"},
    {id: "2", time, kind: "mode", vehicle: 1, sentence: "by land of anna", by: "client"},
    {id: "1", time, kind: "command", vehicle: 1, sentence: "takeoff", outcome: "ok"}]});
  const rows = [...list.list.children], local = new Date(time).toLocaleTimeString([], {hour12: false});
  const times = [local, "13:20:07 UTC"].map(text => rows[0].innerText.includes(text));
  assert.deepEqual([rows.map(row => row.className), times], [["bad", "", ""], [true, true]]);
});
