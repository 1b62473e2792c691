import {test} from "node:test";
import assert from "node:assert/strict";
import {MessageList} from "#page/panels/message_list.js";

test("a text that is told again after a reconnection is the same", () => {
  const fleet = new EventTarget(), list = new MessageList(); list.start({fleet});
  const text = (time, clock) => list.heard(
    {event: "statustext", system: 1, time, clock, info: {severity: 4, text: "a"}});
  text(1, 7); text(3601, 7); text(3602, 8);
  assert.ok(list.list.children.length === 2);
});
