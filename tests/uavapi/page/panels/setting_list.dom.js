import {test} from "node:test";
import assert from "node:assert/strict";
import {inOrder} from "#page/panels/setting_list.js";

test("what may be set comes first", () => {
  assert.deepEqual(inOrder([{name: "a", settable: false}, {name: "b", settable: true}, {name: "c", settable: true}])
  .map(one => one.name), ["b", "c", "a"]);
});
