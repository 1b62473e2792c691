import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/base/hold_button.js";

test("one that was disabled under a finger takes the next press", () => {
  const b = document.createElement("hold-button"); b.setAttribute("label", "Arm"); document.body.append(b);
  b.button.dispatchEvent(new PointerEvent("pointerdown", {button: 0}));
  b.toggleAttribute("disabled"); b.toggleAttribute("disabled");
  b.button.click(); b.remove();
  assert.ok(b.button.ariaLabel.includes("press again"));
});

test("it may move under the pointer, which may not leave the place of the press", () => {
  const b = document.createElement("hold-button"); b.setAttribute("label", "Arm"); document.body.prepend(b);
  const {left, top, bottom} = b.button.getBoundingClientRect();
  const point = (kind, clientX, clientY) => b.button.dispatchEvent(
    new PointerEvent(kind, {button: 0, clientX, clientY, bubbles: true}));
  point("pointerdown", left, top);
  b.style.marginTop = "100px";
  point("pointermove", left + 1, bottom); point("pointerleave", left + 1, bottom);
  const moved = b.matches(".held");
  point("pointermove", left + 1, bottom + 1);
  const left_it = !b.matches(".held");
  point("pointerdown", left, top); point("pointerup", left, top);
  b.remove();
  assert.ok(moved && left_it && !b.matches(".held"));
});
