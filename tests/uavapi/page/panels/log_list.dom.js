import {test} from "node:test";
import assert from "node:assert/strict";
import {sizeText} from "#page/panels/log_list.js";

test("sizes are said in the unit that fits", () => {
  assert.ok(sizeText(999) === "999 B" && sizeText(1500) === "2 kB" && sizeText(2.54e6) === "2.5 MB");
});
