import {test} from "node:test";
import assert from "node:assert/strict";
import {Draft} from "#page/plan/draft.js";
import {COMMANDS, isEnd, isTakeoff, newItem, nameOf, ofReport, placeOf, withParam,
  wordsOf} from "#page/plan/items.js";

const at = (lat, lon) => ({lat, lon});
const waypoint = lat => newItem(COMMANDS.NAV_WAYPOINT, at(lat, 1), 10);
const names = draft => draft.items.map(item => nameOf(item.command).replace("NAV_", ""));
const lats = draft => draft.items.filter(placeOf).map(item => item.params[4]);

function begun() {
  const draft = new Draft();
  draft.begin(true, 10);
  return draft;
}

test("a mission begins with a take-off and ends with a return; what is added comes before that", () => {
  const draft = begun();
  const first = draft.insert([waypoint(1)]);
  draft.insert([waypoint(2)]);
  draft.insert([newItem(COMMANDS.DO_CHANGE_SPEED)], first);
  assert.deepEqual(names(draft), ["TAKEOFF", "WAYPOINT", "DO_CHANGE_SPEED", "WAYPOINT", "RETURN_TO_LAUNCH"]);
  assert.ok(isTakeoff(draft.items[0]) && isEnd(draft.items[4]) && draft.numberOf(first) === 2);
});

test("a rover's mission has no take-off, and without waypoints nothing can be uploaded", () => {
  const draft = new Draft();
  draft.begin(false, 10);
  assert.equal(draft.problem, "draw waypoints first");
  draft.insert([waypoint(1)]);
  assert.deepEqual([names(draft), draft.problem], [["WAYPOINT", "RETURN_TO_LAUNCH"], ""]);
});

test("a jump leads to the same item whatever is inserted, moved or removed; to one that is gone it is told", () => {
  const draft = begun(), target = draft.insert([waypoint(1)]);
  const jump = draft.insert([{...newItem(COMMANDS.DO_JUMP), target}]);
  const jumps = () => draft.written().find(item => item.command === COMMANDS.DO_JUMP).params[0];
  assert.equal(jumps(), 2);
  draft.insert([waypoint(2)], draft.items[0].id);
  assert.deepEqual([jumps(), wordsOf(draft.get(jump), id => draft.numberOf(id))], [3, "Jump to 3, 1 ×"]);
  draft.remove(target);
  assert.equal(draft.problem, "item 3 jumps to an item that is gone");
  draft.undo();
  assert.deepEqual([jumps(), draft.problem], [3, ""]);
});

test("all of a drag is one thing to undo, and undone it can be done again", () => {
  const draft = begun(), id = draft.insert([waypoint(1)]);
  draft.move(id, at(2, 2));
  draft.move(id, at(3, 3));
  draft.keep();
  const moved = lats(draft);
  draft.undo();
  const undone = lats(draft);
  draft.redo();
  assert.deepEqual([moved, undone, lats(draft)], [[3], [1], [3]]);
  draft.keep(); // nothing was moved
  assert.equal(draft.past.length, 3);
});

test("an id comes back by undo only, so that no jump leads to another item", () => {
  const draft = begun(), first = draft.insert([waypoint(1)]);
  draft.undo();
  const second = draft.insert([waypoint(2)]);
  assert.ok(second !== first);
});

test("items that a vehicle holds become a draft, and are written as they were", () => {
  const reports = [{seq: 1, command: "NAV_TAKEOFF", frame: "relative", param1: 0, param2: 0, param3: 0, param4: 0,
    lat: 0, long: 0, alt: 12, autocontinue: true},
  {seq: 2, command: "NAV_WAYPOINT", frame: "amsl", param1: 3, param2: null, param3: 0, param4: 0, lat: 1.5, long: 2.5,
    alt: 600, autocontinue: true},
  {seq: 3, command: "DO_JUMP", frame: "mission", param1: 2, param2: 4, param3: 0, param4: 0, param5: 0, param6: 0,
    param7: 0, autocontinue: true},
  {seq: 4, command: "DO_SPRAYER", frame: "mission", param1: 1, param2: 0, param3: 0, param4: 0, autocontinue: true}];
  const draft = new Draft();
  draft.load(reports.map(ofReport));
  draft.insert([waypoint(9)], draft.items[0].id);
  const written = draft.written();
  assert.deepEqual(written.map(item => item.params), [[0, 0, 0, 0, 0, 0, 12], [0, 0, 0, 0, 9, 1, 10],
    [3, 0, 0, 0, 1.5, 2.5, 600], [3, 4, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0, 0]]);
  assert.deepEqual(written.map(item => [item.command, item.frame]), [[22, 3], [16, 3], [16, 0], [177, 2],
    ["DO_SPRAYER", 2]]);
});

test("what an item does is said with its numbers", () => {
  const words = item => wordsOf(item, () => 0);
  assert.deepEqual([words(waypoint(1)), words(withParam(waypoint(1), 0, 5)), words(newItem(COMMANDS.DO_CHANGE_SPEED)),
    words(newItem(COMMANDS.DO_SET_CAM_TRIGG_DIST)), words(newItem(COMMANDS.NAV_RETURN_TO_LAUNCH)),
    words({...waypoint(1), frame: 0}), words(newItem(COMMANDS.DO_SET_SERVO)),
    words({command: 42, frame: 3, params: [0, 0, 0, 0, 0, 0, 0]})],
  ["Waypoint 10 m", "Waypoint 10 m, wait 5 s", "Speed of 5 m/s", "Camera a picture every 10 m", "Return",
    "Waypoint 10 m above sea level", "Servo number 9, pulse 1500 µs", "MAV_CMD 42"]);
});
