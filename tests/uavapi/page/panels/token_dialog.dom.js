import {test} from "node:test";
import assert from "node:assert/strict";
import "#page/panels/token_dialog.js";

test("it leaves HOLD ALL to be clicked", () => {
  const panel = document.createElement("token-dialog");
  panel.start({api: Object.assign(new EventTarget(), {hasToken: false})});
  document.body.append(panel);
  panel.ask();
  const dialog = panel.querySelector("dialog"), found = dialog.open && !dialog.matches(":modal");
  panel.remove();
  assert.ok(found);
});
