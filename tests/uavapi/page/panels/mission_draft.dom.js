import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/mission.js";
import "#page/map/top_view.js";
import {rig, settle} from "../support/rig.js";

async function drawing() {
  localStorage.clear();
  const made = await rig("mission-plan");
  const {fleet, context, panels: [plan]} = made;
  fleet.dispatchEvent(new Event("chosen")); // as when the page has heard of its first vehicle
  const {drawn} = plan;
  return {...made, drawn, sketch: context.sketch, words: () => [...drawn.rows.querySelectorAll(".item")]
    .map(one => one.textContent)};
}

test("clicks draw behind what is selected, between a take-off and a return; numbers are the vehicle's", async () => {
  const {drawn, sketch, words} = await drawing();
  drawn.draw(true);
  for (const lat of [1, 2]) sketch.tool.add({lat, lon: 5});
  sketch.tool.select(drawn.draft.items[1].id);
  sketch.tool.add({lat: 3, lon: 5});
  assert.deepEqual([words(), drawn.draft.items.map(item => item.params[4])],
    [["1 Take off 10 m", "2 Waypoint 10 m", "3 Waypoint 10 m", "4 Waypoint 10 m", "5 Return"], [0, 1, 3, 2, 0]]);
});

test("a + that is dragged inserts one waypoint, and one undo takes it away", async () => {
  const {drawn, sketch} = await drawing();
  drawn.draw(true);
  for (const lat of [1, 2]) sketch.tool.add({lat, lon: 5});
  const {tool} = sketch, lats = () => drawn.draft.items.map(item => item.params[4]);
  const key = tool.insert(tool.handles()[0].key, {lat: 1.5, lon: 5});
  tool.move(key, {lat: 1.7, lon: 6});
  tool.keep();
  const dragged = lats();
  tool.undo();
  assert.deepEqual([dragged, lats()], [[0, 1, 1.7, 2, 0], [0, 1, 2, 0]]);
});

test("each vehicle has its own draft, and another page of this browser finds it again", async () => {
  const {fleet, drawn, sketch} = await drawing();
  drawn.draw(true);
  sketch.tool.add({lat: 1, lon: 5});
  fleet.choose(2);
  const second = [drawn.draft.items.length, sketch.tool];
  fleet.choose(1);
  const first = drawn.draft.items.length, again = await rig("mission-plan");
  again.fleet.dispatchEvent(new Event("chosen"));
  assert.deepEqual([second, first, again.panels[0].drawn.draft.items.length], [[0, null], 3, 3]);
  localStorage.setItem("uavapi-draft-1", "no JSON");
  again.fleet.dispatchEvent(new Event("chosen"));
  assert.equal(again.panels[0].drawn.draft.items.length, 0);
});

test("a value that is no number is not taken; one that is changes its item", async () => {
  const {drawn, sketch} = await drawing();
  drawn.draw(true);
  sketch.tool.add({lat: 1, lon: 5});
  const set = value => {
    const input = drawn.rows.querySelector(".selected input");
    input.value = value;
    input.dispatchEvent(new Event("change"));
    return drawn.draft.get(sketch.selected).params[6];
  };
  assert.deepEqual([set(""), set("25.5")], [10, 25.5]);
});

test("a file becomes the draft of the vehicle that it was chosen for, and of no other", async () => {
  const {fleet, drawn, words} = await drawing();
  let read;
  const text = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t1\t2\t3\t1\n1\t0\t3\t16\t0\t0\t0\t0\t1\t2\t12\t1\n";
  const file = {arrayBuffer: () => new Promise(resolve => {
    read = () => resolve(new TextEncoder().encode(text).buffer); })};
  Object.defineProperty(drawn.file, "files", {get: () => [file]});
  drawn.open(); fleet.choose(2); read(); await settle();
  const other = words();
  drawn.open(); read(); await settle();
  assert.deepEqual([other, words(), drawn.answer.textContent], [[], ["1 Waypoint 12 m"], "1 items"]);
});
