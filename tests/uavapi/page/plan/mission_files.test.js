import {test} from "node:test";
import assert from "node:assert/strict";
import {readMission, toPlan, toWpl} from "#page/plan/mission_files.js";
import {Draft} from "#page/plan/draft.js";
import {COMMANDS, newItem} from "#page/plan/items.js";

const HOME = {lat: -35.363261, lon: 149.16523, altitude: 584};
const failure = text => { try { readMission(text); return ""; } catch (error) { return error.message; } };

function drawn() {
  const draft = new Draft();
  draft.begin(true, 10);
  const target = draft.insert([newItem(COMMANDS.NAV_WAYPOINT, {lat: -35.1234567, lon: 149.7654321}, 12.5)]);
  draft.insert([{...newItem(COMMANDS.DO_JUMP), target}, newItem(COMMANDS.DO_SET_CAM_TRIGG_DIST)]);
  return draft;
}

test("a draft comes back from either kind of file as it was saved", () => {
  const draft = drawn(), written = draft.written().map(item => ({...item, autocontinue: true}));
  for (const text of [toWpl(draft.written(), HOME), toPlan(draft.written(), HOME, "copter")]) {
    assert.deepEqual(readMission(text), {items: written, hasFence: false, hasRally: false});
  }
  assert.ok(toWpl(draft.written(),
    HOME).startsWith("QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.16523\t584\t1\n"));
});

test("a plan of QGroundControl: its survey is its items, a jump leads to a number, and its fence is told", () => {
  const simple = (command, id, params) => ({type: "SimpleItem", autoContinue: true, command, doJumpId: id, frame: 3,
    params});
  const survey = {type: "ComplexItem", complexItemType: "survey",
    TransectStyleComplexItem: {Items: [simple(16, 5, [0, 0, 0, null, 1, 2, 30]), simple(206, 6, [20, 0, 1, 0, 0, 0,
      0])]}};
  const plan = {fileType: "Plan", mission: {items: [simple(22, 1, [0, 0, 0, null, 0, 0, 15]), survey,
    simple(177, 9, [5, 2, 0, 0, 0, 0, 0])]}, geoFence: {polygons: [{}], circles: []}, rallyPoints: {points: [[1, 2,
      3]]}};
  const {items, hasFence, hasRally} = readMission(JSON.stringify(plan));
  assert.deepEqual(items.map(item => item.command), [22, 16, 206, 177]);
  assert.deepEqual([items[3].params[0], items[1].params, hasFence, hasRally], [2, [0, 0, 0, 0, 1, 2, 30], true,
    true]);
});

test("a list that is numbered from 1 has no home, and keeps its first waypoint", () => {
  const row = number => [number, 0, 3, 16, 0, 0, 0, 0, 1, 2, 10, 1].join("\t");
  assert.equal(readMission(`QGC WPL 110\n${row(1)}\n${row(2)}\n`).items.length, 2);
});

test("home is a waypoint or has no command, and a parameter may be left to the autopilot", () => {
  const row = (number, command, yaw = 0) => [number, 0, 3, command, 0, 0, 0, yaw, 1, 2, 10, 1].join("\t");
  const text = command => `QGC WPL 110\n${row(0, command)}\n${row(1, 16, "NaN")}\n`;
  assert.deepEqual(readMission(text(16)), readMission(text(0)));
  assert.deepEqual(readMission(text(0)).items.map(item => item.params), [[0, 0, 0, 0, 1, 2, 10]]);
  assert.equal(failure(text(22)), "row 1 is no home: it has the command 22");
  assert.equal(failure(`QGC WPL 110\n${row(1, 16).replace("\t10\t", "\tnan\t")}`), "row 1: nan is no number");
});

test("a fence of version 1 is told, too", () => {
  const item = {command: 16, frame: 3, params: [0, 0, 0, 0, 1, 2, 30]};
  assert.ok(readMission(JSON.stringify({mission: {items: [item]}, geoFence: {polygon: [[1, 2]]}})).hasFence);
});

test("what is not understood is refused, and nothing missing becomes 0", () => {
  const place = [0, 0, 0, 0, null, 2, 30];
  const plan = item => JSON.stringify({mission: {items: [item]}});
  assert.deepEqual([failure("hello"), failure("QGC WPL 110\n0 1 2\n"),
    failure("QGC WPL 110\n5\t0\t3\t16\t0\t0\t0\t0\t1\t2\t3\t1"),
    failure(plan({command: 16, frame: 3, params: place})), failure(plan({type: "ComplexItem",
      complexItemType: "StructureScan"})),
    failure("{}"), failure(plan({command: 16, frame: 3, params: [1, 2]})),
    failure(plan({command: 22, frame: 3, params: [0, 0, 0, 0, 0, 0, 30], Altitude: 50}))],
  ["this is neither a QGC WPL 110 file nor a .plan file", "row 1 has 3 columns, not 12", "row 1 has number 5",
    "item 1: its parameter 5 is no number", "its StructureScan can be read by QGroundControl only",
    "this file has no mission", "item 1 is not as QGroundControl writes it",
    "item 1: its Altitude is 50, and in its params it is 30"]);
});
