import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/hold_all.js";
import {spoken, strips} from "../support/rig.js";

test("a screen reader hears no running age; the button to close stays the same one", async () => {
  const scene = strips(), {fleet, told, result} = scene;
  told("GUIDED", 0);
  const panel = document.createElement("hold-all");
  panel.start({fleet, painter: {touch() {}}, api: {urgent: () => new Promise(() => {})}});
  panel.button.click();
  const at = panel.order.at, close = result.querySelector("button");
  panel.render(at + 100);
  const first = spoken(result), age = result.querySelector(".age").textContent;
  panel.render(at + 900);
  const kept = spoken(result) === first && result.querySelector(".age").textContent !== age
    && result.querySelector("button") === close && !result.hidden;
  close.click(); panel.render(at + 1000);
  assert.ok(kept && result.hidden);
});
