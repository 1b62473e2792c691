import {test} from "node:test";
import assert from "node:assert/strict";
import {Caller} from "#page/model/caller.js";

test("before the role is known everything is shown; then what it allows, and a change of it is told once", () => {
  const caller = new Caller(), told = [];
  caller.addEventListener("changed", () => told.push(caller.words));
  const before = [caller.may("admin"), caller.words];
  caller.take({name: "anna", role: "fly"});
  caller.take({name: "anna", role: "fly"});
  assert.deepEqual([before, ["watch", "fly", "admin"].map(role => caller.may(role)), told],
    [[true, ""], [true, true, false], ["You are anna and may fly"]]);
});
