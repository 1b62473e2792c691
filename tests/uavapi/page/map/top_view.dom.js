import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/map/top_view.js";
import {at, rig} from "../support/rig.js";
import {same} from "../support/same.js";

test("a vehicle that does not know where it is, is nowhere: not on the equator", async () => {
  const {fleet, tell, panels: [view]} = await rig("top-view");
  tell(1, "gps", at(0, 0), 0); tell(2, "gps", at(-35, 149), 0);
  view.render(0);
  assert.ok(view.placeOf(fleet.of(1)) === null && view.plane.lat === -35 &&
    same(view.places(), [[0, 0], [0, 0]]));
});

test("an arrow only moves; Enter places where the cursor is, once however long it is held", async () => {
  const {context, tell, panels: [view]} = await rig("top-view"), placed = [];
  tell(1, "gps", at(-35, 149), 0);
  view.addEventListener("place", event => placed.push(event.detail));
  view.addEventListener("nudge", event => context.sketch.change({cursor: event.detail}));
  const press = (key, repeat = false) =>
    view.canvas.dispatchEvent(new KeyboardEvent("keydown", {key, repeat}));
  press("ArrowUp"); press("ArrowUp"); press("ArrowRight");
  const moved = placed.length;
  press("Enter"); press("Enter", true);
  view.render(0);
  assert.ok(moved === 0 && placed.length === 1 && Math.abs(view.metresOf(placed[0])[0] - 2) < 1e-6 &&
    view.canvas.ariaLabel.includes("the cursor is 2 m north, 1 m east of home"));
});

test("what is old says where it was", async () => {
  const {tell, alive, panels: [view]} = await rig("top-view");
  tell(1, "gps", at(-35, 149), 0);
  view.render(100);
  const fresh = view.canvas.ariaLabel;
  alive(9000); view.render(9000);
  assert.ok(fresh.includes("vehicle 1 is 0 m north") &&
    view.canvas.ariaLabel.includes("vehicle 1 was 0 m north, 0 m east of home 9.0 s ago"));
});

test("no label lies below a vehicle's symbol, whichever is drawn later", async () => {
  const {tell, panels: [view]} = await rig("top-view");
  tell(1, "gps", at(-35, 149), 0); tell(2, "gps", at(-35, 149.0001), 0);
  view.render(0);
  const labels = [], own = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function fillText(text, x, y) {
    if (text.includes("·")) labels.push([x, y, this.measureText(text).width]);
    own.call(this, text, x, y);
  };
  view.camera.zoom(28 / Math.abs(view.camera.pixels(view.placeOf(view.context.fleet.of(2)))[0]
    - view.camera.pixels(view.placeOf(view.context.fleet.of(1)))[0])); // 28 px apart: a label would lie there
  view.render(0);
  CanvasRenderingContext2D.prototype.fillText = own;
  const symbols = view.symbols(), clash = ([x, y, wide]) => symbols.some(one =>
    x < one.x + one.width && one.x < x + wide && y - 12 < one.y + one.height && one.y < y + 3);
  assert.deepEqual([labels.length, symbols.length, labels.filter(clash)], [2, 2, []]);
});
