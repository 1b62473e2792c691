import {test} from "node:test";
import assert from "node:assert/strict";
import {MessageList} from "#page/panels/message_list.js";
import {rig} from "../support/rig.js";

test("a text that is told again after a reconnection is the same", () => {
  const fleet = new EventTarget(), list = new MessageList(); list.start({fleet});
  const text = (time, clock) => list.heard(
    {event: "statustext", system: 1, time, clock, info: {severity: 4, text: "a"}});
  text(1, 7); text(3601, 7); text(3602, 8);
  assert.ok(list.list.children.length === 2);
});

test("deliveries are the business of the tab Gradys", async () => {
  const {fleet, panels: [list]} = await rig("message-list");
  fleet.take({system: 0, event: "delivered", info: {count: 9, sink: "x"}}, 0);
  fleet.take({system: 1, event: "statustext", time: 0, clock: 1, info: {severity: 2, text: "EKF"}}, 0);
  assert.deepEqual([...list.list.children].map(row => row.lastChild.textContent), ["EKF"]);
});
