import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/mission.js";
import {rig} from "../support/rig.js";

const CORNERS = [[0, 0], [0.001, 0], [0.001, 0.001], [0, 0.001]].map(([lat, lon]) => ({lat, lon}));

async function filling(kind) {
  localStorage.clear();
  const {context, panels: [plan]} = await rig("mission-plan"), {drawn} = plan, {pattern} = drawn;
  Object.values(pattern.buttons).find(one => one.textContent === kind).click();
  for (const corner of CORNERS) context.sketch.tool.add(corner);
  pattern.render(0);
  return {pattern, drawn, sketch: context.sketch};
}

test("a grid by its camera: waypoints at its height, and pictures from the first to the last", async () => {
  const {pattern, drawn, sketch} = await filling("Grid");
  const bySpacing = pattern.words.textContent;
  pattern.camera.checked = true;
  pattern.fields.alt.input.value = "60";
  pattern.draw();
  const shown = [sketch.pattern.length, sketch.lines.length > 0];
  pattern.take();
  const {items} = drawn.draft;
  assert.deepEqual([bySpacing, shown, items.map(item => item.command).slice(0, 4), items.at(-1).command,
    items[1].params[6], items[2].params[0], items.at(-2).params[0], sketch.tool, sketch.lines],
  ["12 waypoints, 768 m; lines 20.0 m apart", [5, true], [22, 16, 206, 16], 20, 60, 15.6, 0, null, []]);
});

test("Done puts what was drawn into the mission, and only ends what is not complete", async () => {
  const {drawn, sketch} = await filling("Grid");
  sketch.tool.complete();
  const {length} = drawn.draft.items;
  const {pattern, drawn: second, sketch: other} = await filling("Grid");
  pattern.change(pattern.corners.slice(0, 1));
  other.tool.complete();
  assert.deepEqual([length, sketch.tool, second.draft.items.length, other.tool], [14, null, 0, null]);
});

test("a corridor with a height that is none cannot be taken, and undo takes its last corner away", async () => {
  const {pattern, sketch} = await filling("Corridor");
  pattern.fields.alt.input.value = "";
  pattern.render(0);
  const refused = pattern.taker.disabled;
  sketch.tool.undo();
  assert.deepEqual([refused, sketch.pattern.length, sketch.tool.handles().length], [true, 3, 3]);
});
